/** Who else looks at a mission: what each has selected, in words, and as marks on lists and map. */

import type { Looker, Schemas, Selected } from "../api/types";
import type { Route, Selection } from "./route";

/** How often a page says that it is there; the server forgets it after 40 s. */
export const BEAT_MS = 15_000;

/** What of a page others are told: what is selected, else the run or plan that is open. */
export function selectedOn(route: Route): Schemas["SelectedBody"] | null {
  const { selection, plan, run, tab } = route;
  switch (selection?.kind) {
    case "target":
    case "product":
      return { kind: selection.kind, id: selection.id };
    case "request":
      return { kind: "observation_request", id: selection.id };
    case "keep-out":
      return { kind: "keep_out", id: selection.id };
    default:
      if (run !== null && (tab === "run" || plan === null)) return { kind: "run", id: run };
      return plan === null ? null : { kind: "plan", id: plan };
  }
}

/** The place on the page where somebody else is; null where they have nothing selected. */
export function placeOf(selected: Selected | null): Partial<Route> | null {
  if (selected === null) return null;
  const chosen: Record<string, Selection["kind"]> = { target: "target", product: "product", observation_request: "request", keep_out: "keep-out" };
  const kind = chosen[selected.kind];
  if (kind !== undefined) return { selection: { kind, id: selected.id } };
  return selected.kind === "run" ? { run: selected.id, tab: "run", selection: null } : { plan: selected.id, tab: "plan", selection: null };
}

/** Somebody else, once for all of their pages. */
export interface Other {
  readonly person: string;
  readonly initials: string;
  readonly selected: readonly Selected[];
}

/** At most two letters: of the first and the last word of a name. */
export function initialsOf(name: string): string {
  const parts = name.trim().split(/\s+/);
  const first = (part: string | undefined): string => [...(part ?? "")][0]?.toUpperCase() ?? "";
  return first(parts[0]) + (parts.length > 1 ? first(parts.at(-1)) : "");
}

/** Everybody but oneself. */
export function othersOf(lookers: readonly Looker[], me: string | undefined): Other[] {
  const byName = Map.groupBy(lookers.filter((one) => one.person !== me), (one) => one.person);
  return [...byName].map(([person, pages]) => ({
    person,
    initials: initialsOf(person),
    selected: pages.flatMap((page) => (page.selected === null ? [] : [page.selected])),
  }));
}

/** Who has what selected, by its id. */
export function marksOf(others: readonly Other[]): ReadonlyMap<string, readonly Other[]> {
  const found = new Map<string, Other[]>();
  for (const other of others) {
    for (const id of new Set(other.selected.map((one) => one.id))) found.set(id, [...(found.get(id) ?? []), other]);
  }
  return found;
}
