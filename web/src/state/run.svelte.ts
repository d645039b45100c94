/** The run that is looked at: live while it goes on, afterwards replayed at any speed from what was recorded. */

import * as calls from "../api/calls";
import { listen, type Stream } from "../api/stream";
import type { FaultBody, Product, Run } from "../api/types";
import { type Link, type Note, wishTold } from "../lib/live";
import {
  appended,
  type Columns,
  indexAt,
  type Moment,
  momentAt,
  nodeStates,
  type Sample,
  stepTimes,
  type TraceRecord,
  trailOf,
} from "../lib/replay";
import { app } from "./app.svelte";
import type { MissionState } from "./mission.svelte";

export const SPEEDS = [60, 300, 900, 3600] as const;
/** Tracker states that say nothing of a track: not begun, or ended on purpose. */
export const NOT_TRACKED = new Set(["none", "idle", "stopped"]);
/** Notes that are kept: a rover that talks nonsense may give many. */
const NOTES = 200;
const EMPTY: Columns = {
  t_s: [],
  east_m: [],
  north_m: [],
  heading_rad: [],
  battery_j: [],
  energy_used_j: [],
  tracker_confidence: {},
  tracker_state: {},
  task: [],
};

export class RunState {
  id = $state<string | null>(null);
  columns = $state.raw<Columns>(EMPTY);
  trace = $state.raw<TraceRecord[]>([]);
  live = $state(false);
  playing = $state(false);
  speed = $state<number>(300);
  t = $state(0);
  error = $state<string | null>(null);
  /** While a run goes on: whether it is held, its pace (plan seconds a second), and whether the view goes with it. */
  held = $state(false);
  pace = $state(0);
  following = $state(true);
  /** Of a live run: how its link stands, when that was heard (`performance.now`), what was noted. */
  link = $state.raw<Link | null>(null);
  linkHeard = $state(0);
  notes = $state.raw<Note[]>([]);
  /** It was stopped or aborted, and ends. */
  stopping = $state(false);
  /** Looking back at a run that goes on. */
  readonly behind = $derived.by(() => this.live && !this.following);

  readonly run = $derived.by<Run | null>(() => this.m.runs.find((run) => run.id === this.id) ?? null);
  readonly end = $derived(Math.max(this.columns.t_s[this.columns.t_s.length - 1] ?? 0, this.trace.at(-1)?.t_s ?? 0));
  readonly moment = $derived<Moment | null>(this.columns.t_s.length === 0 ? null : momentAt(this.columns, this.t));
  readonly nodes = $derived(nodeStates(this.trace, this.t));
  readonly steps = $derived(stepTimes(this.trace));
  /** When each record of the trace is from. */
  readonly times = $derived(this.trace.map((record) => record.t_s));
  private readonly trail = $derived(trailOf(this.columns));
  /** Where the rover has been until now, site metres. */
  readonly track = $derived.by<[number, number][]>(() => {
    const until = indexAt(this.columns.t_s, this.t);
    const points = this.trail.points.slice(0, indexAt(this.trail.samples, until) + 1);
    if (this.moment?.east_m != null && this.moment.north_m != null) points.push([this.moment.east_m, this.moment.north_m]);
    return points;
  });
  /** Products that had come down by now, oldest first. */
  readonly products = $derived.by(() =>
    this.m.products.filter((product) => product.run_id === this.id && product.t_s <= this.t + 0.5),
  );

  private stream: Stream | null = null;
  private frame = 0;
  private waiting = 0;
  private readonly samples: Sample[] = [];
  private readonly records: TraceRecord[] = [];
  private last = 0;

  constructor(readonly m: MissionState) {}

  /** Look at a run; null leaves. */
  async open(id: string | null, from: "start" | "end" = "end"): Promise<void> {
    if (id === this.id) return;
    this.close();
    this.id = id;
    if (id === null) return;
    try {
      const run = this.m.runs.find((known) => known.id === id) ?? (await calls.run(id));
      if (this.id !== id) return;
      if (run.state === "queued" || run.state === "running") this.follow(id);
      else await this.load(id, from);
    } catch (error) {
      this.error = error instanceof Error ? error.message : String(error);
    }
  }

  private async load(id: string, from: "start" | "end" | "here"): Promise<void> {
    const [telemetry, trace] = await Promise.all([calls.telemetry(id), calls.trace(id)]);
    if (this.id !== id) return;
    this.columns = telemetry;
    this.trace = trace.events;
    if (from === "start") this.t = 0;
    if (from === "end") this.t = this.end;
  }

  private controlled(wish: { pace: number; paused: boolean; abort?: boolean }): void {
    this.held = wish.paused;
    this.pace = wish.pace;
    this.stopping = wish.abort === true;
  }

