/** What a person changes in a what-if, and how it goes to the server: only what differs from the plan's day. */

import type { Schemas } from "../api/types";

export type WhatIf = Schemas["WhatIf"];

export type Wish = "out" | "must";

/** Sliders and switches. Budgets are factors of the plan's own; the start is so many minutes later. */
export interface Draft {
  time: number;
  energy: number;
  delayMin: number;
  loss: number;
  wishes: Record<string, Wish>;
  values: Record<string, number>;
  /** Keep-outs that are not there, by id. */
  lifted: readonly string[];
  /** Keep-outs that lie elsewhere or have another outline, by id: corners east, north. */
  moved: Readonly<Record<string, number[][]>>;
}

export const UNCHANGED: Draft = { time: 1, energy: 1, delayMin: 0, loss: 1, wishes: {}, values: {}, lifted: [], moved: {} };

/** What the draft is measured against: budgets of the plan's day, values of its requests, keep-outs of the mission. */
export interface Baseline {
  time_budget_s: number;
  energy_budget_j: number;
  values: ReadonlyMap<string, number>;
  keepOuts: readonly { id: string; polygon_m: number[][] }[];
}

export function isUnchanged(draft: Draft, base: Baseline): boolean {
  return Object.keys(changesOf(draft, base)).length === 0;
}

/** The changes of a draft; what stays as it is is not named. */
export function changesOf(draft: Draft, base: Baseline): WhatIf {
  const changes: WhatIf = {};
  const wished = (what: Wish): string[] =>
    Object.entries(draft.wishes)
      .filter(([, wish]) => wish === what)
      .map(([id]) => id)
      .sort();
  const [exclude, force] = [wished("out"), wished("must")];
  if (exclude.length > 0) changes.exclude = exclude;
  if (force.length > 0) changes.force = force;
  const values = Object.fromEntries(
    Object.entries(draft.values).filter(([id, value]) => Number.isFinite(value) && value >= 0 && value !== base.values.get(id)),
  );
  if (Object.keys(values).length > 0) changes.values = values;
  if (draft.time !== 1) changes.time_budget_s = draft.time * base.time_budget_s;
  if (draft.energy !== 1) changes.energy_budget_j = draft.energy * base.energy_budget_j;
  if (draft.delayMin > 0) changes.start_delay_s = 60 * draft.delayMin;
  if (draft.loss !== 1) changes.loss_factor = draft.loss;
  const lifted = base.keepOuts.filter((keepOut) => draft.lifted.includes(keepOut.id));
  const moved = base.keepOuts.filter((keepOut) => keepOut.id in draft.moved);
  if (lifted.length > 0 || moved.length > 0) {
    changes.keep_outs = base.keepOuts
      .filter((keepOut) => !lifted.includes(keepOut))
      .map((keepOut) => draft.moved[keepOut.id] ?? keepOut.polygon_m);
  }
  return changes;
}

/** As it is, taken away, demanded: what one press after the other makes of a request. */
export function nextWish(wish: Wish | undefined): Wish | undefined {
  return wish === undefined ? "out" : wish === "out" ? "must" : undefined;
}

/** Whether a difference is more than the noise of its estimate. */
export function tells(change: number, error: number): boolean {
  return Math.abs(change) > Math.max(2 * error, 5e-3);
}
