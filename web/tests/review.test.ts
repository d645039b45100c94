import { describe, expect, it } from "vitest";
import { curveOf, trackersOf } from "../src/lib/confidence";
import { likeness, pairLines, pairSteps } from "../src/lib/plan-diff";
import { linesOf, type PlanTree, type TreeStep } from "../src/lib/plan-tree";
import type { Columns } from "../src/lib/replay";
import { riskProblemOf } from "../src/lib/plan-order";
import { type Baseline, changesOf, isUnchanged, nextWish, tells, UNCHANGED } from "../src/lib/what-if";

const BASE: Baseline = {
  time_budget_s: 3600,
  energy_budget_j: 1000,
  values: new Map([
    ["a", 3],
    ["b", 5],
  ]),
  keepOuts: [
    { id: "k1", polygon_m: [[0, 0], [1, 0], [0, 1]] },
    { id: "k2", polygon_m: [[5, 5], [6, 5], [5, 6]] },
  ],
};

describe("a what-if", () => {
  it("names only what was changed", () => {
    expect(changesOf(UNCHANGED, BASE)).toEqual({});
    expect(isUnchanged({ ...UNCHANGED, values: { a: 3 } }, BASE)).toBe(true);
    expect(
      changesOf({ ...UNCHANGED, time: 0.5, energy: 2, delayMin: 10, loss: 0, wishes: { b: "out", a: "must" }, values: { a: 4, b: 5 } }, BASE),
    ).toEqual({
      exclude: ["b"],
      force: ["a"],
      values: { a: 4 },
      time_budget_s: 1800,
      energy_budget_j: 2000,
      start_delay_s: 600,
      loss_factor: 0,
    });
  });

  it("sends the keep-outs that are left when one is lifted", () => {
    expect(changesOf({ ...UNCHANGED, lifted: ["k1"] }, BASE)).toEqual({ keep_outs: [[[5, 5], [6, 5], [5, 6]]] });
    expect(changesOf({ ...UNCHANGED, lifted: ["k1", "k2"] }, BASE)).toEqual({ keep_outs: [] });
  });

  it("sends a keep-out as it is tried, and nothing of one that is lifted or gone", () => {
    const tried = [[7, 7], [8, 7], [7, 8]];
    const others = changesOf({ ...UNCHANGED, lifted: ["k1"] }, BASE).keep_outs;
    expect(changesOf({ ...UNCHANGED, moved: { k2: tried } }, BASE).keep_outs?.[1]).toEqual(tried);
    expect(changesOf({ ...UNCHANGED, moved: { k1: tried }, lifted: ["k1"] }, BASE).keep_outs).toEqual(others);
    expect(changesOf({ ...UNCHANGED, moved: { gone: tried } }, BASE)).toEqual({});
  });
});

describe("the order of a plan", () => {
  it("takes a risk above none and below certain, in per cent", () => {
    expect([null, undefined, 5, 0.1, 99.9].map(riskProblemOf)).toEqual(["", "", "", "", ""]);
    expect(riskProblemOf(0)).toContain("more than 0");
    expect(riskProblemOf(-3)).toContain("-3 %");
    expect(riskProblemOf(100)).toContain("less than 100");
    expect(riskProblemOf(Number.NaN)).toContain("number");
  });

  it("goes round its wishes and tells a change from noise", () => {
    expect([undefined, "out", "must"].map((wish) => nextWish(wish as "out" | "must" | undefined))).toEqual(["out", "must", undefined]);
    expect(tells(0.1, 0.08)).toBe(false);
    expect(tells(-0.2, 0.08)).toBe(true);
    expect(tells(0.001, 0)).toBe(false);
  });
});

const observe = (name: string, more: Partial<TreeStep> = {}): TreeStep => ({ op: "observe", observation: name, ...more });
const lines = (plan: TreeStep[]) => linesOf({ format: "plan-tree/2", plan } as PlanTree);

