/** The what-if that is tried on the open plan: one question under way, the newest one asked next. */

import * as calls from "../api/calls";
import type { KeepOut, ObservationRequest, Plan, WhatIfAnswer } from "../api/types";
import { type Baseline, changesOf, type Draft, isUnchanged, UNCHANGED, type Wish } from "../lib/what-if";
import { app } from "./app.svelte";

/** The day that is changed, as the open mission holds it. */
interface Day {
  readonly requests: readonly ObservationRequest[];
  readonly keepOuts: readonly KeepOut[];
  reload(kind: string): Promise<void>;
}

export class WhatIfState {
  draft = $state.raw<Draft>(UNCHANGED);
  answer = $state.raw<WhatIfAnswer | null>(null);
  /** The answer to no change at all: the plan's own budgets and value. */
  base = $state.raw<WhatIfAnswer | null>(null);
  asking = $state(false);
  problem = $state<string | null>(null);
  /** From the change to the answer on the page, milliseconds. */
  roundTrip = $state<number | null>(null);

  readonly baseline = $derived.by<Baseline>(() => ({
    time_budget_s: this.base?.time_budget_s ?? 0,
    energy_budget_j: this.base?.energy_budget_j ?? 0,
    values: new Map(this.day.requests.map((request) => [request.id, request.value])),
    keepOuts: this.day.keepOuts,
  }));
  readonly unchanged = $derived(this.base === null || isUnchanged(this.draft, this.baseline));

  private again = false;

  constructor(
    readonly day: Day,
    readonly plan: Plan,
  ) {}

  /** Ask about the plan as it is: this also gets the planner warm. */
  async open(): Promise<void> {
    await this.ask();
  }

  change(changes: Partial<Draft>): void {
    this.draft = { ...this.draft, ...changes };
    void this.ask();
  }

  wish(id: string, wish: Wish | undefined): void {
    this.change({ wishes: withEntry(this.draft.wishes, id, wish) });
  }

  value(id: string, value: number | null): void {
    this.change({ values: withEntry(this.draft.values, id, value === null || !Number.isFinite(value) ? undefined : value) });
  }

  lift(id: string, lifted: boolean): void {
    const others = this.draft.lifted.filter((known) => known !== id);
    this.change({ lifted: lifted ? [...others, id] : others });
  }

  /** Try a keep-out with another outline; the one that is saved stays as it is. */
  reshape(id: string, corners: readonly (readonly number[])[]): void {
    this.change({ moved: withEntry(this.draft.moved, id, corners.map((corner) => [...corner])) });
  }

  /** Leave a keep-out where it is saved. */
  putBack(id: string): void {
    this.change({ moved: withEntry(this.draft.moved, id, undefined) });
  }

  /** Save the outlines that were tried: from then on they are the mission's. */
  async accept(): Promise<void> {
    for (const [id, polygon_m] of Object.entries(this.draft.moved)) {
      const keepOut = this.day.keepOuts.find((known) => known.id === id);
      if (keepOut === undefined) continue;
      const done = await app.attempt(`The keep-out ${keepOut.name}`, () => calls.changeKeepOut(keepOut, { polygon_m }));
      if (done !== null) this.draft = { ...this.draft, moved: withEntry(this.draft.moved, id, undefined) };
    }
    await app.attempt("The keep-outs", () => this.day.reload("keep_out"));
    void this.ask();
  }

  reset(): void {
    this.draft = UNCHANGED;
    this.answer = this.base;
    this.problem = null;
  }

  /** The changes as the server takes them, for a plan that keeps them. */
  get changes(): ReturnType<typeof changesOf> {
    return changesOf(this.draft, this.baseline);
  }

  private async ask(): Promise<void> {
    if (this.asking) {
      this.again = true;
      return;
    }
    this.asking = true;
    do {
      this.again = false;
      const began = performance.now();
      try {
        const answer = await calls.whatIf(this.plan.id, this.base === null ? {} : this.changes);
        if (this.base === null) {
          this.base = answer;
          this.again ||= !this.unchanged;
        }
        this.answer = answer;
        this.problem = null;
        this.roundTrip = performance.now() - began;
      } catch (error) {
        this.problem = error instanceof Error ? error.message : String(error);
      }
    } while (this.again);
    this.asking = false;
  }
}

function withEntry<T>(table: Readonly<Record<string, T>>, id: string, value: T | undefined): Record<string, T> {
  const others = Object.entries(table).filter(([key]) => key !== id);
  return Object.fromEntries(value === undefined ? others : [...others, [id, value]]);
}
