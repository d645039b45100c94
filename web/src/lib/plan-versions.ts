/** Differences and conflicts of plans in words, and where they stand in the plan's tree. No ids are shown. */

import type { PlanChange, PlanConflict } from "../api/version-calls";
import type { CrlNode } from "./crl";
import { words } from "./format";
import { type Line, MAIN } from "./plan-tree";

/** Names of targets and requests by their ids. */
export interface Names {
  target: (id: string) => string;
  request: (id: string) => string;
}

const ACTIONS: Record<string, string> = {
  navigate: "drive to",
  trackstart: "track",
  trackstop: "stop tracking",
  pointmast: "point the mast at",
  imagepanorama: "take a panorama",
  handoff: "hand off",
};
const FIELDS: Record<string, string> = {
  "start-conditions": "may begin if",
  "end-conditions": "has ended if",
  "maintain-conditions": "goes on only while",
  "wait-for": "waits for",
  "start-temporal-conditions": "begins within",
  "end-temporal-conditions": "ends within",
  "continue-on-failure": "the plan goes on if it fails",
  "if-none": "if no option can be taken",
  "on-option-failure": "if the option fails",
  expectations: "prediction",
  "expectation-spread": "how predictions state their spread",
  "overrun-penalty": "cost of an overrun",
  "node-list": "order of steps",
  reward: "value",
  utility: "value of the option",
};

/** A field of a part as people call it. */
export const fieldWords = (field: string): string => FIELDS[field] ?? words(field);

/** A CRL text with names in the place of ids; `parts` are nodes of the plans it is from. */
export function plainText(text: string, parts: ReadonlyMap<string, CrlNode>, names: Names): string {
  return text.replace(/[A-Za-z][A-Za-z0-9_-]*/g, (word) => {
    const known = parts.get(word);
    if (known !== undefined && /[-\d]/.test(word)) return `“${partName(word, parts, names)}”`;
    return named(word, names);
  });
}

function named(word: string, names: Names): string {
  return word.replace(/\b(tgt|req)-[a-z0-9]+/, (id) => (id.startsWith("tgt-") ? names.target(id) : names.request(id)));
}

/** What a part of a plan is called: what it does and where, not its id. */
export function partName(id: string, parts: ReadonlyMap<string, CrlNode>, names: Names): string {
  if (id === "") return "the plan itself";
  if (id === "root") return "main line";
  if (id === "the plan") return id;
  const node = parts.get(id);
  const option = /^option-(.+)$/.exec(id);
  if (option !== null) return `branch ${option[1]}`;
  const inside = /^plan-(.+)$/.exec(id);
  if (inside?.[1] !== undefined) return `steps of ${partName(inside[1], parts, names)}`;
  const request = node?.metadata.request ?? node?.metadata.observation;
  const branch = branchOf(node, parts);
  const inBranch = branch === null ? "" : `, branch ${branch}`;
  if (node?.kind === "task") {
    if (request !== undefined) return `observe ${names.request(request)}${inBranch}`;
    const target = node.metadata.target ?? node.metadata["target-target"];
    const action = ACTIONS[node.action ?? ""] ?? words(node.action ?? id);
    return `${action}${target === undefined ? "" : ` ${names.target(target)}`}${inBranch}`;
  }
  const at = /^at-(req-[a-z0-9]+)/.exec(id)?.[1];
  if (at !== undefined) return `visit for ${names.request(at)}${inBranch}`;
  if (id === "go-on" || id.startsWith("go-on-")) return `going on without a branch${inBranch}`;
  const text = named(id, names);
  return text === id ? words(id) : text;
}

/** The branch that a part lies in: the same step may stand in several. */
function branchOf(node: CrlNode | undefined, parts: ReadonlyMap<string, CrlNode>): string | null {
  for (let at = node?.parent ?? null; at !== null; at = parts.get(at)?.parent ?? null) {
    const option = /^option-(.+)$/.exec(at);
    if (option !== null) return option[1] ?? null;
  }
  return null;
}

const DEEDS: Record<PlanChange["deed"], string> = {
  added: "new",
  removed: "gone",
  changed: "changed",
  moved: "moved",
  reordered: "reordered",
  renamed: "renamed",
};

/** A difference as a line: what, how, and the two values where it has any. */
export interface ChangeLine {
  key: string;
  group: PlanChange["group"];
  part: string;
  deed: string;
  field: string;
  before: string;
  after: string;
}

/** Differences in words. */
export function changeLines(changes: readonly PlanChange[], parts: ReadonlyMap<string, CrlNode>, names: Names): ChangeLine[] {
  return changes.map((change, k): ChangeLine => {
    const told = (text: string | undefined): string => plainText(text ?? "", parts, names);
    const values = change.deed === "changed" && change.field !== "metadata";
    const moved = change.deed === "moved";
    return {
      key: `${k}`,
      group: change.group,
      part: change.kind === "plan" && change.id === "" ? "the plan itself" : partName(change.id, parts, names),
      deed: DEEDS[change.deed],
      field: change.field === undefined || change.field === "" ? "" : change.field === "metadata" ? "notes" : fieldWords(change.field),
      before: moved ? partName(change.before ?? "", parts, names) : values ? told(change.before) : "",
      after: moved ? partName(change.after ?? "", parts, names) : values ? told(change.after) : "",
    };
  });
}

