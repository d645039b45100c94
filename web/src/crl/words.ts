/** What may stand at a place of a text of CRL, and what a word of it means. */

import type { Rover } from "../api/types";
import words from "../lib/crl-words.json";
import { nodesOf } from "../lib/crl";
import { around, type Frame, type Place, placeAt, plain } from "./place";

/** What a text may name beside the words of the language. */
export interface Vocabulary {
  actions: readonly Rover["actions"][number][];
  telemetry: readonly Rover["telemetry"][number][];
  instruments: readonly Rover["instruments"][number][];
  targets: readonly { id: string; name: string }[];
  requests: readonly { id: string; name: string }[];
}

export interface Suggestion {
  label: string;
  /** What is written, where that is not the label. */
  apply?: string;
  detail: string;
  kind: "keyword" | "property" | "function" | "variable" | "enum";
}

export interface Help {
  title: string;
  lines: string[];
}

type Value = Rover["actions"][number]["parameters"][number];
const FIELDS = words.fields as unknown as Record<string, Record<string, string[]>>;
const ABOUT = words.about as Record<string, string>;
const ABOUT_FIELDS = words.about_fields as Record<string, string>;
const REQUIRED = words.required as Record<string, string[]>;
/** The forms that a field holds, and how many brackets lie between both. */
const HELD: Record<string, [readonly string[], number]> = {
  ":node": [words.nodes, 1],
  ":node-list": [words.nodes, 2],
  ":options": [["option"], 2],
  ":floating": [["floating-contingency"], 2],
  ":library": [["alternate"], 2],
};
const CONDITIONS = /^:(?!.*temporal).*conditions$/;
const TEMPORAL = /temporal-conditions$/;
const KEY_HOLDERS = new Set(["database", "known"]);

const tidy = (text: string): string => text.replaceAll("`", "");

const heads = (kinds: readonly string[]): Suggestion[] =>
  kinds.map((kind) => ({ label: kind, detail: ABOUT[kind] ?? "", kind: "keyword" }));

const named = (things: Vocabulary["targets"]): Suggestion[] =>
  things.map(({ id, name }) => ({ label: name, apply: id, detail: id, kind: "variable" }));

const choices = (of: readonly string[], sign = ""): Suggestion[] =>
  of.map((word) => ({ label: sign + word, detail: "", kind: "enum" }));

/** A parameter or key for people: type, unit, limits. */
function told(value: Value): string {
  const limits = [value.minimum === null ? "" : `at least ${value.minimum}`, value.maximum === null ? "" : `at most ${value.maximum}`];
  return [value.type, value.unit, ...limits, value.choices.join(" | "), value.required ? "required" : ""].filter(Boolean).join(", ");
}

function values(name: string, spec: Value | undefined, action: Rover["actions"][number] | undefined, known: Vocabulary): Suggestion[] {
  if (action !== undefined && action.instrument === name) {
    return known.instruments.map((one) => ({ label: one.profile_name, detail: one.doc, kind: "enum" }));
  }
  if (spec?.type === "boolean") return choices(["t", "nil"]);
  if (spec !== undefined && spec.choices.length > 0) return choices(spec.choices);
  if (/target/.test(name)) return named(known.targets);
  return /^(request|observation)$/.test(name) ? named(known.requests) : [];
}

/** What stands in `(name = value ...)`: the names first, then the values of the last one. */
function pairs(top: Frame, names: Suggestion[], of: (name: string) => Suggestion[]): Suggestion[] {
  if (top.words.length % 2 === 1) return of(top.words.at(-1) as string);
  const given = new Set(top.words.filter((_, k) => k % 2 === 0));
  return names.filter((one) => !given.has(one.label));
}

function inForm(owner: Frame, known: Vocabulary, ids: () => Suggestion[]): Suggestion[] {
  const of = FIELDS[owner.head as string] ?? {};
  const fields = Object.keys(of)
    .filter((word) => !owner.fields.includes(`:${word}`))
    .map<Suggestion>((word) => ({ label: `:${word}`, detail: tidy(ABOUT_FIELDS[word] ?? ""), kind: "property" }));
  if (owner.words.length > 0 || owner.field === null) return fields;
  if (owner.field === ":action") return known.actions.map((one) => ({ label: one.name, detail: one.doc, kind: "function" }));
  if (owner.field === ":scope") return ids();
  return [...choices(of[owner.field.slice(1)] ?? [], ":"), ...fields];
}

