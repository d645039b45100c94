/** Confidence of trackers as curves: over plan time, or over the distance from rover to target. */

import type { Columns } from "./replay";

export interface Curve {
  id: string;
  /** Unbroken pieces of the curve: points (abscissa, confidence 0..1, plan time). */
  pieces: [number, number, number][][];
  /** Where the track was lost. */
  lost: [number, number][];
}

const LOST = new Set(["lost", "failed"]);

/** Trackers that ever reported a confidence. */
export function trackersOf(columns: Columns): string[] {
  return Object.entries(columns.tracker_confidence)
    .filter(([, values]) => values.some((value) => (value ?? 0) > 0))
    .map(([id]) => id);
}

/**
 * The curve of one tracker. It breaks where nothing is tracked. Samples are thinned to at most `most` by keeping the
 * lowest confidence of each stretch, so that a short dip is never smoothed away.
 */
export function curveOf(
  columns: Columns,
  id: string,
  place: readonly [number, number] | null,
  over: "time" | "distance",
  most = 400,
): Curve {
  const confidence = columns.tracker_confidence[id] ?? [];
  const states = columns.tracker_state[id] ?? [];
  const stretch = Math.max(1, Math.ceil(confidence.length / most));
  const curve: Curve = { id, pieces: [], lost: [] };
  let piece: [number, number, number][] = [];
  let before: string | null = null;
  const end = (): void => {
    if (piece.length > 0) curve.pieces.push(piece);
    piece = [];
  };
  let lowest: [number, number, number] | null = null;
  confidence.forEach((value, k) => {
    const t = columns.t_s[k] ?? 0;
    const state = states[k] ?? null;
    const [east, north] = [columns.east_m[k] ?? null, columns.north_m[k] ?? null];
    const x = over === "time" ? t : place === null || east === null || north === null ? null : Math.hypot(place[0] - east, place[1] - north);
    if (x !== null && state !== null && LOST.has(state) && before !== null && !LOST.has(before)) curve.lost.push([x, value ?? 0]);
    before = state;
    if (value === null || x === null || state === null || (state !== "tracked" && !LOST.has(state))) {
      if (lowest !== null) piece.push(lowest);
      lowest = null;
      end();
      return;
    }
    if (lowest === null || value < lowest[1]) lowest = [x, value, t];
    if (k % stretch === stretch - 1 || k === confidence.length - 1) {
      piece.push(lowest);
      lowest = null;
    }
  });
  if (lowest !== null) piece.push(lowest);
  end();
  return curve;
}
