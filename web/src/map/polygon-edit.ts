/** Changing an outline by hand: what lies under a place, moving it, adding and removing corners, snapping. */

import type { Point } from "./geometry";

export type Part =
  | { kind: "corner"; index: number }
  /** Between corner `index` and the next one. */
  | { kind: "edge"; index: number; at: Point }
  | { kind: "inside" };

const distance = (a: Point, b: Point): number => Math.hypot(a[0] - b[0], a[1] - b[1]);

/** The point of the segment from `a` to `b` that is nearest to `p`. */
export function nearestOn(p: Point, a: Point, b: Point): Point {
  const [dx, dy] = [b[0] - a[0], b[1] - a[1]];
  const square = dx * dx + dy * dy;
  const share = square === 0 ? 0 : Math.max(0, Math.min(1, ((p[0] - a[0]) * dx + (p[1] - a[1]) * dy) / square));
  return [a[0] + share * dx, a[1] + share * dy];
}

/** Whether a point lies inside a ring of corners (even-odd rule). */
export function inside(p: Point, ring: readonly Point[]): boolean {
  let found = false;
  ring.forEach((a, k) => {
    const b = ring[(k + 1) % ring.length] as Point;
    if (a[1] > p[1] !== b[1] > p[1] && p[0] < a[0] + ((p[1] - a[1]) / (b[1] - a[1])) * (b[0] - a[0])) found = !found;
  });
  return found;
}

/** What of an outline lies within `reach` of a place: a corner before an edge before its inside. */
export function partAt(p: Point, ring: readonly Point[], reach: number): Part | null {
  let corner = -1;
  let edge: { index: number; at: Point } | null = null;
  ring.forEach((a, k) => {
    if (distance(a, p) <= reach && (corner < 0 || distance(a, p) < distance(ring[corner] as Point, p))) corner = k;
    const at = nearestOn(p, a, ring[(k + 1) % ring.length] as Point);
    if (distance(at, p) <= reach && (edge === null || distance(at, p) < distance(edge.at, p))) edge = { index: k, at };
  });
  if (corner >= 0) return { kind: "corner", index: corner };
  const found = edge as { index: number; at: Point } | null;
  if (found !== null) return { kind: "edge", ...found };
  return inside(p, ring) ? { kind: "inside" } : null;
}

export const moved = (ring: readonly Point[], by: Point): Point[] => ring.map(([x, y]) => [x + by[0], y + by[1]]);

export const withCorner = (ring: readonly Point[], index: number, at: Point): Point[] => ring.map((corner, k) => (k === index ? at : corner));

/** With a corner more, behind corner `index`. */
export const withCornerMore = (ring: readonly Point[], index: number, at: Point): Point[] => [...ring.slice(0, index + 1), at, ...ring.slice(index + 1)];

/** With a corner less; an outline keeps three. */
export const withCornerLess = (ring: readonly Point[], index: number): Point[] => (ring.length <= 3 ? [...ring] : ring.filter((_, k) => k !== index));

/** A place, drawn to a corner of the outlines within `reach`, else to an edge within it. */
export function snapped(p: Point, rings: readonly (readonly Point[])[], reach: number): Point {
  let corner: Point | null = null;
  let edge: Point | null = null;
  for (const ring of rings) {
    ring.forEach((a, k) => {
      if (distance(a, p) <= reach && (corner === null || distance(a, p) < distance(corner, p))) corner = a;
      const at = nearestOn(p, a, ring[(k + 1) % ring.length] as Point);
      if (distance(at, p) <= reach && (edge === null || distance(at, p) < distance(edge, p))) edge = at;
    });
  }
  return corner ?? edge ?? p;
}
