/** Two plans side by side: which lines answer each other, and which activities only one of them has. */

import { type Condition, type Line, MAIN, type Step } from "./plan-tree";

export interface StepPair {
  a: Step | null;
  b: Step | null;
}

export interface LinePair {
  a: Line | null;
  b: Line | null;
  depth: number;
  steps: StepPair[];
}

const drawn = (step: Step): boolean => step.op !== "branch" && step.op !== "stop";
const nameOf = (step: Step): string => `${step.op} ${step.request ?? step.target ?? ""}`;

/** Longest common subsequence of two lists of activities, the others beside it in their order. */
export function pairSteps(a: readonly Step[], b: readonly Step[]): StepPair[] {
  const [left, right] = [a.filter(drawn), b.filter(drawn)];
  const longest = Array.from({ length: left.length + 1 }, () => Array<number>(right.length + 1).fill(0));
  const at = (i: number, j: number): number => longest[i]?.[j] ?? 0;
  for (let i = left.length - 1; i >= 0; i -= 1) {
    for (let j = right.length - 1; j >= 0; j -= 1) {
      const [x, y] = [left[i], right[j]];
      const row = longest[i];
      if (row === undefined || x === undefined || y === undefined) continue;
      row[j] = nameOf(x) === nameOf(y) ? at(i + 1, j + 1) + 1 : Math.max(at(i + 1, j), at(i, j + 1));
    }
  }
  const pairs: StepPair[] = [];
  let [i, j] = [0, 0];
  while (i < left.length || j < right.length) {
    const [x, y] = [left[i] ?? null, right[j] ?? null];
    if (x !== null && y !== null && nameOf(x) === nameOf(y)) {
      pairs.push({ a: x, b: y });
      i += 1;
      j += 1;
    } else if (y === null || (x !== null && at(i + 1, j) >= at(i, j + 1))) {
      pairs.push({ a: x, b: null });
      i += 1;
    } else {
      pairs.push({ a: null, b: y });
      j += 1;
    }
  }
  return pairs;
}

const kindOf = (condition: Condition): string => `${condition.var} ${condition.target ?? condition.observation ?? ""}`;

/** How alike two branches are, 0 to 1: half by what they wait for, half by what they do. */
export function likeness(a: Line, b: Line): number {
  const share = (x: Set<string>, y: Set<string>): number => {
    const both = [...x].filter((entry) => y.has(entry)).length;
    return x.size + y.size === 0 ? 1 : both / (x.size + y.size - both);
  };
  return (
    0.5 * share(new Set(a.when.map(kindOf)), new Set(b.when.map(kindOf))) +
    0.5 * share(new Set(a.steps.filter(drawn).map(nameOf)), new Set(b.steps.filter(drawn).map(nameOf)))
  );
}

const LEAST = 0.5;

/** Lines of two plans in pairs: main line to main line, then below each pair the branches that are most alike. */
export function pairLines(a: readonly Line[], b: readonly Line[]): LinePair[] {
  const childrenOf = (lines: readonly Line[], id: string): Line[] => lines.filter((line) => line.parent === id);
  const pairs: LinePair[] = [];
  function alone(line: Line, lines: readonly Line[], side: "a" | "b"): void {
    pairs.push({
      a: side === "a" ? line : null,
      b: side === "b" ? line : null,
      depth: line.depth,
      steps: side === "a" ? pairSteps(line.steps, []) : pairSteps([], line.steps),
    });
    for (const child of childrenOf(lines, line.id)) alone(child, lines, side);
  }
  function both(x: Line, y: Line): void {
    pairs.push({ a: x, b: y, depth: x.depth, steps: pairSteps(x.steps, y.steps) });
    const [left, right] = [childrenOf(a, x.id), childrenOf(b, y.id)];
    const ranked = left
      .flatMap((p) => right.map((q) => ({ p, q, like: likeness(p, q) })))
      .filter(({ like }) => like >= LEAST)
      .sort((s, t) => t.like - s.like);
    const partner = new Map<Line, Line>();
    const taken = new Set<Line>();
    for (const { p, q } of ranked) {
      if (partner.has(p) || taken.has(q)) continue;
      partner.set(p, q);
      taken.add(q);
    }
    for (const p of left) {
      const q = partner.get(p);
      if (q === undefined) alone(p, a, "a");
      else both(p, q);
    }
    for (const q of right) if (!taken.has(q)) alone(q, b, "b");
  }
  const [x, y] = [a.find((line) => line.id === MAIN), b.find((line) => line.id === MAIN)];
  if (x !== undefined && y !== undefined) both(x, y);
  else if (x !== undefined) alone(x, a, "a");
  else if (y !== undefined) alone(y, b, "b");
  return pairs;
}
