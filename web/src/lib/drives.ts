/** Drives of the path network between places (null is the start), and what people say of them. */

import type { Network, Point } from "../map/geometry";

export interface DriveRule {
  from_target_id: string | null;
  to_target_id: string;
  /** Corners of the way; null forbids the drive. */
  via_m: number[][] | null;
}

export type DriveState = "free" | "forbidden" | "drawn";

export interface Drive {
  /** The place at the other end. */
  other: string | null;
  state: DriveState;
  /** Null where the network has no such drive. */
  length_m: number | null;
  time_s: number | null;
  loss: number;
  /** The chance that it ends short of its place, the larger of both directions. */
  short: number;
}

interface NetworkWithCosts extends Network {
  segments: readonly (Network["segments"][number] & {
    length_m: number;
    time_mean_s: number;
    p_lose: Record<string, number>;
    p_fail?: number;
  })[];
}

const between = (rule: DriveRule, a: string | null, b: string | null): boolean =>
  (rule.from_target_id === a && rule.to_target_id === b) || (rule.from_target_id === b && rule.to_target_id === a);

export function stateOf(rules: readonly DriveRule[], a: string | null, b: string | null): DriveState {
  const rule = rules.find((one) => between(one, a, b));
  return rule === undefined ? "free" : rule.via_m === null ? "forbidden" : "drawn";
}

/** The rules with another one, or none, for a drive. */
export function withRule(rules: readonly DriveRule[], a: string | null, b: string, via: number[][] | null | "free"): DriveRule[] {
  const others = rules.filter((rule) => !between(rule, a, b));
  return via === "free" ? others : [...others, { from_target_id: a, to_target_id: b, via_m: via }];
}

/** Drives between a target and every other place, the shortest first; then those that the network does not have. */
export function drivesAt(network: NetworkWithCosts | null, rules: readonly DriveRule[], target: string): Drive[] {
  const here = network?.nodes.find((node) => node.target_id === target);
  const others = new Set<string | null>(
    (network?.nodes ?? []).flatMap((node) => (node.target_id === target || here === undefined ? [] : [node.target_id])),
  );
  for (const rule of rules) {
    if (rule.to_target_id === target) others.add(rule.from_target_id);
    else if (rule.from_target_id === target) others.add(rule.to_target_id);
  }
  const drives = [...others].map((other): Drive => {
    const there = network?.nodes.find((node) => node.target_id === other);
    const found = (network?.segments ?? []).filter(
      (s) => (s.start === here?.id && s.end === there?.id) || (s.start === there?.id && s.end === here?.id),
    );
    return {
      other,
      state: stateOf(rules, target, other),
      length_m: found[0]?.length_m ?? null,
      time_s: found[0]?.time_mean_s ?? null,
      loss: Math.max(0, ...found.flatMap((s) => Object.values(s.p_lose))),
      short: Math.max(0, ...found.map((s) => s.p_fail ?? 0)),
    };
  });
  return drives.sort((a, b) => (a.length_m ?? Number.POSITIVE_INFINITY) - (b.length_m ?? Number.POSITIVE_INFINITY));
}

const NEAR_M = 1;

/** Corners of a drawn path: a first and a last click near the stands themselves are not corners. */
export function cornersOf(points: readonly Point[], from: Point, to: Point): number[][] {
  const near = (a: Point | undefined, b: Point): boolean => a !== undefined && Math.hypot(a[0] - b[0], a[1] - b[1]) < NEAR_M;
  const corners = [...points];
  if (near(corners[0], from)) corners.shift();
  if (near(corners[corners.length - 1], to)) corners.pop();
  return corners.map(([east, north]) => [Math.round(1000 * east) / 1000, Math.round(1000 * north) / 1000]);
}

export interface RuleLook {
  path: Point[];
  forbidden: boolean;
}

/** How the rules are drawn: ways that were drawn, and a straight line for what is forbidden. */
export function ruleLooks(rules: readonly DriveRule[], place: (target: string | null) => Point | null): RuleLook[] {
  return rules.flatMap((rule) => {
    const [from, to] = [place(rule.from_target_id), place(rule.to_target_id)];
    if (from === null || to === null) return [];
    const via = (rule.via_m ?? []).map((p): Point => [p[0] ?? 0, p[1] ?? 0]);
    return [{ path: [from, ...via, to], forbidden: rule.via_m === null }];
  });
}