  /** Hold, let go, step, speed up, abort or stop the run that goes on. */
  async control(wish: { paused?: boolean; pace?: number; step?: boolean; abort?: boolean; stop?: boolean }): Promise<void> {
    const id = this.id;
    if (id === null || !this.live) return;
    const now = await app.attempt(wishTold(wish), () => calls.controlRun(id, wish));
    if (now !== null && id === this.id) this.controlled(now);
  }

  /** Let the simulated rover of a live run suffer a fault now. */
  async inject(fault: FaultBody): Promise<void> {
    const id = this.id;
    if (id === null || !this.live) return;
    const done = await app.attempt("The fault", () => calls.injectFault(id, fault));
    if (done !== null) await app.attempt("Reading the run", () => this.m.reload("run"));
  }

  private follow(id: string): void {
    this.live = true;
    this.following = true;
    this.held = false;
    this.stream = listen(calls.runEventsUrl(id), {
      telemetry: (data) => {
        this.samples.push(data as Sample);
        this.arrived();
      },
      trace: (data) => {
        this.records.push(data as TraceRecord);
        this.arrived();
      },
      control: (data) => this.controlled(data as { pace: number; paused: boolean; abort?: boolean }),
      product: (data) => this.m.announce(data as Product),
      link: (data) => {
        this.link = data as Link;
        this.linkHeard = performance.now();
      },
      note: (data) => {
        this.notes = [...this.notes, data as Note].slice(-NOTES);
      },
      end: () => void this.ended(id),
    });
  }

  /** Samples come faster than frames: they are shown together. */
  private arrived(): void {
    if (this.waiting !== 0) return;
    this.waiting = requestAnimationFrame(() => {
      this.waiting = 0;
      if (this.samples.length > 0) this.columns = appended(this.columns, this.samples.splice(0));
      if (this.records.length > 0) this.trace = [...this.trace, ...this.records.splice(0)];
      if (this.live && this.following) this.t = this.end;
    });
  }

  private async ended(id: string): Promise<void> {
    this.stream?.close();
    this.stream = null;
    this.live = false;
    this.held = false;
    this.stopping = false;
    const quick = this.columns.t_s.length < 3;
    await app.attempt("Reading the run", async () => {
      await Promise.all([this.m.reload("run"), this.m.reload("product"), this.m.reload("observation_request")]);
      await this.load(id, quick && this.following ? "start" : "here");
      if (!this.following) return; // somebody looks at a moment of their own
      // A rover faster than the eye is shown again from the start.
      if (quick) this.play();
      else this.t = this.end;
    });
  }

  play(): void {
    if (this.columns.t_s.length === 0) return;
    if (this.t >= this.end - 0.01) this.t = 0;
    this.playing = true;
    this.last = performance.now();
    const tick = (now: number): void => {
      if (!this.playing) return;
      this.t = Math.min(this.end, this.t + ((now - this.last) / 1000) * this.speed);
      this.last = now;
      if (this.t >= this.end) this.playing = false;
      else this.frame = requestAnimationFrame(tick);
    };
    this.frame = requestAnimationFrame(tick);
  }

  pause(): void {
    this.playing = false;
    cancelAnimationFrame(this.frame);
  }

  /** Play or pause: a run that goes on is held or let go, one that is over is replayed. */
  toggle(): void {
    if (this.live) void this.control({ paused: !this.held });
    else if (this.playing) this.pause();
    else this.play();
  }

  seek(t: number): void {
    this.t = Math.max(0, Math.min(this.end, t));
    this.following = this.t >= this.end - 1;
  }

  /** Go with the run again. */
  catchUp(): void {
    this.following = true;
    this.t = this.end;
  }

  /** To the next or the previous record of the trace. */
  step(direction: 1 | -1): void {
    this.pause();
    if (this.live && this.following && direction > 0) {
      void this.control({ step: true });
      return;
    }
    const next =
      direction > 0
        ? this.steps.find((time) => time > this.t + 1e-6)
        : this.steps.findLast((time) => time < this.t - 1e-6);
    if (next !== undefined) this.seek(next);
  }

  close(): void {
    this.pause();
    this.stream?.close();
    this.stream = null;
    this.live = false;
    cancelAnimationFrame(this.waiting);
    this.waiting = 0;
    this.samples.length = 0;
    this.records.length = 0;
    this.columns = EMPTY;
    this.trace = [];
    this.t = 0;
    this.error = null;
    this.held = false;
    this.stopping = false;
    this.link = null;
    this.notes = [];
    this.following = true;
    this.id = null;
  }
}
