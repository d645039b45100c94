/** Drafts in words: what taking one over would do, and every member of its form. */

import type { Draft } from "../api/types";
import { number } from "./format";
import { instrumentTitle } from "./instruments";
import { memberWords, valueWords } from "./mission-versions";
import type { Names } from "./plan-versions";

export interface DraftWords {
  /** What accepting does. */
  deed: string;
  /** All other members of the form: nothing that would be done stays unsaid. */
  rest: { name: string; text: string }[];
}

type Form = Record<string, unknown>;
const isForm = (value: unknown): value is Form => typeof value === "object" && value !== null && !Array.isArray(value);
const textOf = (value: unknown): string => (typeof value === "string" ? value : JSON.stringify(value ?? ""));

/** Where a point of a form lies, in the reference that it is given in. */
function placeOf(form: Form): string {
  if (isForm(form.at)) {
    const { crs, x, y } = form.at;
    return `at ${Number(x)}, ${Number(y)} (${crs === "lonlat" ? "longitude, latitude" : textOf(crs)})`;
  }
  return `at E ${number(Number(form.east_m), 3)} N ${number(Number(form.north_m), 3)} m`;
}

/** What a draft would do; `window` is what the request of a window has now, as text of JSON. */
export function draftWords(draft: Pick<Draft, "kind" | "form">, names: Names, window: (request: string) => string): DraftWords {
  const form = draft.form as Form;
  const rest = (from: Form, told: readonly string[], prefix = ""): DraftWords["rest"] =>
    Object.entries(from)
      .filter(([name, value]) => !told.includes(name) && value !== null && value !== "" && !(Array.isArray(value) && value.length === 0))
      .map(([name, value]) => ({ name: prefix + memberWords(name, names), text: valueWords(name, textOf(value), names) }));
  const called = (given: Form): string => (given.name === undefined || given.name === null ? "" : ` “${textOf(given.name)}”`);
  const POINT = ["name", "east_m", "north_m", "at"];
  switch (draft.kind) {
    case "target":
      return { deed: `Make a target${called(form)} ${placeOf(form)}`, rest: rest(form, POINT) };
    case "request": {
      const given = isForm(form.target) ? form.target : null;
      const on = given === null ? names.target(textOf(form.target_id)) : `a new target${called(given)} ${placeOf(given)}`;
      return {
        deed: `Observe ${on} with ${instrumentTitle(textOf(form.instrument)).toLowerCase()}, worth ${number(Number(form.value), 1)}`,
        rest: [...rest(form, ["target_id", "target", "instrument", "value"]), ...(given === null ? [] : rest(given, POINT, "target: "))],
      };
    }
    case "window": {
      const request = textOf(form.request_id);
      const [was, wanted] = [valueWords("window_s", window(request), names), valueWords("window_s", textOf(form.window_s), names)];
      return { deed: `Set the window of ${names.request(request)} to ${wanted} after the start of the plan; now ${was}`, rest: rest(form, ["request_id", "window_s"]) };
    }
    case "keep_out":
      return { deed: `Make a keep-out${called(form)}`, rest: rest(form, ["name"]) };
    case "plan":
      return { deed: "Ask for a plan", rest: rest(form, []) };
    default:
      return { deed: `A draft of a kind that this page does not know: ${draft.kind}`, rest: rest(form, []) };
  }
}
