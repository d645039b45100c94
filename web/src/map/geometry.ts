/** Plane geometry of the plan map: paths of drives, ribbons side by side, ellipses, cones, the rover's outline. */

import type { Leg } from "../lib/plan-tree";

export type Point = [number, number];

export interface Place {
  id: string;
  target_id: string | null;
  pose: { east_m: number; north_m: number };
}

export interface Segment {
  start: string;
  end: string;
  points_m: number[][];
}

export interface Network {
  nodes: readonly Place[];
  segments: readonly Segment[];
}

/** Return the path of a drive: the network's polyline where it has one, else a straight line; null for no place. */
export function pathOf(
  network: Network | null,
  from: string | null,
  to: string,
  fallback: (target: string | null) => Point | null,
): Point[] | null {
  const node = (target: string | null): Place | undefined =>
    network?.nodes.find((place) => (target === null ? place.target_id === null : place.target_id === target));
  const [a, b] = [node(from), node(to)];
  if (network !== null && a !== undefined && b !== undefined) {
    const ahead = network.segments.find((segment) => segment.start === a.id && segment.end === b.id);
    if (ahead !== undefined) return ahead.points_m.map((p) => [p[0] ?? 0, p[1] ?? 0]);
    const back = network.segments.find((segment) => segment.start === b.id && segment.end === a.id);
    if (back !== undefined) return back.points_m.map((p): Point => [p[0] ?? 0, p[1] ?? 0]).reverse();
  }
  const point = (place: Place | undefined, target: string | null): Point | null =>
    place === undefined ? fallback(target) : [place.pose.east_m, place.pose.north_m];
  const [start, end] = [point(a, from), point(b, to)];
  return start === null || end === null ? null : [start, end];
}

export interface Ribbon {
  line: string;
  depth: number;
  step: string;
  p: number;
  path: Point[];
  /** Width and sideways shift (left positive) in pixels. */
  width: number;
  shift: number;
}

export const ribbonWidth = (p: number): number => 2 + 8 * Math.max(0, Math.min(1, p));

/** Return ribbons whose width tells the probability; those on the same path lie side by side. */
export function ribbonsOf(legs: readonly Leg[], way: (from: string | null, to: string) => Point[] | null): Ribbon[] {
  const merged = new Map<string, Ribbon & { pair: string; flipped: boolean }>();
  for (const leg of legs) {
    const key = `${leg.line}|${leg.from ?? ""}|${leg.to}`;
    const known = merged.get(key);
    if (known !== undefined) {
      known.p = Math.min(1, known.p + leg.p);
      continue;
    }
    const path = way(leg.from, leg.to);
    if (path === null || path.length < 2) continue;
    const ends = [leg.from ?? "", leg.to];
    const flipped = (ends[0] ?? "") > (ends[1] ?? "");
    merged.set(key, {
      line: leg.line,
      depth: leg.depth,
      step: leg.step,
      p: leg.p,
      path,
      width: 0,
      shift: 0,
      pair: [...ends].sort().join("|"),
      flipped,
    });
  }
  const ribbons = [...merged.values()];
  for (const group of Map.groupBy(ribbons, (ribbon) => ribbon.pair).values()) {
    for (const ribbon of group) ribbon.width = ribbonWidth(ribbon.p);
    let place = -(group.reduce((sum, ribbon) => sum + ribbon.width + 1, 0) - 1) / 2;
    for (const ribbon of group) {
      const middle = place + ribbon.width / 2;
      ribbon.shift = ribbon.flipped ? -middle : middle;
      place += ribbon.width + 1;
    }
  }
  return ribbons;
}

/** Shift a polyline sideways (left of its direction positive), corners mitred. */
export function offsetPath(path: readonly Point[], distance: number): Point[] {
  if (distance === 0) return [...path];
  const normals: Point[] = [];
  for (let k = 0; k + 1 < path.length; k += 1) {
    const [a, b] = [path[k] as Point, path[k + 1] as Point];
    const size = Math.hypot(b[0] - a[0], b[1] - a[1]) || 1;
    normals.push([-(b[1] - a[1]) / size, (b[0] - a[0]) / size]);
  }
  return path.map((point, k) => {
    const before = normals[Math.max(0, k - 1)] as Point;
    const after = normals[Math.min(normals.length - 1, k)] as Point;
    const sum: Point = [before[0] + after[0], before[1] + after[1]];
    const square = sum[0] ** 2 + sum[1] ** 2;
    // A hairpin has no mitre; its corner stays within twice the distance.
    const scale = square < 0.25 ? 1 : (2 * distance) / square;
    return square < 0.25
      ? [point[0] + after[0] * distance, point[1] + after[1] * distance]
      : [point[0] + sum[0] * scale, point[1] + sum[1] * scale];
  });
}

