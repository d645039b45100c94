/** A traverse as the page draws it: `localization/1`, and where its rocks are in the pictures of its stops. */

export interface Picture {
  width: number;
  height: number;
  left_azimuth_rad: number;
  top_elevation_rad: number;
  rad_per_px: number;
}

export interface Stop {
  name: string;
  believed_m: number[];
  believed_covariance_m2: number[][];
  adjusted_m: number[];
  adjusted_covariance_m2: number[][];
  rocks: number;
  picture: Picture;
}

export interface Pair {
  first_m: number[];
  second_m: number[];
  height_m: number;
  probability: number;
}

export interface Leg {
  first: string;
  second: string;
  length_m: number;
  accepted: boolean;
  verdict: string;
  pairs: Pair[];
  rejected: Pair[];
}

export interface Localization {
  format: string;
  stops: Stop[];
  legs: Leg[];
}

/** Standard deviations of the ellipse that holds 95 % of a plane normal distribution. */
export const SIGMAS_95 = Math.sqrt(5.991);

export interface Tie {
  pair: Pair;
  accepted: boolean;
  /** Pixels in the pictures of the first and of the second stop. */
  at: readonly [readonly [number, number], readonly [number, number]];
}

const TURN = 2 * Math.PI;

/** Where a point is in the picture of a stop, pixels from its upper left corner. */
export function pixelOf(stop: Stop, point: readonly number[]): [number, number] {
  const [x = 0, y = 0, z = 0] = point.map((value, axis) => value - (stop.believed_m[axis] ?? 0));
  const { left_azimuth_rad, top_elevation_rad, rad_per_px, width } = stop.picture;
  // A point may be a little left of the first column: it stays there, and does not go once round.
  const half = Math.max(0, TURN - width * rad_per_px) / 2;
  const right = ((((Math.atan2(x, y) - left_azimuth_rad + half) % TURN) + TURN) % TURN) - half;
  return [right / rad_per_px, (top_elevation_rad - Math.atan2(z, Math.hypot(x, y))) / rad_per_px];
}

/** The pairs of a leg, those that count first; of a refused leg none counts. */
export function tiesOf(found: Localization, leg: Leg): Tie[] {
  const [first, second] = [leg.first, leg.second].map((name) => found.stops.find((stop) => stop.name === name));
  if (first === undefined || second === undefined) return [];
  const tie = (pair: Pair, accepted: boolean): Tie => ({
    pair,
    accepted,
    at: [pixelOf(first, pair.first_m), pixelOf(second, pair.second_m)],
  });
  return [...leg.pairs.map((pair) => tie(pair, leg.accepted)), ...leg.rejected.map((pair) => tie(pair, false))];
}

/** Largest deviation in the plane. */
export function sigmaOf(covariance: readonly (readonly number[])[]): number {
  const [a, b, d] = [covariance[0]?.[0] ?? 0, covariance[0]?.[1] ?? 0, covariance[1]?.[1] ?? 0];
  return Math.sqrt(Math.max(0, (a + d) / 2 + Math.hypot((a - d) / 2, b)));
}

/** How far the adjustment moved a stop in the plane. */
export function movedBy(stop: Stop): number {
  const [east = 0, north = 0] = stop.adjusted_m.map((value, axis) => value - (stop.believed_m[axis] ?? 0));
  return Math.hypot(east, north);
}

/** The rows of a picture in which rocks are, with some ground round them. */
export function rowsOf(picture: Picture, rows: readonly number[], margin = 100): { top: number; height: number } {
  const top = Math.max(0, Math.min(...rows, picture.height) - margin);
  const bottom = Math.min(picture.height, Math.max(...rows, 0) + margin);
  return bottom - top < 2 * margin ? { top: 0, height: picture.height } : { top, height: bottom - top };
}