describe("two plans side by side", () => {
  it("line up what both do and set beside it what one does", () => {
    const [a, b] = [lines([observe("1"), observe("2"), observe("4")])[0], lines([observe("1"), observe("3"), observe("4")])[0]];
    const pairs = pairSteps(a?.steps ?? [], b?.steps ?? []);
    expect(pairs.map((pair) => [pair.a?.request ?? null, pair.b?.request ?? null])).toEqual([
      ["1", "1"],
      ["2", null],
      [null, "3"],
      ["4", "4"],
    ]);
  });

  it("are compared branch by branch, most alike first", () => {
    const late = (name: string, ge: number) => ({ id: `late-${name}`, when: [{ var: "time_s" as const, ge }], plan: [observe(name)] });
    const lost = (name: string) => ({ id: `lost-${name}`, when: [{ var: "tracked" as const, target: "T", is: false }], plan: [observe(name)] });
    const a = lines([observe("1"), { op: "branch", options: [late("2", 100), lost("3")] }]);
    const b = lines([observe("1"), { op: "branch", options: [lost("3"), late("2", 180)] }]);
    const pairs = pairLines(a, b);
    expect(pairs.map((pair) => [pair.a?.id, pair.b?.id])).toEqual([
      ["main", "main"],
      ["late-2", "late-2"],
      ["lost-3", "lost-3"],
    ]);
    expect(pairs.every((pair) => pair.steps.every((step) => step.a !== null && step.b !== null))).toBe(true);
    expect(likeness(a[1]!, b[1]!)).toBe(0);
  });

  it("say where a branch has no counterpart", () => {
    const a = lines([observe("1"), { op: "branch", options: [{ id: "x", when: [{ var: "energy_j", ge: 5 }], plan: [observe("9")] }] }]);
    const pairs = pairLines(a, lines([observe("1")]));
    expect(pairs.map((pair) => [pair.a?.id ?? null, pair.b?.id ?? null])).toEqual([
      ["main", "main"],
      ["x", null],
    ]);
    expect(pairLines([], a).map((pair) => pair.b?.id)).toEqual(["main", "x"]);
  });
});

describe("confidence of a tracker", () => {
  const columns = (states: (string | null)[], confidence: (number | null)[]): Columns => ({
    t_s: states.map((_, k) => 10 * k),
    east_m: states.map((_, k) => k),
    north_m: states.map(() => 0),
    heading_rad: [],
    battery_j: [],
    energy_used_j: [],
    task: [],
    tracker_state: { T: states, idle: states.map(() => null) },
    tracker_confidence: { T: confidence, idle: states.map(() => 0) },
  });

  it("breaks where nothing is tracked and marks the loss", () => {
    const found = curveOf(columns([null, "tracked", "tracked", "lost", "none", "tracked"], [null, 0.9, 0.6, 0.1, 0, 0.8]), "T", [10, 0], "time");
    expect(found.pieces.map((piece) => piece.map((p) => p[0]))).toEqual([[10, 20, 30], [50]]);
    expect(found.lost).toEqual([[30, 0.1]]);
  });

  it("is drawn over the distance that is left", () => {
    const found = curveOf(columns(["tracked", "tracked"], [0.9, 0.5]), "T", [10, 0], "distance");
    expect(found.pieces).toEqual([[[10, 0.9, 0], [9, 0.5, 10]]]);
    expect(curveOf(columns(["tracked"], [1]), "T", null, "distance").pieces).toEqual([]);
  });

  it("keeps a short dip when it is thinned out", () => {
    const many = Array.from({ length: 2000 }, (_, k) => (k === 777 ? 0.2 : 0.9));
    const found = curveOf(columns(many.map(() => "tracked"), many), "T", null, "time", 100);
    const points = found.pieces.flat();
    expect(points.length).toBeLessThanOrEqual(100);
    expect(points.some((p) => p[1] === 0.2 && p[0] === 7770)).toBe(true);
  });

  it("is known of trackers that reported one", () => {
    expect(trackersOf(columns(["tracked"], [0.4]))).toEqual(["T"]);
  });
});
