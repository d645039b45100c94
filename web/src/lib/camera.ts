/**
 * Camera models CAHV, CAHVOR and CAHVORE, as the rover has them: project, back-project, and what a picture needs.
 *
 * Yakimovsky and Cunningham 1978, Gennery 1993, Gennery 2006. Pixel (0, 0) is the centre of the upper left one.
 */

export type Vector = readonly [number, number, number];

export interface CameraModel {
  kind: "CAHV" | "CAHVOR" | "CAHVORE";
  width: number;
  height: number;
  C: readonly number[];
  A: readonly number[];
  H: readonly number[];
  V: readonly number[];
  O: readonly number[];
  R: readonly number[];
  E: readonly number[];
  linearity: number;
}

export const vector = (values: readonly number[]): Vector => [values[0] ?? 0, values[1] ?? 0, values[2] ?? 0];
export const dot = (a: Vector, b: Vector): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a: Vector, b: Vector): Vector => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];
const minus = (a: Vector, b: Vector): Vector => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const along = (a: Vector, d: Vector, t: number): Vector => [a[0] + t * d[0], a[1] + t * d[1], a[2] + t * d[2]];
const scaled = (a: Vector, k: number): Vector => [a[0] * k, a[1] * k, a[2] * k];
export const unit = (a: Vector): Vector => scaled(a, 1 / Math.hypot(...a));

function chiOf(theta: number, linearity: number): number {
  if (linearity > 1e-15) return Math.tan(linearity * theta) / linearity;
  if (linearity < -1e-15) return Math.sin(linearity * theta) / linearity;
  return theta;
}

function thetaOf(chi: number, linearity: number): number {
  if (linearity > 1e-15) return Math.atan(linearity * chi) / linearity;
  if (linearity < -1e-15) return Math.asin(Math.max(-1, Math.min(1, linearity * chi))) / linearity;
  return chi;
}

/** Angle at which a ray meets the moving entrance pupil; Newton. */
function entranceAngle(omega: number, lam: number, e: Vector): number {
  let theta = Math.atan2(lam, omega);
  for (let k = 0; k < 60; k += 1) {
    const [s, c, t2] = [Math.sin(theta), Math.cos(theta), theta * theta];
    const g = e[0] + t2 * (e[1] + t2 * e[2]);
    const dg = theta * (2 * e[1] + 4 * e[2] * t2);
    const slope = omega * c + lam * s - (1 - c) * g - (theta - s) * dg;
    const step = (omega * s - lam * c - (theta - s) * g) / slope;
    theta -= step;
    if (Math.abs(step) < 1e-12) break;
  }
  return theta;
}

/** Where a point appears: [sample, line], or null when it is not in front of the camera. */
export function project(camera: CameraModel, point: Vector): [number, number] | null {
  let d = minus(point, vector(camera.C));
  if (camera.kind !== "CAHV") {
    const [o, r] = [vector(camera.O), vector(camera.R)];
    const omega = dot(d, o);
    const l = along(d, o, -omega);
    if (camera.kind === "CAHVOR") {
      if (omega <= 0) return null;
      const tau = dot(l, l) / (omega * omega);
      d = along(d, l, r[0] + tau * (r[1] + tau * r[2]));
    } else {
      const lam = Math.sqrt(dot(l, l));
      if (lam > 1e-9 * Math.abs(omega)) {
        const theta = entranceAngle(omega, lam, vector(camera.E));
        if (Math.abs(theta * camera.linearity) >= Math.PI / 2 || theta <= 0 || theta > 0.95 * Math.PI) return null;
        const chi = chiOf(theta, camera.linearity);
        const chi2 = chi * chi;
        d = along(scaled(o, lam / chi), l, 1 + r[0] + chi2 * (r[1] + chi2 * r[2]));
      } else if (omega <= 0) return null;
    }
  }
  const alpha = dot(d, vector(camera.A));
  if (alpha <= 1e-12) return null;
  return [dot(d, vector(camera.H)) / alpha, dot(d, vector(camera.V)) / alpha];
}

