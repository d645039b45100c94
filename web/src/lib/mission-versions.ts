/** What two missions of one origin did, and where their edits collide, in words without ids. */

import type { MissionConflict, MissionEdit } from "../api/version-calls";
import { clock, degrees, energy, number, words } from "./format";
import { instrumentTitle } from "./instruments";
import { fieldWords as planField, type Names } from "./plan-versions";

const KINDS: Record<string, string> = {
  mission: "",
  sol: "",
  target: "target",
  observation_request: "request",
  keep_out: "keep-out",
  frame: "frame",
  solution: "solution of a frame",
  frame_file: "file of a frame",
  site_map: "map of a site",
};

const FIELDS: Record<string, string> = {
  place: "place",
  observation_pose: "place to stand",
  window_s: "window",
  must_do: "must be done",
  dwell_s: "dwell",
  after: "comes after",
  constraints: "conditions",
  target_id: "target",
  calibration: "odds of drives",
  anchor_frame_id: "frame of the site",
  rover_profile: "rover",
  start_lmst_h: "start, hour LMST",
  battery_j: "charge",
  energy_floor_j: "least charge",
  passes: "downlink passes",
};
/** Members that are texts of people, whatever they look like. */
const TEXTS = new Set(["name", "notes", "rationale", "feature_type", "source_image", "label", "key", "file_name"]);

/** A target, request or other part as people call it. */
export function rowName(kind: string, name: string): string {
  if (kind === "mission") return "the mission";
  if (kind === "sol") return name;
  const said = kind === "observation_request" ? name.replace(/^[a-z_]+(?= of )/, instrumentTitle) : name;
  return `${KINDS[kind] ?? words(kind)} ${said}`.trim();
}

/** A member as people call it; a drive is named by its ends. */
export function memberWords(field: string, names: Names): string {
  if (field.startsWith("drive ")) {
    const [from = "", to = ""] = field.slice("drive ".length).split(" ");
    return `drive from ${from === "" ? "the start" : names.target(from)} to ${names.target(to)}`;
  }
  return FIELDS[field] ?? planField(field.replace(/_(s|j|m|rad|utc|h)$/, ""));
}

const NOTHING = "not set";
const point = (east: unknown, north: unknown): string => `E ${number(Number(east), 3)} N ${number(Number(north), 3)} m`;
const isRecord = (value: unknown): value is Record<string, unknown> => typeof value === "object" && value !== null && !Array.isArray(value);

/** A text of the server about a mission: ids of targets and requests become names, other ids go. */
export function namedIn(text: string, names: Names): string {
  return text
    .replace(/\b(tgt|req)-[0-9a-z]+/g, (id) => (id.startsWith("tgt-") ? names.target(id) : names.request(id)))
    .replace(/\b(msn|sol|kpo|frm|slu|map|ffl)-[0-9a-z]{8,}/g, "this one");
}

/** The value of a member in words; the server tells values as text, what is not text as JSON. */
export function valueWords(field: string, text: string, names: Names): string {
  if (text === "") return NOTHING;
  if (TEXTS.has(field)) return `“${text}”`;
  if (field === "instrument") return instrumentTitle(text);
  let value: unknown;
  try {
    value = JSON.parse(text);
  } catch {
    return namedIn(words(text), names);
  }
  return said(field, value, names);
}

