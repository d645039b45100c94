/** A live run as people are told of it: how its link stands, what its rover was sent, and which run goes on. */

import type { Run, RunCreate } from "../api/types";
import { clock, lasted } from "./format";

/** What a run tells once a second; without a link of its own (a rover in the same process) only the time. */
export interface Link {
  readonly t_s: number;
  readonly up?: boolean;
  readonly age_s?: number | null;
  readonly round_trip_s?: number | null;
  readonly breaks?: number;
  /** Commands that are open: run, task and attempt, and where each stands. */
  readonly commands?: readonly { readonly id: readonly [string, string, number]; readonly state: string }[];
}

/** What the executive noted: an answer out of turn, a break of the link, why it ended. */
export interface Note {
  readonly t_s: number;
  readonly kind: string;
  readonly text: string;
}

export type FaultKind = NonNullable<RunCreate["faults"]>[number]["kind"];

export const FAULTS: readonly (readonly [FaultKind, string])[] = [
  ["lose-target", "Lose a target"],
  ["slow-drive", "Slow drive"],
  ["slip-burst", "Slip burst"],
  ["stuck-wheel", "Stuck wheel"],
  ["low-battery", "Low battery"],
  ["camera-failure", "Camera failure"],
  ["shadow", "Shadow"],
  ["lens-dust", "Dust on a lens"],
  ["novelty", "Something new"],
  ["silent", "Silence"],
];
/** Faults that have an amount: what it is called, where it begins, and how much of the server's unit one is. */
export const AMOUNTS: Partial<Record<FaultKind, { readonly label: string; readonly first: number; readonly least: number; readonly unit: number }>> = {
  "slow-drive": { label: "times as long", first: 2, least: 1, unit: 1 },
  "slip-burst": { label: "times as long", first: 2, least: 1, unit: 1 },
  "low-battery": { label: "Wh left", first: 20, least: 0, unit: 3600 },
  novelty: { label: "interest, 0 to 1", first: 0.7, least: 0, unit: 1 },
};

/** What the server is asked: a fault with the target and the amount that its kind has, and no other. */
export function faultOf(kind: FaultKind, target: string, amount: number | null): { kind: FaultKind; target_id: string | null; amount: number | null } {
  const has = AMOUNTS[kind];
  return {
    kind,
    target_id: OF_TARGET.has(kind) ? target || null : null,
    amount: has === undefined ? null : (amount ?? has.first) * has.unit,
  };
}

/** A fault that a run keeps, in words: what, of which target, and when. */
export function faultTold(fault: Run["faults"][number], targetName: (id: string) => string, taskName: (id: string) => string): string {
  const title = FAULTS.find(([kind]) => kind === fault.kind)?.[1] ?? fault.kind;
  const of = fault.target_id === null ? "" : ` (${targetName(fault.target_id)})`;
  const when = fault.task === null ? `at ${clock(fault.at_s ?? 0)}` : `when ${taskName(fault.task)} starts`;
  return `${title}${of} ${when}`;
}

/** Faults that concern a target. */
export const OF_TARGET: ReadonlySet<FaultKind> = new Set(["lose-target", "shadow", "lens-dust"]);

/** Seconds of the plan in a second of the clock. */
export const RATES = [1, 8, 60, 300] as const;

/** The link speaks at least once a second, so a word older than this is missed. */
const QUIET_S = 5;

/** How the link stands, in words, with a sign that needs no colour; `unheard` is since the page heard of it, seconds. */
export function linkTold(link: Link | null, unheard: number): { tone: "ok" | "warn" | "bad"; sign: string; text: string } {
  if (link === null) return { tone: "warn", sign: "…", text: "not heard of yet" };
  if (unheard > QUIET_S) return { tone: "bad", sign: "✕", text: `the page has heard nothing for ${Math.round(unheard)} s` };
  if (link.up === undefined) return { tone: "ok", sign: "●", text: "rover in the same process" };
  const age = link.age_s ?? null;
  if (!link.up) return { tone: "bad", sign: "✕", text: age === null ? "link down" : `link down, last word ${lasted(age)} ago` };
  if (age === null) return { tone: "warn", sign: "…", text: "link up, no word yet" };
  if (age > QUIET_S) return { tone: "warn", sign: "▲", text: `link up, last word ${lasted(age)} ago` };
  return { tone: "ok", sign: "●", text: `link up, last word ${lasted(age)} ago` };
}

/** The live runs that go on, or wait to begin. */
export function liveRunsOf(runs: readonly Run[]): readonly Run[] {
  return runs.filter((run) => run.kind === "live" && (run.state === "queued" || run.state === "running"));
}

/** What a wish of a run is called when it is refused. */
export function wishTold(wish: { paused?: boolean; pace?: number; step?: boolean; abort?: boolean; stop?: boolean }): string {
  if (wish.stop === true) return "STOP";
  if (wish.abort === true) return "The abort";
  if (wish.step === true) return "The step";
  if (wish.pace !== undefined) return "The pace";
  return wish.paused === true ? "Holding the run" : "Letting the run go on";
}