/** Titles of the groups of differences, in the order they are shown. */
export const GROUPS: readonly (readonly [PlanChange["group"], string])[] = [
  ["steps", "Steps"],
  ["branches", "Branches"],
  ["conditions", "Conditions"],
  ["windows", "Windows"],
  ["resources", "Resources"],
  ["header", "The plan as a whole"],
  ["words", "Names, notes and predictions"],
];

/** Where differences stand in a plan's tree: words by step and by branch. */
export interface Marks {
  steps: ReadonlyMap<string, string>;
  lines: ReadonlyMap<string, string>;
}

/**
 * Mark the steps and branches of a plan that a difference to it names. `path` in the notes of a node says which step
 * it was made of: `4` is the fifth step, `4.0` its first option, `4.0.2` the third step of that.
 */
export function marksOf(changes: readonly PlanChange[], parts: ReadonlyMap<string, CrlNode>, lines: readonly Line[]): Marks {
  const steps = new Map<string, string>();
  const marked = new Map<string, string>();
  for (const change of changes) {
    if (change.group === "words" || change.group === "header" || change.deed === "removed") continue;
    const node = parts.get(change.id);
    const path = node?.metadata.step;
    if (node === undefined || path === undefined || path === "") continue;
    const place = placeOf(path, lines);
    if (place === null) continue;
    const [into, key] = place.step === null ? [marked, place.line] : [steps, place.step];
    const word = change.deed === "reordered" ? "reordered" : DEEDS[change.deed];
    if (into.get(key) !== "new") into.set(key, word);
  }
  return { steps, lines: marked };
}

function placeOf(path: string, lines: readonly Line[]): { line: string; step: string | null } | null {
  const byId = new Map(lines.map((line) => [line.id, line]));
  let line = byId.get(MAIN);
  const numbers = path.split(".").map(Number);
  for (let k = 0; k < numbers.length; k += 2) {
    const step = line?.steps[numbers[k] ?? -1];
    if (line === undefined || step === undefined) return null;
    const option = numbers[k + 1];
    if (option === undefined) return { line: line.id, step: step.op === "branch" ? null : step.key };
    const fork = step.forks[option];
    if (fork === undefined) return null;
    if (k + 2 >= numbers.length) return { line: fork, step: null };
    line = byId.get(fork);
  }
  return null;
}

/** What a kind of conflict means. */
export const CONFLICTS: Record<string, string> = {
  "both-changed": "both changed it",
  "both-added": "both added something else under one name",
  "removed-and-changed": "one side removed what the other changed",
  "both-moved": "both moved it, to different places",
  "both-reordered": "both put it into an order of their own",
  "same-place": "both added steps at the same place",
  circle: "each side put one of two parts into the other",
  invalid: "the joined plan breaks a rule that none of the three broke",
};

/** What names a conflict to the server and among others. */
export const conflictKey = (conflict: { kind: string; id: string; field: string }): string => `${conflict.kind}:${conflict.id}:${conflict.field}`;

export interface ConflictWords {
  key: string;
  part: string;
  field: string;
  kind: string;
  base: string;
  ours: string;
  theirs: string;
}

export function conflictWords(conflict: PlanConflict, parts: ReadonlyMap<string, CrlNode>, names: Names): ConflictWords {
  const told = (text: string): string => (text === "" ? "not set" : plainText(text, parts, names));
  return {
    key: conflictKey(conflict),
    part: partName(conflict.id, parts, names),
    field: conflict.field === "" ? "" : fieldWords(conflict.field),
    kind: CONFLICTS[conflict.kind] ?? words(conflict.kind),
    base: told(conflict.base),
    ours: told(conflict.ours),
    theirs: told(conflict.theirs),
  };
}

/** The plan that two plans are edits of, as far as it is known: a parent that both share, else the parent of one. */
export function commonBase<T extends { id: string; parent_id: string | null }>(plans: readonly T[], ours: T, theirs: T | null): T | null {
  const byId = new Map(plans.map((plan) => [plan.id, plan]));
  const chain = (plan: T | null): T[] => {
    const found: T[] = [];
    for (let at = plan ?? undefined; at !== undefined && !found.includes(at); at = at.parent_id === null ? undefined : byId.get(at.parent_id)) found.push(at);
    return found;
  };
  const theirChain = new Set(chain(theirs));
  return chain(ours).find((plan) => theirChain.has(plan)) ?? chain(ours)[1] ?? chain(theirs)[1] ?? null;
}
