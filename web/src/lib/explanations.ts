/** What the page says of a plan: why a request is not in it, and how it does against another one. */

import type { PlanComparison, WhyNot } from "../api/types";
import { number, percent, signed, words } from "./format";

export const closed = (text: string): string => `${text.slice(0, 1).toUpperCase()}${text.slice(1).replace(/\.$/, "")}.`;

/** What is said of an answer to why-not; `told` makes a sentence of the server one for people, `known` was said before. */
export function whyNotSentences(
  answer: WhyNot,
  nameOf: (request: string) => string,
  told: (text: string) => string,
  known: readonly (string | null)[] = [],
): string[] {
  const said: string[] = [];
  const { attempted, change, displaced, reason, relaxation, standard_error } = answer;
  if (!attempted) {
    if (!known.includes(reason)) said.push(closed(told(reason)));
    said.push("No plan was found that holds it.");
  } else {
    const instead = displaced.length > 0 ? ` and displaces ${displaced.map(nameOf).join(", ")}` : "";
    said.push(`A plan that must contain it changes in value by ${signed(change, 2)} ± ${number(standard_error, 2)}${instead}.`);
    if (relaxation === null) {
      said.push("Up to three times the budgets and its window were tried, each and all together: no unbranched plan was found that is better with it.");
    }
  }
  if (relaxation !== null) {
    said.push(`With ${number(relaxation.factor, 2)} times the ${words(relaxation.what)} it is included, and the best unbranched plan found is worth ${number(relaxation.value, 2)}.`);
  }
  return said;
}

/** A line of a comparison: what is compared, for this plan, for the other one, and the difference where it means something. */
export interface Compared {
  what: string;
  here: string;
  there: string;
  difference: string;
}

export function comparedLines(paired: PlanComparison): Compared[] {
  return [
    {
      what: "Value on the same futures",
      here: number(paired.value_a, 2),
      there: number(paired.value_b, 2),
      difference: `${signed(paired.difference, 2)} ± ${number(paired.standard_error, 2)}`,
    },
    { what: "Beats the other with", here: percent(paired.a_beats_b), there: percent(paired.b_beats_a), difference: "" },
    { what: "Worst 5 %, mean", here: number(paired.worst_a, 2), there: number(paired.worst_b, 2), difference: signed(paired.worst_a - paired.worst_b, 2) },
    { what: "Ends over a budget with", here: percent(paired.overrun_a, 1), there: percent(paired.overrun_b, 1), difference: "" },
  ];
}
