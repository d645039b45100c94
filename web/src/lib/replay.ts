/** A run at any moment: columns of telemetry and records of the trace, asked by plan time. */

import { clock, degrees, energy, number, percent, solarTime } from "./format";

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

/** All that is known of a moment, a line each; `startHour` is the local mean solar time at which the sol begins. */
export function momentLines(moment: Moment, startHour: number, taskName: (id: string) => string, targetName: (id: string) => string): string[] {
  const { battery_j, east_m, energy_used_j, heading_rad, north_m, t_s, task, trackers } = moment;
  const tracked = Object.entries(trackers).filter(([, { state }]) => state !== null);
  return [
    `${clock(t_s)} (${solarTime(startHour, t_s)} LMST)`,
    task === null ? "no task" : taskName(task),
    `E ${number(east_m, 2)} m, N ${number(north_m, 2)} m, ${degrees(heading_rad)} from east`,
    `energy used ${energy(energy_used_j)}, battery ${energy(battery_j)}`,
    ...tracked.map(([id, { state, confidence }]) => `${targetName(id)}: ${state}${confidence === null ? "" : `, ${percent(confidence)}`}`),
  ];
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

/** A rover's width is twenty times as much; a day's drive has a few thousand of these. */
const TRAIL_M = 0.04;

/** Where the rover has been: places at least `TRAIL_M` apart, each with the sample it is from. */
export interface Trail {
  samples: number[];
  points: [number, number][];
}

export function trailOf(columns: Columns): Trail {
  const trail: Trail = { samples: [], points: [] };
  let last: [number, number] | null = null;
  for (let k = 0; k < columns.t_s.length; k += 1) {
    const [east, north] = [columns.east_m[k] ?? null, columns.north_m[k] ?? null];
    if (east === null || north === null) continue;
    if (last !== null && Math.hypot(last[0] - east, last[1] - north) <= TRAIL_M) continue;
    last = [east, north];
    trail.samples.push(k);
    trail.points.push(last);
  }
  return trail;
}

/** The last records that began at or before plan time `t`, newest first, with their numbers; `times` are theirs. */
export function newestUntil(
  records: readonly TraceRecord[],
  times: readonly number[],
  t: number,
  most: number,
): { record: TraceRecord; index: number }[] {
  const found: { record: TraceRecord; index: number }[] = [];
  for (let index = indexAt(times, t); index >= 0 && found.length < most; index -= 1) {
    found.push({ record: records[index] as TraceRecord, index });
  }
  return found;
}

/** Times at which something happened, ascending and without repeats: where `[` and `]` step to. */
export function stepTimes(records: readonly TraceRecord[]): number[] {
  return [...new Set(records.map((record) => record.t_s))].sort((a, b) => a - b);
}
