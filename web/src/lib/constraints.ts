/**
 * Conditions on a request beside those with fields of their own: the rover's server says which kinds there are and
 * what each document holds, this makes fields of that and documents of fields. People read degrees, the wire has radians.
 */

import type { ConstraintKind } from "../api/types";
import { words } from "./format";

/** Kinds whose fields stand in the form anyhow. */
const OWN = new Set(["window", "tracked", "must_do", "after"]);

const UNITS: readonly { suffix: string; unit: string; perUnit: number }[] = [
  { suffix: "_rad", unit: "°", perUnit: Math.PI / 180 },
  { suffix: "_j", unit: "Wh", perUnit: 3600 },
  { suffix: "_s", unit: "s", perUnit: 1 },
  { suffix: "_m", unit: "m", perUnit: 1 },
];

type Value = number | string | boolean | null;

/** A member of a condition's document as a field: numbers in `unit`, of which one is `perUnit` on the wire. */
export interface Part {
  name: string;
  label: string;
  unit: string;
  perUnit: number;
  type: "number" | "string" | "boolean";
  choices: string[];
  required: boolean;
  /** Bounds and default in `unit`. */
  least: number | null;
  most: number | null;
  usual: Value;
}

export type ConstraintDocument = Record<string, unknown> & { kind: string };

export interface ConstraintFields {
  kind: string;
  values: Record<string, Value>;
}

export function constraintTitle(kind: string): string {
  const text = words(kind);
  return text.slice(0, 1).toUpperCase() + text.slice(1);
}

/** The fields of a kind; null where the page has no field for a member. */
export function partsOf(kind: ConstraintKind): Part[] | null {
  const { properties = {}, required = [] } = kind.form as {
    properties?: Record<string, Record<string, unknown>>;
    required?: string[];
  };
  const parts: Part[] = [];
  for (const [name, member] of Object.entries(properties)) {
    if (name === "kind") continue;
    const type = member.type === "integer" ? "number" : member.type;
    if (type !== "number" && type !== "string" && type !== "boolean") return null;
    const { suffix, unit, perUnit } = (type === "number" && UNITS.find((known) => name.endsWith(known.suffix))) || { suffix: "", unit: "", perUnit: 1 };
    const bound = (value: unknown): number | null => (typeof value === "number" ? shown(value, perUnit) : null);
    parts.push({
      name,
      label: words(name.slice(0, name.length - suffix.length)),
      unit,
      perUnit,
      type,
      choices: Array.isArray(member.enum) ? member.enum.map(String) : [],
      required: required.includes(name),
      least: bound(member.minimum),
      most: bound(member.maximum),
      usual: type === "number" ? bound(member.default) : ((member.default as Value | undefined) ?? null),
    });
  }
  return parts;
}

/** Kinds that a person may add: all whose members have fields. */
export function addable(kinds: readonly ConstraintKind[]): ConstraintKind[] {
  return kinds.filter((kind) => !OWN.has(kind.kind) && partsOf(kind) !== null);
}

export function fieldsOfDocument(document: ConstraintDocument, parts: readonly Part[]): ConstraintFields {
  const values = parts.map((part) => {
    const value = (document[part.name] ?? null) as Value;
    return [part.name, typeof value === "number" ? shown(value, part.perUnit) : value] as const;
  });
  return { kind: document.kind, values: Object.fromEntries(values) };
}

/** The document of filled fields; what is left empty is left to the server. */
export function documentOf(fields: ConstraintFields, parts: readonly Part[]): ConstraintDocument {
  const members = parts.flatMap((part) => {
    const value = fields.values[part.name] ?? null;
    if (value === null || value === "") return [];
    return [[part.name, typeof value === "number" ? value * part.perUnit : value] as const];
  });
  return { kind: fields.kind, ...Object.fromEntries(members) };
}

/** What is wrong with filled fields; null if nothing is. */
export function problemOf(fields: ConstraintFields, parts: readonly Part[]): string | null {
  const given = (part: Part): Value => fields.values[part.name] ?? null;
  for (const part of parts) {
    const value = given(part);
    if (value === null || value === "") {
      if (part.required) return `${part.label} is needed`;
      continue;
    }
    if (typeof value !== "number") continue;
    if (part.least !== null && value < part.least) return `${part.label}: not below ${part.least} ${part.unit}`.trim();
    if (part.most !== null && value > part.most) return `${part.label}: not above ${part.most} ${part.unit}`.trim();
  }
  return parts.length > 0 && parts.every((part) => given(part) === null || given(part) === "") ? "nothing is asked yet" : null;
}

/** A condition in a few words: `sun elevation at least 20°`. */
export function sentence(document: ConstraintDocument, kinds: readonly ConstraintKind[]): string {
  const known = kinds.find((kind) => kind.kind === document.kind);
  const parts = known === undefined ? null : partsOf(known);
  if (parts === null) return words(document.kind);
  const { values } = fieldsOfDocument(document, parts);
  const said = parts
    .filter((part) => values[part.name] !== null && values[part.name] !== part.usual)
    .map((part) => `${part.label} ${told(values[part.name] ?? null)}${part.unit === "°" ? "" : part.unit && " "}${part.unit}`);
  return [words(document.kind), said.join(", ")].join(" ").trim();
}

function told(value: Value): string {
  return typeof value === "number" ? String(Number(value.toFixed(1))) : String(value);
}

/** A number of the wire in the unit that people read, without the dust of the conversion. */
function shown(value: number, perUnit: number): number {
  return Number((value / perUnit).toPrecision(12));
}
