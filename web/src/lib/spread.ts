/**
 * Where the rover may be at a moment of the plan: places along the drives with their probability.
 *
 * A step's begin has quantiles of time; the drive lasts until the step behind it begins. Early and late futures are
 * taken as early and late throughout, so the quantile of the begin goes with that of the end.
 */

import type { Point } from "../map/geometry";
import { type Band, type Leg, type Line, MAIN, type Step } from "./plan-tree";

export interface Spot {
  at: Point;
  /** Chance that the rover is here at this moment. */
  p: number;
  line: string;
  depth: number;
  /** Metres driven since the start. */
  driven: number;
}

/** Value of a quantity at a quantile, from its 10 %, 50 % and 90 %; beyond them the line goes on. */
export function quantile(band: Band, u: number): number {
  return u < 0.5
    ? band.mid + ((band.mid - band.low) * (u - 0.5)) / 0.4
    : band.mid + ((band.high - band.mid) * (u - 0.5)) / 0.4;
}

/** The place `part` (0 to 1) of the way along a polyline. */
export function alongPath(path: readonly Point[], part: number): Point {
  const sizes = path.slice(1).map((b, k) => Math.hypot(b[0] - (path[k]?.[0] ?? 0), b[1] - (path[k]?.[1] ?? 0)));
  let left = Math.max(0, Math.min(1, part)) * sizes.reduce((sum, size) => sum + size, 0);
  for (const [k, size] of sizes.entries()) {
    const [a, b] = [path[k] as Point, path[k + 1] as Point];
    if (left <= size || k === sizes.length - 1) {
      const share = size === 0 ? 0 : Math.min(1, left / size);
      return [a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share];
    }
    left -= size;
  }
  return path[0] ?? [0, 0];
}

export const lengthOf = (path: readonly Point[]): number =>
  path.slice(1).reduce((sum, b, k) => sum + Math.hypot(b[0] - (path[k]?.[0] ?? 0), b[1] - (path[k]?.[1] ?? 0)), 0);

/** End of the plan's last step in its late futures, seconds. */
export function planEnd(lines: readonly Line[]): number {
  return Math.max(0, ...lines.flatMap((line) => line.steps.map((step) => step.time?.high ?? 0)));
}

interface Stay {
  step: Step;
  leg: Leg | null;
  path: readonly Point[];
  drivenBefore: number;
}

/** Spots at plan time `t`; without steps that fail their probabilities sum to 1. */
export function spotsAt(
  lines: readonly Line[],
  legs: readonly Leg[],
  start: Point,
  pathOf: (leg: Leg) => readonly Point[] | null,
  t: number,
  samples = 24,
): Spot[] {
  const legOf = new Map(legs.map((leg) => [leg.step, leg]));
  const spots: Spot[] = [];
  const placeAt = new Map<string, { at: Point; driven: number }>();
  for (const line of lines) {
    let here = (line.from === null ? undefined : placeAt.get(line.from)) ?? { at: start, driven: 0 };
    const stays: Stay[] = [];
    for (const step of line.steps) {
      const leg = legOf.get(step.key) ?? null;
      const path = (leg === null ? null : pathOf(leg)) ?? [here.at];
      if (step.time !== null) stays.push({ step, leg, path, drivenBefore: here.driven });
      here = { at: path[path.length - 1] ?? here.at, driven: here.driven + lengthOf(path) };
      placeAt.set(step.key, here);
    }
    stays.forEach((stay, k) => {
      const begin = stay.step.time as Band;
      const next = stays[k + 1];
      // Whoever leaves the line at a branch is counted on the branch.
      const forks = stay.step.op === "branch" ? stay.step.forks : [];
      const left = lines.filter((other) => forks.includes(other.id)).reduce((sum, other) => sum + other.p, 0);
      const p = Math.max(0, stay.step.p - left);
      for (let i = 0; i < samples; i += 1) {
        const u = (i + 0.5) / samples;
        const from = k === 0 && line.id === MAIN ? 0 : quantile(begin, u);
        const until = next === undefined ? Number.POSITIVE_INFINITY : quantile(next.step.time as Band, u);
        if (t < from || t >= until) continue;
        const part = stay.leg === null || !Number.isFinite(until) ? 1 : (t - from) / Math.max(1e-9, until - from);
        spots.push({
          at: alongPath(stay.path, part),
          p: p / samples,
          line: line.id,
          depth: line.depth,
          driven: stay.drivenBefore + part * lengthOf(stay.path),
        });
      }
    });
  }
  return merged(spots);
}

/** Spots in the same cell of a quarter metre on the same line are one. */
function merged(spots: readonly Spot[]): Spot[] {
  const cells = new Map<string, Spot>();
  for (const spot of spots) {
    const key = `${spot.line}|${Math.round(spot.at[0] * 4)}|${Math.round(spot.at[1] * 4)}`;
    const known = cells.get(key);
    if (known === undefined) cells.set(key, { ...spot });
    else known.p += spot.p;
  }
  return [...cells.values()].sort((a, b) => a.p - b.p);
}

/** Mean place and standard deviation (metres) of a set of spots; null without any. */
export function summary(spots: readonly Spot[]): { at: Point; sd: number; driven: number } | null {
  const total = spots.reduce((sum, spot) => sum + spot.p, 0);
  if (total <= 0) return null;
  const mean = (pick: (spot: Spot) => number): number => spots.reduce((sum, spot) => sum + spot.p * pick(spot), 0) / total;
  const at: Point = [mean((s) => s.at[0]), mean((s) => s.at[1])];
  return {
    at,
    sd: Math.sqrt(mean((s) => (s.at[0] - at[0]) ** 2 + (s.at[1] - at[1]) ** 2)),
    driven: mean((s) => s.driven),
  };
}