/** Corners of the ellipse of `sigmas` standard deviations of a horizontal covariance. */
export function ellipse(center: Point, covariance: readonly (readonly number[])[], sigmas = 2, corners = 48): Point[] {
  const a = covariance[0]?.[0] ?? 0;
  const b = covariance[0]?.[1] ?? 0;
  const d = covariance[1]?.[1] ?? 0;
  const middle = (a + d) / 2;
  const radius = Math.hypot((a - d) / 2, b);
  const long = Math.sqrt(Math.max(0, middle + radius)) * sigmas;
  const short = Math.sqrt(Math.max(0, middle - radius)) * sigmas;
  const angle = Math.atan2(2 * b, a - d) / 2;
  return Array.from({ length: corners }, (_, k) => {
    const t = (2 * Math.PI * k) / corners;
    const [x, y] = [long * Math.cos(t), short * Math.sin(t)];
    return [
      center[0] + x * Math.cos(angle) - y * Math.sin(angle),
      center[1] + x * Math.sin(angle) + y * Math.cos(angle),
    ];
  });
}

/** Outline of a body of `length` x `width` metres at a pose. */
export function outline(east: number, north: number, heading: number, length: number, width: number): Point[] {
  const [c, s] = [Math.cos(heading), Math.sin(heading)];
  const corners: Point[] = [
    [length / 2, width / 2],
    [length / 2 + width * 0.28, 0],
    [length / 2, -width / 2],
    [-length / 2, -width / 2],
    [-length / 2, width / 2],
  ];
  return corners.map(([x, y]) => [east + x * c - y * s, north + x * s + y * c]);
}

/** The region from which a target's tracked face stays in view: a cone from the target to where it was first seen. */
export function trackingCone(target: Point, eye: Point, halfAngle: number): Point[] {
  const reach = Math.hypot(eye[0] - target[0], eye[1] - target[1]);
  const middle = Math.atan2(eye[1] - target[1], eye[0] - target[0]);
  const arc = Array.from({ length: 17 }, (_, k): Point => {
    const angle = middle + halfAngle * (k / 8 - 1);
    return [target[0] + reach * Math.cos(angle), target[1] + reach * Math.sin(angle)];
  });
  return [target, ...arc];
}

interface WithStand {
  id: string;
  observation_point?: { pose: { east_m: number; north_m: number; heading_rad: number } | null } | null;
}

/** The request whose observation point is shown: the one in focus, else the first that has one. */
export function standOf<R extends WithStand>(
  requests: readonly R[],
  focus: string | null,
): { request: R; pose: { east_m: number; north_m: number; heading_rad: number } } | null {
  const ordered = [...requests].sort((a, b) => Number(b.id === focus) - Number(a.id === focus));
  for (const request of ordered) {
    const pose = request.observation_point?.pose;
    if (pose) return { request, pose };
  }
  return null;
}

/** Colour of the chance to lose a target on a drive. */
export function lossColour(loss: number, strength = 1): string {
  if (loss <= 0.005) return `rgba(255,255,255,${(0.5 * strength).toFixed(2)})`;
  const heat = Math.min(1, loss / 0.6);
  const alpha = (0.5 + 0.35 * heat) * strength;
  return `rgba(255,${Math.round(235 - 160 * heat)},${Math.round(200 - 150 * heat)},${alpha.toFixed(2)})`;
}

