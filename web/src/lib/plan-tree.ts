/** Contingent plans as the page shows them: lines (mainline and options) of steps, read from `plan-tree/1` and `/2`. */

import { percent, words } from "./format";

export interface Condition {
  var: "time_s" | "energy_j" | "tracked" | "done";
  ge?: number;
  lt?: number;
  target?: string;
  observation?: string;
  is?: boolean;
}

export interface Quantiles {
  p: number[];
  time_s: number[];
  energy_j: number[];
}

export interface TreeStep {
  op: "track_start" | "track_stop" | "navigate" | "observe" | "visit" | "branch" | "stop";
  target?: string;
  to?: string;
  observation?: string;
  require_tracked?: boolean;
  wait_until_s?: number;
  on_fail?: "stop" | "skip";
  p_reached?: number;
  quantiles?: Quantiles;
  options?: TreeOption[];
}

export interface TreeOption {
  id?: string;
  when: Condition[];
  p_taken?: number;
  gain?: number;
  utility_table?: [number, number][];
  plan: TreeStep[];
}

export interface PlanTree {
  format: string;
  instance?: string;
  method?: string;
  plan: TreeStep[];
}

/** A step as drawn: where it stands, how likely it is reached, when (seconds) and at which energy used (joules). */
export interface Step {
  key: string;
  line: string;
  op: TreeStep["op"];
  target: string | null;
  request: string | null;
  waitUntil: number | null;
  onFail: "stop" | "skip";
  p: number;
  /** The line is taken because the track that this step needs is lost: skipped unless it is found again. */
  idle: boolean;
  time: Band | null;
  energy: Band | null;
  /** Lines that leave the plan at this step, in order of their test. */
  forks: string[];
}

/** Low, middle and high quantile of one quantity. */
export interface Band {
  low: number;
  mid: number;
  high: number;
}

/** The mainline or one option: steps carried out in order once `when` holds. */
export interface Line {
  id: string;
  depth: number;
  parent: string | null;
  /** Key of the branch step this line leaves from; null for the mainline. */
  from: string | null;
  when: Condition[];
  p: number;
  gain: number | null;
  /** Expected utility still to come when the option starts at a time: rows [seconds, utility]. */
  utility: [number, number][];
  steps: Step[];
}

export const MAIN = "main";

function at(quantiles: Quantiles, values: number[], p: number): number {
  const ps = quantiles.p;
  let k = 0;
  while (k + 1 < ps.length && (ps[k + 1] ?? 1) < p) k += 1;
  const p0 = ps[k] ?? 0;
  const p1 = ps[k + 1] ?? p0;
  const v0 = values[k] ?? 0;
  const v1 = values[k + 1] ?? v0;
  if (p <= p0 || p1 === p0) return v0;
  return v0 + ((v1 - v0) * Math.min(p - p0, p1 - p0)) / (p1 - p0);
}

export function band(quantiles: Quantiles | undefined, what: "time_s" | "energy_j"): Band | null {
  if (quantiles === undefined || quantiles.p.length === 0) return null;
  const values = quantiles[what];
  if (values.length === 0) return null;
  return {
    low: at(quantiles, values, Math.max(0.1, quantiles.p[0] ?? 0.1)),
    mid: at(quantiles, values, 0.5),
    high: at(quantiles, values, Math.min(0.9, quantiles.p[quantiles.p.length - 1] ?? 0.9)),
  };
}

/** Return the lines of a tree, the mainline first, options in the order of the text (pre-order). */
export function linesOf(tree: PlanTree): Line[] {
  const lines: Line[] = [];
  let unnamed = 0;

  function add(id: string, steps: TreeStep[], head: Omit<Line, "id" | "steps">, before: ReadonlySet<string>): void {
    const line: Line = { ...head, id, steps: [] };
    lines.push(line);
    let p = head.p;
    const lost = new Set(before);
    for (const c of head.when) if (c.var === "tracked" && c.is === false && c.target !== undefined) lost.add(c.target);
    /** Target of a drive that is not made, until the next one. */
    let missed: string | null = null;
    steps.forEach((raw, index) => {
      p = raw.p_reached ?? p;
      const target = raw.target ?? raw.to ?? null;
      if (raw.op === "track_start" && target !== null) lost.delete(target);
      if (raw.op === "navigate") missed = raw.require_tracked === true && target !== null && lost.has(target) ? target : null;
      const idle = missed !== null && (raw.op === "navigate" || raw.op === "observe") && target === missed;
      const step: Step = {
        key: `${id}/${index}`,
        line: id,
        op: raw.op,
        target,
        request: raw.observation ?? null,
        waitUntil: raw.wait_until_s ?? null,
        onFail: raw.on_fail ?? "stop",
        p: idle ? 0 : p,
        idle,
        time: band(raw.quantiles, "time_s"),
        energy: band(raw.quantiles, "energy_j"),
        forks: [],
      };
      line.steps.push(step);
      for (const option of raw.options ?? []) {
        unnamed += 1;
        const name = option.id ?? `option-${unnamed}`;
        step.forks.push(name);
        add(name, option.plan, {
          depth: head.depth + 1,
          parent: id,
          from: step.key,
          when: option.when,
          p: option.p_taken ?? p,
          gain: option.gain ?? null,
          utility: option.utility_table ?? [],
        }, lost);
      }
      if (raw.op === "branch" && raw.p_reached === undefined) {
        const taken = step.forks.reduce((sum, id) => sum + (lines.find((l) => l.id === id)?.p ?? 0), 0);
        p = Math.max(0, p - taken);
      }
    });
  }

  add(MAIN, tree.plan, { depth: 0, parent: null, from: null, when: [], p: 1, gain: null, utility: [] }, new Set());
  return lines;
}

