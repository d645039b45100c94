/** Where targets stand in a picture that came back: by the camera model of its label, with their error ellipses. */

import { cameraOf, ellipseInImage } from "./camera";

export interface Placed {
  id: string;
  name: string;
  position: { east_m: number; north_m: number; up_m: number };
  covariance_m2: readonly (readonly number[])[];
}

export interface ImageMark {
  id: string;
  name: string;
  x: number;
  y: number;
  /** Half axes (pixels) of two standard deviations and the turn of the first from the rows, radians. */
  rx: number;
  ry: number;
  turn: number;
  /** Whether the picture was taken of this target. */
  own: boolean;
}

export interface ImageMarks {
  width: number;
  height: number;
  marks: ImageMark[];
}

/** Half axes of the ellipse x' M^-1 x = 1 of a symmetric matrix [xx, xy, yy], and the turn of the longer one. */
export function axesOf([xx, xy, yy]: readonly [number, number, number]): { rx: number; ry: number; turn: number } {
  const middle = (xx + yy) / 2;
  const radius = Math.hypot((xx - yy) / 2, xy);
  return {
    rx: Math.sqrt(Math.max(0, middle + radius)),
    ry: Math.sqrt(Math.max(0, middle - radius)),
    turn: Math.atan2(2 * xy, xx - yy) / 2,
  };
}

/** Where the rover took the picture's own target to be: tracked, it knew better than the map. */
function pointOf(label: Record<string, unknown>): [number, number, number] | null {
  const p = label.point_m;
  if (!Array.isArray(p) || p.length !== 3 || !p.every((v) => typeof v === "number")) return null;
  return p as [number, number, number];
}

/** Marks of a picture; null when its label has no camera model. Targets outside the frame are left out. */
export function marksIn(label: Record<string, unknown>, targets: readonly Placed[], own: string | null): ImageMarks | null {
  const camera = cameraOf(label.camera_model);
  if (camera === null) return null;
  const inside = (x: number, y: number): boolean => x > -0.5 && y > -0.5 && x < camera.width - 0.5 && y < camera.height - 0.5;
  const marks: ImageMark[] = [];
  for (const target of targets) {
    const { east_m, north_m, up_m } = target.position;
    const point = (target.id === own ? pointOf(label) : null) ?? [east_m, north_m, up_m];
    const seen = ellipseInImage(camera, point, target.covariance_m2);
    if (seen === null || !inside(...seen.center)) continue;
    marks.push({ id: target.id, name: target.name, x: seen.center[0], y: seen.center[1], ...axesOf(seen.matrix), own: target.id === own });
  }
  return { width: camera.width, height: camera.height, marks };
}
