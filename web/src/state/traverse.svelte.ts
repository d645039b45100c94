/** The traverses of a mission, the leg whose tie points are looked at, and the solutions of its frames. */

import * as calls from "../api/frame-calls";
import type { Leg, Localization } from "../lib/traverse";
import { app } from "./app.svelte";
import type { MissionState } from "./mission.svelte";

interface Choice {
  frame: calls.Frame;
  solutions: calls.Solution[];
}

const states = new WeakMap<MissionState, TraverseState>();

export class TraverseState {
  traverses = $state.raw<calls.Traverse[]>([]);
  maps = $state.raw<calls.SiteMap[]>([]);
  /** Frame and solutions of each stop of the open traverse. */
  choices = $state.raw<Choice[]>([]);
  /** What the solution that somebody is about to choose would move. */
  preview = $state.raw<{ solution: string; frame: calls.Frame; carried: calls.Carried } | null>(null);
  private wanted = $state<string | null>(null);
  private legIndex = $state(0);

  readonly computed = $derived(this.traverses.filter((traverse) => traverse.document !== null));
  readonly open = $derived(this.computed.find((traverse) => traverse.id === this.wanted) ?? this.computed.at(-1) ?? null);
  readonly found = $derived((this.open?.document ?? null) as Localization | null);
  readonly leg = $derived<Leg | null>(this.found?.legs[this.legIndex] ?? this.found?.legs[0] ?? null);

  constructor(private readonly m: MissionState) {}

  /** The state of a mission; made when it is asked for first. */
  static of(m: MissionState): TraverseState {
    const known = states.get(m);
    if (known !== undefined) return known;
    const made = new TraverseState(m);
    states.set(m, made);
    return made;
  }

  async load(): Promise<void> {
    await app.attempt("Reading the traverses", async () => {
      [this.traverses, this.maps] = await Promise.all([calls.traverses(this.m.id), calls.siteMaps(this.m.id)]);
    });
  }

  async loadChoices(): Promise<void> {
    const stops = this.open?.stops ?? [];
    await app.attempt("Reading the solutions", async () => {
      this.choices = await Promise.all(
        stops.map(async (stop) => {
          const frame = await calls.frame(stop.frame_id);
          return { frame, solutions: await calls.solutionsOf(frame) };
        }),
      );
    });
  }

  show(traverse: string): void {
    this.wanted = traverse;
    this.legIndex = 0;
    this.preview = null;
  }

  showLeg(index: number): void {
    this.legIndex = index;
    app.go({ view: "ties" });
  }

  /** Ask what a solution would move, before it is chosen. */
  async weigh(frame: calls.Frame, solution: string): Promise<void> {
    await app.attempt("The solution", async () => {
      this.preview = { solution, frame, carried: await calls.chooseSolution(frame, solution, true) };
    });
  }

  async choose(): Promise<void> {
    const weighed = this.preview;
    if (weighed === null) return;
    await app.attempt("The solution", async () => {
      await calls.chooseSolution(weighed.frame, weighed.solution, false);
      this.preview = null;
    });
    for (const kind of ["target", "keep_out", "observation_request"]) await this.m.reload(kind);
    await Promise.all([this.load(), this.loadChoices()]);
  }
}