function said(field: string, value: unknown, names: Names): string {
  if (value === null) return NOTHING;
  if (typeof value === "boolean") return value ? "yes" : "no";
  if (typeof value === "number") {
    if (field.endsWith("_s")) return clock(value);
    if (field.endsWith("_j")) return energy(value);
    if (field.endsWith("_rad")) return degrees(value, 1);
    return `${number(value, Number.isInteger(value) ? 0 : 3)}${field.endsWith("_m") ? " m" : ""}`;
  }
  if (typeof value === "string") return namedIn(value, names);
  if (Array.isArray(value)) {
    if (value.length === 0) return "nothing";
    if (field === "polygon_m" || field === "outline_m" || field === "via_m") {
      return `${value.length} corners: ${value.map((corner) => (Array.isArray(corner) ? `(${corner.slice(0, 2).map((c) => number(Number(c), 2)).join(", ")})` : "")).join(" ")}`;
    }
    if (field === "window_s") return value.map((t) => clock(t === null ? null : Number(t))).join(" to ");
    return value.map((one) => said(field, one, names)).join(", ");
  }
  if (isRecord(value)) {
    if ("east_m" in value && "north_m" in value) {
      const heading = typeof value.heading_rad === "number" ? `, heading ${degrees(value.heading_rad)}` : "";
      return point(value.east_m, value.north_m) + heading;
    }
    if (field.startsWith("drive ")) return value.via_m === null ? "forbidden" : `by ${said("via_m", value.via_m, names)}`;
    return Object.entries(value)
      .filter(([name, one]) => one !== null && !name.endsWith("_id"))
      .map(([name, one]) => (name === "kind" ? words(String(one)) : ["polygon_m", "outline_m"].includes(name) ? said(name, one, names) : `${memberWords(name, names)} ${said(name, one, names)}`))
      .join(", ");
  }
  return NOTHING;
}

export interface EditLine {
  key: string;
  action: string;
  row: string;
  field: string;
  before: string;
  after: string;
}

const ACTIONS: Record<string, string> = { added: "new", removed: "gone", changed: "changed" };

/** What one side did, in words; what `both` did alike is on neither side. */
export function editLines(edits: readonly MissionEdit[], side: "ours" | "theirs" | "both", names: Names): EditLine[] {
  return edits
    .filter((edit) => edit.side === side)
    .map((edit, k) => ({
      key: `${k}`,
      action: ACTIONS[edit.action] ?? edit.action,
      row: rowName(edit.kind, edit.name),
      field: edit.field === "" ? "" : memberWords(edit.field, names),
      before: edit.action === "changed" ? valueWords(edit.field, edit.base, names) : "",
      after: edit.action === "changed" ? valueWords(edit.field, edit.now, names) : "",
    }));
}

const CONFLICTS: Record<string, string> = {
  "both-changed": "both changed it",
  "removed-and-changed": "one removed what the other changed",
  "refers-to-removed": "one removed what the other newly refers to",
  "same-name": "two have one name",
  "not-merged": "no merge carries this over",
  circle: "the orders of both wait for each other",
  invalid: "a rule of the mission refuses it",
};

export interface MissionConflictWords {
  what: string;
  why: string;
  base: string;
  ours: string;
  theirs: string;
}

/** A conflict in words: what it is about, and what each side stands for. */
export function missionConflictWords(conflict: MissionConflict, names: Names): MissionConflictWords {
  const { kind, field } = conflict;
  const row = rowName(conflict.resource, conflict.name);
  const why = CONFLICTS[kind] ?? words(kind);
  const plain = (text: string): string => (text === "" ? NOTHING : namedIn(text, names));
  switch (kind) {
    case "both-changed":
      return {
        what: `${row}: ${memberWords(field, names)}`,
        why,
        base: valueWords(field, conflict.base, names),
        ours: valueWords(field, conflict.ours, names),
        theirs: valueWords(field, conflict.theirs, names),
      };
    case "removed-and-changed":
      return { what: row, why, base: "", ours: changed(conflict.ours, names), theirs: changed(conflict.theirs, names) };
    case "same-name":
      return { what: row, why, base: "", ours: "this one keeps it, the other gets a free one", theirs: "this one keeps it, the other gets a free one" };
    case "not-merged":
      return { what: row, why, base: "", ours: "stays as it is here", theirs: "as it is there: only by hand" };
    default:
      return { what: field === "" ? row : `${row}: ${memberWords(field, names)}`, why, base: "", ours: plain(conflict.ours), theirs: plain(conflict.theirs) };
  }
}

/** `notes, place changed` with members as people call them. */
function changed(text: string, names: Names): string {
  const fields = / changed$/.test(text) ? text.slice(0, -" changed".length) : null;
  return fields === null ? text : `${fields.split(", ").map((field) => memberWords(field, names)).join(", ")} changed`;
}
