/** The observation request form: what stands in its fields, what is wrong with it, what is sent. */

import type { ConstraintKind, ObservationRequest, ObservationRequestChange, RoverInstrument } from "../api/types";
import { addable, type ConstraintDocument, type ConstraintFields, documentOf, fieldsOfDocument, partsOf, problemOf } from "./constraints";
import { planSeconds, solarTime } from "./format";
import { instrumentTitle, usualValue } from "./instruments";

export interface RequestFields {
  instrument: string;
  value: number | null;
  tracked: boolean;
  mustDo: boolean;
  from: string;
  until: string;
  dwell: number | null;
  after: string[];
  notes: string;
  /** Conditions of other kinds: those with fields, and as they are those that the page has no fields for. */
  constraints: ConstraintFields[];
  others: ConstraintDocument[];
}

export type FieldProblems = Partial<Record<keyof RequestFields, string>>;

/** What an instrument gives a form that nobody has filled in. */
export function usual(instrument: RoverInstrument | undefined): Pick<RequestFields, "instrument" | "value" | "tracked"> {
  if (instrument === undefined) return { instrument: "", value: null, tracked: false };
  return { instrument: instrument.name, value: usualValue(instrument), tracked: instrument.tracked };
}

export function freshFields(instrument: RoverInstrument | undefined): RequestFields {
  return { ...usual(instrument), mustDo: false, from: "", until: "", dwell: null, after: [], notes: "", constraints: [], others: [] };
}

export function fieldsOf(request: ObservationRequest, startHour: number, kinds: readonly ConstraintKind[]): RequestFields {
  const known = new Map(addable(kinds).map((kind) => [kind.kind, partsOf(kind) ?? []]));
  const documents = request.constraints as ConstraintDocument[];
  const [from, until] = request.window_s ?? [];
  return {
    instrument: request.instrument,
    value: request.value,
    tracked: request.tracked,
    mustDo: request.must_do,
    from: from === undefined ? "" : solarTime(startHour, from),
    until: until === undefined ? "" : solarTime(startHour, until),
    dwell: request.dwell_s ?? null,
    after: [...request.after],
    notes: request.notes,
    constraints: documents.flatMap((one) => (known.has(one.kind) ? [fieldsOfDocument(one, known.get(one.kind) ?? [])] : [])),
    others: documents.filter((one) => !known.has(one.kind)),
  };
}

/** What a mission tells a form of the request: names of others, the start of the sol, the kinds of condition. */
export interface FormMission {
  readonly startHour: number;
  readonly kinds: readonly ConstraintKind[];
  requestName(id: string): string;
}

/** Where what was typed differs from what somebody else saved: name, mine, theirs; without theirs, what was typed. */
export function differences(mine: RequestFields, theirs: ObservationRequest | null, m: FormMission): [string, string, string][] {
  const told = (fields: RequestFields): [string, string][] => [
    ["Instrument", instrumentTitle(fields.instrument)],
    ["Value", String(fields.value ?? "–")],
    ["Tracked", fields.tracked ? "yes" : "no"],
    ["Window", fields.from || fields.until ? `${fields.from} ${fields.until}` : "–"],
    ["Must do", fields.mustDo ? "yes" : "no"],
    ["Dwell, s", String(fields.dwell ?? "–")],
    ["After", fields.after.map((id) => m.requestName(id)).join(", ") || "–"],
    ["Conditions", [...fields.constraints.map((one) => `${one.kind} ${Object.values(one.values).join(" ")}`), ...fields.others.map((one) => one.kind)].join(", ") || "–"],
    ["Notes", fields.notes || "–"],
  ];
  const other = theirs === null ? null : told(fieldsOf(theirs, m.startHour, m.kinds));
  const rows = told(mine).map(([name, text], k): [string, string, string] => [name, text, other?.[k]?.[1] ?? "deleted"]);
  return other === null ? rows.filter(([, a]) => a !== "–" && a !== "no") : rows.filter(([, a, b]) => a !== b);
}

/** Say what the server would refuse, in the words of the form. */
export function problemsOf(
  fields: RequestFields,
  startHour: number,
  dayLength_s: number | null,
  kinds: readonly ConstraintKind[] = [],
): FieldProblems {
  const problems: FieldProblems = {};
  if (fields.instrument === "") problems.instrument = "an instrument is needed";
  if (fields.value === null || !Number.isFinite(fields.value)) problems.value = "a number is needed";
  else if (fields.value < 0 || fields.value > 1e6) problems.value = "from 0 to 1 000 000";
  const wrong = fields.constraints.map((one) => problemOf(one, partsIn(kinds, one.kind))).find((text) => text !== null);
  if (wrong != null) problems.constraints = wrong;
  if (fields.dwell !== null && !(fields.dwell >= 0)) problems.dwell = "seconds, at least 0";
  const [from, until] = windowEnds(fields, startHour);
  if (fields.from !== "" && from === null) problems.from = "a time such as 11:30";
  if (fields.until !== "" && until === null) problems.until = "a time such as 14:00";
  if (problems.from === undefined && problems.until === undefined && (fields.from !== "") !== (fields.until !== "")) {
    problems[fields.from === "" ? "from" : "until"] = "both ends are needed";
  }
  if (from !== null && until !== null) {
    if (from < 0) problems.from = `before the sol's start at ${solarTime(startHour, 0)}`;
    else if (until <= from) problems.until = "not later than its start";
    else if (dayLength_s !== null && from > dayLength_s) {
      problems.from = `after the sol's end at ${solarTime(startHour, dayLength_s)}`;
    }
  }
  return problems;
}

function windowEnds(fields: RequestFields, startHour: number): [number | null, number | null] {
  return [
    fields.from === "" ? null : planSeconds(startHour, fields.from),
    fields.until === "" ? null : planSeconds(startHour, fields.until),
  ];
}

function partsIn(kinds: readonly ConstraintKind[], name: string): ReturnType<typeof partsOf> & object {
  const kind = kinds.find((known) => known.kind === name);
  return (kind === undefined ? null : partsOf(kind)) ?? [];
}

export function bodyOf(fields: RequestFields, startHour: number, kinds: readonly ConstraintKind[] = []): Required<
  Pick<ObservationRequestChange, "instrument" | "tracked" | "must_do" | "after" | "notes" | "constraints">
> & { value: number; window_s: number[] | null; dwell_s: number | null } {
  const [from, until] = windowEnds(fields, startHour);
  return {
    instrument: fields.instrument,
    value: fields.value ?? 0,
    tracked: fields.tracked,
    must_do: fields.mustDo,
    window_s: from === null || until === null ? null : [Math.max(0, Math.round(from)), Math.round(until)],
    dwell_s: fields.dwell,
    after: fields.after,
    notes: fields.notes,
    constraints: [...fields.constraints.map((one) => documentOf(one, partsIn(kinds, one.kind))), ...fields.others],
  };
}