/** A drive from one place to another (null = where the plan starts) with its probability. */
export interface Leg {
  line: string;
  depth: number;
  step: string;
  from: string | null;
  to: string;
  p: number;
}

/** Return the drives of all lines; a step that stays where the rover already is gives none. */
export function legsOf(lines: Line[]): Leg[] {
  const legs: Leg[] = [];
  const placeAt = new Map<string, string | null>();
  for (const line of lines) {
    let place = line.from === null ? null : (placeAt.get(line.from) ?? null);
    for (const step of line.steps) {
      if (!step.idle && (step.op === "navigate" || step.op === "visit") && step.target !== null && step.target !== place) {
        legs.push({ line: line.id, depth: line.depth, step: step.key, from: place, to: step.target, p: step.p });
        place = step.target;
      }
      placeAt.set(step.key, place);
    }
  }
  return legs;
}

/** Places of lines on the page, top to bottom: an option stands below its parent, late forks nearest to it. */
export function rowsOf(lines: Line[]): string[] {
  const byId = new Map(lines.map((line) => [line.id, line]));
  const rows: string[] = [];
  function place(line: Line): void {
    rows.push(line.id);
    for (const step of [...line.steps].reverse()) {
      for (const id of step.forks) {
        const fork = byId.get(id);
        if (fork !== undefined) place(fork);
      }
    }
  }
  const main = byId.get(MAIN);
  if (main !== undefined) place(main);
  return rows;
}

/** Chance that each request is carried out on some path: the sum over the lines that hold it. */
export function reachOf(lines: Line[]): Map<string, number> {
  const chance = new Map<string, number>();
  for (const line of lines) {
    for (const step of line.steps) {
      const id = step.request ?? (step.op === "visit" || step.op === "observe" ? step.target : null);
      if (id === null || step.op === "branch") continue;
      chance.set(id, Math.min(1, (chance.get(id) ?? 0) + step.p));
    }
  }
  return chance;
}

/** A condition in words; times and energies are shown by the given writers. */
export function conditionText(
  condition: Condition,
  name: (id: string) => string,
  time: (seconds: number) => string,
  energy: (joules: number) => string,
): string {
  switch (condition.var) {
    case "time_s":
      return condition.ge !== undefined
        ? `time ≥ ${time(condition.ge)}`
        : `time < ${time(condition.lt ?? 0)}`;
    case "energy_j":
      return condition.ge !== undefined
        ? `energy used ≥ ${energy(condition.ge)}`
        : `energy used < ${energy(condition.lt ?? 0)}`;
    case "tracked":
      return `${name(condition.target ?? "?")} ${condition.is ? "tracked" : "lost"}`;
    case "done":
      return `${name(condition.observation ?? condition.target ?? "?")} ${condition.is ? "done" : "not done"}`;
  }
}

/**
 * What is said of a run in which no branch was taken; `outcome` is empty while it goes on. Only a run that succeeded
 * came to the mainline's end, and only of that the plan gave odds.
 */
export function noBranchTaken(outcome: string, lines: readonly Line[]): string {
  if (outcome === "") return "None so far.";
  if (outcome.toUpperCase() !== "SUCCEEDED") return `None before the run ended: ${words(outcome).toLowerCase()}.`;
  const branches = lines.filter((line) => line.depth === 1);
  const odds = 1 - Math.min(1, branches.reduce((sum, line) => sum + line.p, 0));
  return `None: the mainline to its end${branches.length === 0 ? "" : `, as was to be expected with ${percent(odds)}`}.`;
}