/** The drives of a network, each way once, with the chance to lose a target (or the one most in danger). */
export function drivesOf(
  network: { segments: readonly (Segment & { p_lose: Record<string, number> })[] } | null,
  target: string | null,
): { path: Point[]; loss: number; start: string; end: string }[] {
  const drives = new Map<string, { path: Point[]; loss: number; start: string; end: string }>();
  for (const segment of network?.segments ?? []) {
    const key = [segment.start, segment.end].sort().join("|");
    const chances = target !== null && target in segment.p_lose ? [segment.p_lose[target] ?? 0] : Object.values(segment.p_lose);
    const loss = Math.max(0, ...chances);
    const known = drives.get(key);
    if (known !== undefined) {
      known.loss = Math.max(known.loss, loss);
      continue;
    }
    const path = segment.points_m.map((p): Point => [p[0] ?? 0, p[1] ?? 0]);
    drives.set(key, { path, loss, start: segment.start, end: segment.end });
  }
  return [...drives.values()];
}

export const networkLines = (
  network: Parameters<typeof drivesOf>[0],
  target: string | null,
): { path: Point[]; stroke: string; width: number }[] =>
  drivesOf(network, target).map(({ path, loss }) => ({ path, stroke: lossColour(loss, 0.8), width: 0.03 }));

/** Ground that the arm reaches from a pose: between least and full reach round the shoulder, as far as it turns. */
export function reachSector(
  pose: { east_m: number; north_m: number; heading_rad: number },
  arm: { shoulder_m: readonly number[]; arm_reach_m: number; arm_min_reach_m: number; arm_azimuth_limit_rad: number },
): Point[] {
  const [c, s] = [Math.cos(pose.heading_rad), Math.sin(pose.heading_rad)];
  const [x = 0, y = 0, z = 0] = arm.shoulder_m;
  const middle: Point = [pose.east_m + x * c - y * s, pose.north_m + x * s + y * c];
  // The shoulder stands above the ground: on the level it reaches less far.
  const level = (reach: number): number => Math.sqrt(Math.max(0, reach * reach - z * z));
  const arc = (radius: number, from: number, to: number): Point[] =>
    Array.from({ length: 17 }, (_, k) => {
      const angle = pose.heading_rad + from + ((to - from) * k) / 16;
      return [middle[0] + radius * Math.cos(angle), middle[1] + radius * Math.sin(angle)];
    });
  const limit = arm.arm_azimuth_limit_rad;
  return [...arc(level(arm.arm_reach_m), -limit, limit), ...arc(level(arm.arm_min_reach_m), limit, -limit)];
}

export function polygonArea(corners: readonly (readonly number[])[]): number {
  let twice = 0;
  corners.forEach((a, k) => {
    const b = corners[(k + 1) % corners.length] ?? a;
    twice += (a[0] ?? 0) * (b[1] ?? 0) - (b[0] ?? 0) * (a[1] ?? 0);
  });
  return Math.abs(twice) / 2;
}

export interface Label {
  at: Point;
  width: number;
  height: number;
}

/**
 * Find places for labels beside their points, pixels, y down: right, left, below, above, then the corners.
 *
 * Earlier labels go first; a label that would lie on a mark (of radius `clearance`) or on another label in every
 * place is null. What is given back is the shift of the label's middle from its point.
 */
export function placeLabels(labels: readonly Label[], clearance: number): (Point | null)[] {
  type Box = [number, number, number, number];
  const meets = (a: Box, b: Box): boolean => a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3];
  const marks = labels.map(({ at: [x, y] }): Box => [x - clearance + 2, y - clearance + 2, x + clearance - 2, y + clearance - 2]);
  const taken: Box[] = [];
  return labels.map((label, own) => {
    const [w, h] = [label.width / 2, label.height / 2];
    const side = clearance + 3 + w;
    const over = clearance + 1 + h;
    const shifts: Point[] = [
      [side, 0],
      [-side, 0],
      [0, over],
      [0, -over],
      [side - 4, over - 4],
      [-side + 4, over - 4],
      [side - 4, 4 - over],
      [-side + 4, 4 - over],
    ];
    for (const [dx, dy] of shifts) {
      const [x, y] = [label.at[0] + dx, label.at[1] + dy];
      const box: Box = [x - w - 1, y - h, x + w + 1, y + h];
      if (taken.some((other) => meets(box, other))) continue;
      if (marks.some((mark, k) => k !== own && meets(box, mark))) continue;
      taken.push(box);
      return [dx, dy];
    }
    return null;
  });
}
