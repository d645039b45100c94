/** The observation request form: what stands in its fields, what is wrong with it, what is sent. */

import type { ObservationRequest, ObservationRequestChange, RoverInstrument } from "../api/types";
import { planSeconds, solarTime } from "./format";
import { usualValue } from "./instruments";

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
}

export type FieldProblems = Partial<Record<keyof RequestFields, string>>;

/** What an instrument gives a form that nobody has filled in. */
export function usual(instrument: RoverInstrument | undefined): Pick<RequestFields, "instrument" | "value" | "tracked"> {
  if (instrument === undefined) return { instrument: "", value: null, tracked: false };
  return { instrument: instrument.name, value: usualValue(instrument), tracked: instrument.tracked };
}

export function freshFields(instrument: RoverInstrument | undefined): RequestFields {
  return { ...usual(instrument), mustDo: false, from: "", until: "", dwell: null, after: [], notes: "" };
}

export function fieldsOf(request: ObservationRequest, startHour: number): RequestFields {
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
  };
}

/** Say what the server would refuse, in the words of the form. */
export function problemsOf(fields: RequestFields, startHour: number, dayLength_s: number | null): FieldProblems {
  const problems: FieldProblems = {};
  if (fields.instrument === "") problems.instrument = "an instrument is needed";
  if (fields.value === null || !Number.isFinite(fields.value)) problems.value = "a number is needed";
  else if (fields.value < 0 || fields.value > 1e6) problems.value = "from 0 to 1 000 000";
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

export function bodyOf(fields: RequestFields, startHour: number): Required<
  Pick<ObservationRequestChange, "instrument" | "tracked" | "must_do" | "after" | "notes">
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
  };
}
