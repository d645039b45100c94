/** Texts of plans that are edited and not saved: this browser keeps them for who wrote them, until they are saved or discarded. */

import { app, remember, remembered } from "./app.svelte";

export interface KeptText {
  text: string;
  /** When it was last changed, UTC. */
  at: string;
}

const KEY = "crl-texts";
/** Texts that are kept; of more the oldest go. A text has some 20 kB, and a browser gives a page 5 MB. */
const MOST = 20;

const keyOf = (plan: string): string => `${app.person?.name ?? ""} ${plan}`;

export function keptText(plan: string): KeptText | null {
  return remembered<Record<string, KeptText>>(KEY, {})[keyOf(plan)] ?? null;
}

/** Keep a text; null forgets the one that was kept. */
export function keepText(plan: string, text: string | null): void {
  const others = Object.entries(remembered<Record<string, KeptText>>(KEY, {})).filter(([key]) => key !== keyOf(plan));
  const newest = others.sort(([, a], [, b]) => b.at.localeCompare(a.at)).slice(0, MOST - 1);
  const mine = text === null ? {} : { [keyOf(plan)]: { text, at: new Date().toISOString() } };
  remember(KEY, { ...Object.fromEntries(newest), ...mine });
}