/** Solve (1 + r0) u + r1 u^3 + r2 u^5 = wanted for u near it; Newton. */
function undistort(wanted: number, r: Vector): number {
  let u = wanted;
  for (let k = 0; k < 60; k += 1) {
    const u2 = u * u;
    const df = 1 + r[0] + u2 * (3 * r[1] + 5 * r[2] * u2);
    if (df < 1e-6) {
      u *= 0.8;
      continue;
    }
    const step = (u * (1 + r[0] + u2 * (r[1] + u2 * r[2])) - wanted) / df;
    u -= step;
    if (Math.abs(step) < 1e-14 * (1 + Math.abs(u))) break;
  }
  return u;
}

/** Origin and unit direction of the ray of a pixel. */
export function backProject(camera: CameraModel, sample: number, line: number): { origin: Vector; ray: Vector } {
  const [c, a, h, v] = [vector(camera.C), vector(camera.A), vector(camera.H), vector(camera.V)];
  let ray = unit(cross(along(v, a, -line), along(h, a, -sample)));
  if (dot(a, cross(v, h)) < 0) ray = scaled(ray, -1);
  if (camera.kind === "CAHV") return { origin: c, ray };
  const o = vector(camera.O);
  const zeta = dot(ray, o);
  const l = along(ray, o, -zeta);
  const lam = Math.sqrt(dot(l, l));
  if (lam < 1e-9 * Math.abs(zeta)) return { origin: c, ray: o };
  const u = undistort(lam / zeta, vector(camera.R));
  let [s, co, origin] = [u, 1, c];
  if (camera.kind === "CAHVORE") {
    const theta = thetaOf(u, camera.linearity);
    [s, co] = [Math.sin(theta), Math.cos(theta)];
    const [e, t2] = [vector(camera.E), theta * theta];
    origin = along(c, o, (theta / s - 1) * (e[0] + t2 * (e[1] + t2 * e[2])));
  }
  return { origin, ray: unit(along(scaled(o, co), l, s / lam)) };
}

/** A camera with its vectors moved from a mount to another frame: `axes` holds the mount's x, y and z there. */
export function moved(camera: CameraModel, axes: readonly [Vector, Vector, Vector], origin: Vector): CameraModel {
  const turn = (values: readonly number[]): Vector => {
    const [x, y, z] = vector(values);
    return along(along(scaled(axes[0], x), axes[1], y), axes[2], z);
  };
  const at = turn(camera.C);
  return {
    ...camera,
    C: [at[0] + origin[0], at[1] + origin[1], at[2] + origin[2]],
    A: turn(camera.A),
    H: turn(camera.H),
    V: turn(camera.V),
    O: turn(camera.O),
  };
}

/** Whether straight lines stay straight, so that one matrix is the whole camera. */
export const isLinear = (camera: CameraModel): boolean =>
  camera.kind === "CAHV" || (camera.kind === "CAHVOR" && camera.R.every((r) => r === 0));

/**
 * The linear camera as a matrix from the site (east, north, up, 1) to clip space, row by row.
 *
 * The picture's edges (half a pixel outside the outer centres) are the sides of the clip cube; depth goes from -1 at
 * `near` to 1 at `far` metres along A.
 */
export function clipMatrix(camera: CameraModel, near: number, far: number): number[][] {
  const [c, a, h, v] = [vector(camera.C), vector(camera.A), vector(camera.H), vector(camera.V)];
  const row = (d: Vector, shift = 0): number[] => [...d, -dot(d, c) + shift];
  // sample = H.d / A.d; across = 2 (sample + 0.5) / width - 1, times A.d.
  const across = along(scaled(h, 2 / camera.width), a, 1 / camera.width - 1);
  const upward = along(scaled(v, -2 / camera.height), a, 1 - 1 / camera.height);
  const k = (far + near) / (far - near);
  return [row(across), row(upward), row(scaled(a, k), (-2 * far * near) / (far - near)), row(a)];
}

export interface Warp {
  /** The linear camera whose picture is bent. */
  linear: CameraModel;
  columns: number;
  rows: number;
  /** For each node, row by row from the upper left: where it is found in the linear picture, pixels. */
  from: [number, number][];
}

