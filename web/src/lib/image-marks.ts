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
  /** Corners of the template that the tracker found there, pixels; null where the label holds none. */
  outline: [number, number][] | null;
  /** What the tracker made of it in this very picture, if it looked for the target in it. */
  tracker: { state: string; confidence: number } | null;
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

const isNumbers = (value: unknown, count: number): value is number[] =>
  Array.isArray(value) && value.length === count && value.every((v) => typeof v === "number");

interface Tracked {
  point: [number, number, number] | null;
  covariance: number[][] | null;
  pixel: [number, number] | null;
  outline: [number, number][] | null;
  tracker: { state: string; confidence: number } | null;
}

/** What a label says of its own target: where the rover took it to be, and what its tracker found in the picture. */
export function trackedIn(label: Record<string, unknown>): Tracked {
  const point = isNumbers(label.point_m, 3) ? (label.point_m as [number, number, number]) : null;
  const found = label.tracker;
  if (typeof found !== "object" || found === null) return { point, covariance: null, pixel: null, outline: null, tracker: null };
  const track = found as Record<string, unknown>;
  const rows = track.covariance_m2;
  return {
    point: isNumbers(track.point_m, 3) ? (track.point_m as [number, number, number]) : point,
    covariance: Array.isArray(rows) && rows.length === 3 && rows.every((row) => isNumbers(row, 3)) ? (rows as number[][]) : null,
    pixel: isNumbers(track.pixel, 2) ? (track.pixel as [number, number]) : null,
    outline:
      Array.isArray(track.outline) && track.outline.length > 2 && track.outline.every((corner) => isNumbers(corner, 2))
        ? (track.outline as [number, number][])
        : null,
    tracker:
      typeof track.state === "string" && typeof track.confidence === "number" ? { state: track.state, confidence: track.confidence } : null,
  };
}

/** Marks of a picture; null when its label has no camera model. Targets outside the frame are left out. */
export function marksIn(label: Record<string, unknown>, targets: readonly Placed[], own: string | null): ImageMarks | null {
  const camera = cameraOf(label.camera_model);
  if (camera === null) return null;
  const inside = (x: number, y: number): boolean => x > -0.5 && y > -0.5 && x < camera.width - 0.5 && y < camera.height - 0.5;
  const marks: ImageMark[] = [];
  const tracked = trackedIn(label);
  for (const target of targets) {
    const { east_m, north_m, up_m } = target.position;
    const mine = target.id === own;
    const point = (mine ? tracked.point : null) ?? [east_m, north_m, up_m];
    const seen = ellipseInImage(camera, point, (mine ? tracked.covariance : null) ?? target.covariance_m2);
    if (seen === null) continue;
    // The tracker measured the pixel; the point is what came of it with the other camera.
    const [x, y] = (mine ? tracked.pixel : null) ?? seen.center;
    if (!inside(x, y)) continue;
    const { outline, tracker } = mine ? tracked : { outline: null, tracker: null };
    marks.push({ id: target.id, name: target.name, x, y, ...axesOf(seen.matrix), own: mine, outline, tracker });
  }
  return { width: camera.width, height: camera.height, marks };
}