function inCondition(place: Place, top: Frame, known: Vocabulary): Suggestion[] {
  const outside = place.frames.at(-2);
  if (outside !== undefined && KEY_HOLDERS.has(outside.words[0] ?? "")) {
    if (top.words.length === 0) {
      return known.telemetry.map((one) => ({ label: `:${one.key}`, detail: one.value.doc, kind: "property" }));
    }
    const key = known.telemetry.find((one) => `:${one.key}` === top.words[0]);
    return [...choices(key?.value.choices ?? []), ...named(known.targets)];
  }
  return top.words.length === 0 ? choices(words.conditions) : [];
}

/** Return what may stand at an offset, and where the word that is being written begins; null where nothing is known. */
export function suggestionsAt(text: string, offset: number, known: Vocabulary): { from: number; options: Suggestion[] } | null {
  const place = placeAt(text, offset);
  const found = place === null ? null : around(place);
  if (place === null || found === null || place.token?.kind === "string") return null;
  const { owner, depth, top } = found;
  const from = offset - place.word.length;
  const ids = (): Suggestion[] => nodesOf(text).map((node) => ({ label: node.id, detail: node.kind, kind: "variable" }));
  const options = ((): Suggestion[] => {
    if (owner === null) return top.words.length === 0 ? heads(["plan", ...words.nodes]) : [];
    if (depth === 0) return inForm(owner, known, ids);
    const field = owner.field ?? "";
    const held = HELD[field];
    if (held !== undefined) return depth === held[1] && top.words.length === 0 ? heads(held[0]) : [];
    if (field === ":parameters") {
      const action = known.actions.find((one) => one.name === owner.action);
      const specs = action?.parameters ?? [];
      const names = specs.map<Suggestion>((one) => ({ label: one.name, detail: told(one), kind: "property" }));
      return pairs(top, names, (name) => values(name, specs.find((one) => one.name === name), action, known));
    }
    if (field === ":metadata") return pairs(top, [], (name) => values(name, undefined, undefined, known));
    if (TEMPORAL.test(field)) return depth !== 2 ? [] : top.words.length === 0 ? [...choices([":relative"]), ...ids()] : choices(["start", "end"]);
    return CONDITIONS.test(field) && depth > 1 ? inCondition(place, top, known) : [];
  })();
  return options.length === 0 ? null : { from, options };
}

/** Return what the word at an offset means; null where nothing is known of it. */
export function helpAt(text: string, offset: number, known: Vocabulary): ({ from: number; to: number } & Help) | null {
  const place = placeAt(text, offset);
  const token = place?.token ?? null;
  if (place === null || token === null) return null;
  const found = meaning(place, plain(token), token.kind, known);
  return found === null ? null : { from: token.start, to: token.start + token.text.length, ...found };
}

function meaning(place: Place, word: string, kind: string, known: Vocabulary): Help | null {
  const at = around(place);
  if (at === null) return null;
  const { owner, depth, top } = at;
  if (kind === "head" && top.head === null && top.words.length === 0) {
    const needed = (REQUIRED[word] ?? []).map((field) => `:${field}`).join(" ");
    return { title: word, lines: [ABOUT[word] ?? "", needed === "" ? "" : `It must have ${needed}.`].filter(Boolean) };
  }
  if (kind === "keyword") {
    const key = known.telemetry.find((one) => `:${one.key}` === word);
    if (depth > 0 && key !== undefined) return { title: word, lines: [key.value.doc, told(key.value)].filter(Boolean) };
    const name = word.slice(1);
    const of = FIELDS[owner?.head ?? ""]?.[name];
    if (depth !== 0 || of === undefined) return null;
    return { title: word, lines: [tidy(ABOUT_FIELDS[name] ?? ""), of.length === 0 ? "" : of.map((one) => `:${one}`).join(" | ")].filter(Boolean) };
  }
  const action = known.actions.find((one) => one.name === (depth === 0 && owner?.field === ":action" ? word : owner?.action));
  if (depth === 0 && owner?.field === ":action" && action !== undefined) {
    return { title: action.name, lines: [action.doc, ...action.parameters.map((one) => `${one.name}: ${told(one)}`)].filter(Boolean) };
  }
  if (owner?.field === ":parameters" && top.words.length % 2 === 0) {
    const spec = action?.parameters.find((one) => one.name === word);
    if (spec !== undefined) return { title: spec.name, lines: [spec.doc, told(spec)].filter(Boolean) };
  }
  const thing = [...known.targets, ...known.requests].find((one) => one.id === word);
  return thing === undefined ? null : { title: thing.name, lines: [thing.id] };
}
