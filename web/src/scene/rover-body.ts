/** The rover as its profile says: body, wheels, mast and arm to scale; what its cameras see as frusta. */

import {
  BoxGeometry,
  BufferGeometry,
  CylinderGeometry,
  Group,
  LineBasicMaterial,
  LineSegments,
  Mesh,
  MeshLambertMaterial,
  Vector3,
} from "three";
import type { RoverShape } from "../api/types";
import { backProject, type CameraModel, moved, type Vector, vector } from "../lib/camera";

/** Rover axes are x forward, y left, z up; a body in the scene has x forward, y up, z right. */
export const toBody = ([x, y, z]: Vector): Vector3 => new Vector3(x, z, -y);

const TINTS = { plain: 0xe8e6e0, reached: 0x7ee2a0, refused: 0xff7a6e } as const;
export type Tint = keyof typeof TINTS;

export function makeRover(shape: RoverShape, opacity = 1, tint: Tint = "plain"): Group {
  const group = new Group();
  const material = (color: number): MeshLambertMaterial =>
    new MeshLambertMaterial({
      color: tint === "plain" ? color : TINTS[tint],
      transparent: opacity < 1,
      opacity,
      depthWrite: opacity >= 1,
    });
  const box = (w: number, h: number, d: number, color: number, x: number, y: number, z: number): Mesh => {
    const mesh = new Mesh(new BoxGeometry(w, h, d), material(color));
    mesh.position.set(x, y, z);
    group.add(mesh);
    return mesh;
  };
  const rod = (from: Vector3, to: Vector3, thick: number, color: number): void => {
    const mesh = new Mesh(new CylinderGeometry(thick, thick, from.distanceTo(to), 8), material(color));
    mesh.position.copy(from).add(to).multiplyScalar(0.5);
    mesh.quaternion.setFromUnitVectors(new Vector3(0, 1, 0), to.clone().sub(from).normalize());
    group.add(mesh);
  };
  const { length_m: length, width_m: width, wheel_radius_m: radius } = shape;
  const belly = Math.max(shape.clearance_m, 1.6 * radius);
  const deck = belly + 0.18;
  box(0.76 * length, 0.18, 0.62 * width, 0xe8e6e0, 0, belly + 0.09, 0);
  box(0.74 * length, 0.02, width, 0x24324a, -0.04 * length, deck + 0.03, 0);
  const [front = 0.4, , rear = -0.4] = shape.axle_x_m;
  for (const side of [-1, 1]) {
    const z = (side * shape.track_m) / 2;
    rod(new Vector3(front, radius + 0.14, z * 0.9), new Vector3(rear, radius + 0.14, z * 0.9), 0.025, 0x8c8f94);
    for (const x of shape.axle_x_m) {
      const wheel = new Mesh(new CylinderGeometry(radius, radius, shape.wheel_width_m, 18), material(0x2c2e31));
      wheel.rotation.x = Math.PI / 2;
      wheel.position.set(x, radius, z);
      group.add(wheel);
    }
  }
  const head = toBody(vector(shape.mast_pivot_m));
  rod(new Vector3(head.x, deck, head.z), head, 0.03, 0xc8c9cc);
  box(0.12, 0.1, 0.36, 0x3a3d42, head.x, head.y, head.z);
  const shoulder = toBody(vector(shape.shoulder_m));
  const elbow = shoulder.clone().add(new Vector3(0.42 * shape.arm_reach_m, 0.1, 0));
  rod(shoulder, elbow, 0.022, 0xd9713c);
  rod(elbow, elbow.clone().add(new Vector3(0.2 * shape.arm_reach_m, -0.16, 0)), 0.022, 0xd9713c);
  return group;
}

/** Axes of the mast head in the rover frame when it stands at these angles. */
export function mastAxes(pan: number, tilt: number): [Vector, Vector, Vector] {
  const [cp, sp, ct, st] = [Math.cos(pan), Math.sin(pan), Math.cos(tilt), Math.sin(tilt)];
  return [
    [ct * cp, ct * sp, st],
    [-sp, cp, 0],
    [-st * cp, -st * sp, ct],
  ];
}

/** A camera of the rover in the rover frame. */
export function mounted(shape: RoverShape, camera: CameraModel & { mount: string }, pan: number, tilt: number): CameraModel {
  return camera.mount === "mast" ? moved(camera, mastAxes(pan, tilt), vector(shape.mast_pivot_m)) : camera;
}

/** Outline of what a camera sees down to `depth` metres, as lines of a body. */
export function frustum(camera: CameraModel, depth: number, color: number): LineSegments {
  const [w, h] = [camera.width - 0.5, camera.height - 0.5];
  const corners: [number, number][] = [[-0.5, -0.5], [w, -0.5], [w, h], [-0.5, h]];
  const points: Vector3[] = [];
  const far = (sample: number, line: number): Vector3 => {
    const { origin, ray } = backProject(camera, sample, line);
    return toBody([origin[0] + depth * ray[0], origin[1] + depth * ray[1], origin[2] + depth * ray[2]]);
  };
  corners.forEach(([x, y], k) => {
    const [u, v] = corners[(k + 1) % 4] as [number, number];
    points.push(toBody(backProject(camera, x, y).origin), far(x, y));
    // The edge of a lens's picture is bent.
    for (let i = 0; i < 8; i += 1) {
      const at = (part: number): Vector3 => far(x + (u - x) * part, y + (v - y) * part);
      points.push(at(i / 8), at((i + 1) / 8));
    }
  });
  return new LineSegments(
    new BufferGeometry().setFromPoints(points),
    new LineBasicMaterial({ color, transparent: true, opacity: 0.85 }),
  );
}