/** How the picture of a linear camera is bent into that of a lens: a grid over the lens's picture. */
export function warp(camera: CameraModel, columns = 48, rows = 36, widest = 1.3): Warp {
  const a = vector(camera.A);
  const right = unit(along(vector(camera.H), a, -dot(vector(camera.H), a)));
  const down = cross(a, right);
  const nodes: [number, number][] = [];
  const limit = Math.tan(widest);
  let [wide, tall] = [0, 0];
  for (let r = 0; r <= rows; r += 1) {
    for (let k = 0; k <= columns; k += 1) {
      const { ray } = backProject(camera, (k * camera.width) / columns - 0.5, (r * camera.height) / rows - 0.5);
      const depth = Math.max(dot(ray, a), 1e-3);
      const x = Math.max(-limit, Math.min(limit, dot(ray, right) / depth));
      const y = Math.max(-limit, Math.min(limit, dot(ray, down) / depth));
      nodes.push([x, y]);
      wide = Math.max(wide, Math.abs(x));
      tall = Math.max(tall, Math.abs(y));
    }
  }
  // As fine as the lens is in the middle of its picture.
  const middle = backProject(camera, (camera.width - 1) / 2, (camera.height - 1) / 2);
  const beside = backProject(camera, (camera.width + 1) / 2, (camera.height - 1) / 2);
  const focal = Math.min(4 * camera.width, 1 / Math.max(1e-6, Math.hypot(...minus(beside.ray, middle.ray))));
  const [width, height] = [Math.ceil(2 * wide * focal), Math.ceil(2 * tall * focal)];
  const [cx, cy] = [(width - 1) / 2, (height - 1) / 2];
  const linear: CameraModel = {
    ...camera,
    kind: "CAHV",
    width,
    height,
    C: middle.origin,
    H: along(scaled(right, focal), a, cx),
    V: along(scaled(down, focal), a, cy),
    O: [0, 0, 0],
    R: [0, 0, 0],
    E: [0, 0, 0],
  };
  return { linear, columns, rows, from: nodes.map(([x, y]) => [x * focal + cx, y * focal + cy]) };
}

/** Ellipse of `sigmas` standard deviations of a point in a picture, pixels; null where the point is not seen. */
export function ellipseInImage(
  camera: CameraModel,
  point: Vector,
  covariance: readonly (readonly number[])[],
  sigmas = 2,
): { center: [number, number]; matrix: [number, number, number] } | null {
  const center = project(camera, point);
  if (center === null) return null;
  const step = 1e-3;
  const jacobian: [number, number][] = [];
  for (const axis of [0, 1, 2]) {
    const beside: [number, number, number] = [...point];
    beside[axis] = (beside[axis] ?? 0) + step;
    const seen = project(camera, beside);
    if (seen === null) return null;
    jacobian.push([(seen[0] - center[0]) / step, (seen[1] - center[1]) / step]);
  }
  const matrix: [number, number, number] = [0, 0, 0];
  for (let i = 0; i < 3; i += 1) {
    for (let j = 0; j < 3; j += 1) {
      const a = jacobian[i] as [number, number];
      const b = jacobian[j] as [number, number];
      const c = covariance[i]?.[j] ?? 0;
      matrix[0] += a[0] * b[0] * c * sigmas * sigmas;
      matrix[1] += a[0] * b[1] * c * sigmas * sigmas;
      matrix[2] += a[1] * b[1] * c * sigmas * sigmas;
    }
  }
  return { center, matrix };
}

/** Read a camera model from a product's label or another plain value; null when it is none. */
export function cameraOf(value: unknown): CameraModel | null {
  if (typeof value !== "object" || value === null) return null;
  const table = value as Record<string, unknown>;
  const kind = table.kind ?? table.model;
  const triple = (name: string): number[] | null => {
    const found = table[name];
    return Array.isArray(found) && found.length === 3 && found.every((v) => typeof v === "number") ? found : null;
  };
  if (kind !== "CAHV" && kind !== "CAHVOR" && kind !== "CAHVORE") return null;
  const [C, A, H, V] = [triple("C"), triple("A"), triple("H"), triple("V")];
  if (C === null || A === null || H === null || V === null) return null;
  if (typeof table.width !== "number" || typeof table.height !== "number") return null;
  const rest = (name: string): number[] => triple(name) ?? [0, 0, 0];
  return {
    kind,
    width: table.width,
    height: table.height,
    C,
    A,
    H,
    V,
    O: rest("O"),
    R: rest("R"),
    E: rest("E"),
    linearity: typeof table.linearity === "number" ? table.linearity : 1,
  };
}
