/** A run at any moment: columns of telemetry and records of the trace, asked by plan time. */

export interface Columns {
  t_s: number[];
  east_m: (number | null)[];
  north_m: (number | null)[];
  heading_rad: (number | null)[];
  battery_j: (number | null)[];
  energy_used_j: (number | null)[];
  tracker_confidence: Record<string, (number | null)[]>;
  tracker_state: Record<string, (string | null)[]>;
  task: (string | null)[];
}

export interface TraceRecord {
  t_s: number;
  event: string;
  arguments: string[];
}

export interface Moment {
  t_s: number;
  east_m: number | null;
  north_m: number | null;
  heading_rad: number | null;
  energy_used_j: number | null;
  battery_j: number | null;
  task: string | null;
  trackers: Record<string, { state: string | null; confidence: number | null }>;
}

/** Index of the last sample at or before `t`; -1 before the first. */
export function indexAt(times: readonly number[], t: number): number {
  let low = 0;
  let high = times.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if ((times[middle] ?? Number.POSITIVE_INFINITY) <= t) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

function blend(a: number | null, b: number | null, part: number): number | null {
  if (a === null) return b;
  if (b === null) return a;
  return a + (b - a) * part;
}

/** Headings are blended the short way round. */
export function blendAngle(a: number | null, b: number | null, part: number): number | null {
  if (a === null || b === null) return a ?? b;
  const turn = ((((b - a + Math.PI) % (2 * Math.PI)) + 2 * Math.PI) % (2 * Math.PI)) - Math.PI;
  return a + turn * part;
}

/** The state at plan time `t`: numbers blended between samples, states as last reported. */
export function momentAt(columns: Columns, t: number): Moment {
  const i = Math.max(0, indexAt(columns.t_s, t));
  const j = Math.min(i + 1, columns.t_s.length - 1);
  const t0 = columns.t_s[i] ?? 0;
  const t1 = columns.t_s[j] ?? t0;
  const part = t1 > t0 ? Math.min(1, Math.max(0, (t - t0) / (t1 - t0))) : 0;
  const pick = (values: readonly (number | null)[]): number | null =>
    blend(values[i] ?? null, values[j] ?? null, part);
  const trackers: Moment["trackers"] = {};
  for (const [id, confidence] of Object.entries(columns.tracker_confidence)) {
    trackers[id] = { confidence: confidence[i] ?? null, state: columns.tracker_state[id]?.[i] ?? null };
  }
  for (const [id, states] of Object.entries(columns.tracker_state)) {
    trackers[id] ??= { confidence: null, state: states[i] ?? null };
  }
  return {
    t_s: t,
    east_m: pick(columns.east_m),
    north_m: pick(columns.north_m),
    heading_rad: blendAngle(columns.heading_rad[i] ?? null, columns.heading_rad[j] ?? null, part),
    energy_used_j: pick(columns.energy_used_j),
    battery_j: pick(columns.battery_j),
    task: columns.task[i] ?? null,
    trackers,
  };
}

/** One sample as a live run sends it. */
export interface Sample {
  t_s: number;
  east_m: number | null;
  north_m: number | null;
  heading_rad: number | null;
  battery_j: number | null;
  energy_used_j: number | null;
  task: string | null;
  trackers: Record<string, { state: string | null; confidence: number | null }>;
}

/** Columns with samples added behind; a tracker that is new has had no value before. */
export function appended(columns: Columns, samples: readonly Sample[]): Columns {
  const length = columns.t_s.length;
  const ids = new Set([
    ...Object.keys(columns.tracker_state),
    ...Object.keys(columns.tracker_confidence),
    ...samples.flatMap((sample) => Object.keys(sample.trackers)),
  ]);
  const blank = <T>(): (T | null)[] => Array<T | null>(length).fill(null);
  const confidence: Columns["tracker_confidence"] = {};
  const state: Columns["tracker_state"] = {};
  for (const id of ids) {
    confidence[id] = [
      ...(columns.tracker_confidence[id] ?? blank<number>()),
      ...samples.map((sample) => sample.trackers[id]?.confidence ?? null),
    ];
    state[id] = [
      ...(columns.tracker_state[id] ?? blank<string>()),
      ...samples.map((sample) => sample.trackers[id]?.state ?? null),
    ];
  }
  return {
    t_s: [...columns.t_s, ...samples.map((sample) => sample.t_s)],
    east_m: [...columns.east_m, ...samples.map((sample) => sample.east_m)],
    north_m: [...columns.north_m, ...samples.map((sample) => sample.north_m)],
    heading_rad: [...columns.heading_rad, ...samples.map((sample) => sample.heading_rad)],
    battery_j: [...columns.battery_j, ...samples.map((sample) => sample.battery_j)],
    energy_used_j: [...columns.energy_used_j, ...samples.map((sample) => sample.energy_used_j)],
    task: [...columns.task, ...samples.map((sample) => sample.task)],
    tracker_confidence: confidence,
    tracker_state: state,
  };
}

export type NodeState = "running" | "succeeded" | "failed" | "aborted" | "skipped";

/** What each node of the plan has become by plan time `t`, from `start` and `end` records of the trace. */
export function nodeStates(records: readonly TraceRecord[], t: number): Map<string, NodeState> {
  const states = new Map<string, NodeState>();
  for (const record of records) {
    if (record.t_s > t) break;
    const node = record.arguments[0];
    if (node === undefined) continue;
    if (record.event === "start") states.set(node, "running");
    else if (record.event === "end") states.set(node, (record.arguments[1] ?? "").toLowerCase() as NodeState);
  }
  return states;
}

/** Times at which something happened, ascending and without repeats: where `[` and `]` step to. */
export function stepTimes(records: readonly TraceRecord[]): number[] {
  return [...new Set(records.map((record) => record.t_s))].sort((a, b) => a - b);
}
