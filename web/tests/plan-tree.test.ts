import { describe, expect, it } from "vitest";
import { byOrder, byTime, hasTimes, visible } from "../src/plan/layout";
import { conditionText, legsOf, linesOf, MAIN, noBranchTaken, type PlanTree, reachOf, rowsOf } from "../src/lib/plan-tree";

const quantiles = (...times: number[]) => ({ p: [0.1, 0.5, 0.9], time_s: times, energy_j: times.map((t) => 10 * t) });

/** Drive to A and observe; then one of two options, or on to B. The second option has an option of its own. */
const TREE: PlanTree = {
  format: "plan-tree/2",
  plan: [
    { op: "track_start", target: "A", p_reached: 1, quantiles: quantiles(0, 0, 0) },
    { op: "navigate", to: "A", p_reached: 1, quantiles: quantiles(10, 10, 10) },
    { op: "observe", target: "A", observation: "a1", p_reached: 0.9, quantiles: quantiles(50, 60, 80) },
    {
      op: "branch",
      p_reached: 0.9,
      quantiles: quantiles(90, 100, 130),
      options: [
        {
          id: "option-1",
          when: [{ var: "time_s", ge: 120 }],
          p_taken: 0.2,
          gain: 1.5,
          utility_table: [[0, 4]],
          plan: [{ op: "visit", target: "C", observation: "c1", p_reached: 0.2, quantiles: quantiles(121, 125, 130) }],
        },
        {
          id: "option-2",
          when: [{ var: "tracked", target: "B", is: false }],
          p_taken: 0.1,
          plan: [
            { op: "navigate", to: "C", p_reached: 0.1 },
            {
              op: "branch",
              options: [{ id: "option-3", when: [], p_taken: 0.04, plan: [{ op: "visit", target: "D", observation: "d1" }] }],
            },
            { op: "observe", target: "C", observation: "c1", p_reached: 0.06 },
          ],
        },
      ],
    },
    { op: "visit", target: "B", observation: "b1", p_reached: 0.6, quantiles: quantiles(100, 110, 140) },
  ],
};

describe("a plan tree", () => {
  const lines = linesOf(TREE);

  it("is read as a mainline and its options in the order of the text", () => {
    expect(lines.map((line) => [line.id, line.depth, line.parent, line.p])).toEqual([
      [MAIN, 0, null, 1],
      ["option-1", 1, MAIN, 0.2],
      ["option-2", 1, MAIN, 0.1],
      ["option-3", 2, "option-2", 0.04],
    ]);
  });

  it("gives each option the place of its branch, so that its first drive starts there", () => {
    expect(legsOf(lines).map((leg) => [leg.line, leg.from, leg.to, leg.p])).toEqual([
      [MAIN, null, "A", 1],
      [MAIN, "A", "B", 0.6],
      ["option-1", "A", "C", 0.2],
      ["option-2", "A", "C", 0.1],
      ["option-3", "C", "D", 0.04],
    ]);
  });

  it("adds up the chance of a request over the lines that hold it", () => {
    const reach = reachOf(lines);
    expect(reach.get("a1")).toBeCloseTo(0.9);
    expect(reach.get("c1")).toBeCloseTo(0.26);
    expect(reach.get("d1")).toBeCloseTo(0.04);
  });

  it("takes times from the quantiles, 10 to 90 per cent", () => {
    expect(lines[0]?.steps[2]?.time).toEqual({ low: 50, mid: 60, high: 80 });
    expect(lines[0]?.steps[2]?.energy).toEqual({ low: 500, mid: 600, high: 800 });
  });

  it("lays rows out so that no connector crosses: an option stands below its parent", () => {
    expect(rowsOf(lines)).toEqual([MAIN, "option-1", "option-2", "option-3"]);
  });

  it("reads plan-tree/1, which knows no odds, ids or times", () => {
    const old = linesOf({
      format: "plan-tree/1",
      plan: [{ op: "branch", options: [{ when: [], plan: [{ op: "visit", target: "T2" }] }] }, { op: "visit", target: "T1" }],
    });
    expect(old.map((line) => line.id)).toEqual([MAIN, "option-1"]);
    expect(hasTimes(old)).toBe(false);
    expect(reachOf(old).get("T1")).toBe(0);
    expect(byOrder(old).bars).toHaveLength(2);
  });

  it("is laid out in time without a step that begins before the one it follows", () => {
    const layout = byTime(lines, () => 30);
    for (const line of lines) {
      const bars = layout.bars.filter((bar) => bar.step.line === line.id);
      bars.slice(1).forEach((bar, k) => expect(bar.start).toBeGreaterThanOrEqual(bars[k]?.start ?? 0));
      for (const bar of bars) expect(bar.end).toBeGreaterThanOrEqual(bar.start);
    }
    expect(layout.extent).toBeGreaterThanOrEqual(140);
  });

  it("draws only what can be seen", () => {
    const layout = byOrder(lines);
    expect(visible(layout.bars, 100, 200, 0, 10)).toEqual([]);
    expect(visible(layout.bars, 0, 100, 0, 0).every((bar) => bar.row === 0)).toBe(true);
  });

  it("says conditions in words", () => {
    const say = (k: number) =>
      conditionText(
        TREE.plan[3]?.options?.[k]?.when[0] ?? { var: "time_s" },
        (id) => `<${id}>`,
        (s) => `${s} s`,
        (j) => `${j} J`,
      );
    expect(say(0)).toBe("time ≥ 120 s");
    expect(say(1)).toBe("<B> lost");
  });
});

describe("a plan of 300 activities and 50 branches", () => {
  const big = linesOf({
    format: "plan-tree/2",
    plan: Array.from({ length: 50 }, (_, k) => [
      {
        op: "branch" as const,
        options: [
          {
            when: [],
            p_taken: 0.01,
            plan: Array.from({ length: 4 }, (_, i) => ({ op: "visit" as const, target: `O${k}.${i}`, quantiles: quantiles(k, k + i, k + 9) })),
          },
        ],
      },
      { op: "visit" as const, target: `T${k}`, quantiles: quantiles(k, k + 1, k + 2) },
      { op: "observe" as const, target: `T${k}`, quantiles: quantiles(k, k + 1, k + 2) },
    ]).flat(),
  });

  it("is laid out within a frame", () => {
    expect(big).toHaveLength(51);
    const begin = performance.now();
    for (let k = 0; k < 10; k += 1) byTime(big, () => 100);
    expect((performance.now() - begin) / 10).toBeLessThan(50);
    expect(byTime(big, () => 100).bars).toHaveLength(300);
  });
});

describe("an option that is taken because a track is lost", () => {
  const lines = linesOf({
    format: "plan-tree/2",
    plan: [
      { op: "navigate", to: "A", p_reached: 1, quantiles: quantiles(0, 0, 0) },
      {
        op: "branch",
        p_reached: 1,
        options: [
          {
            id: "lost",
            when: [{ var: "tracked", target: "B", is: false }],
            p_taken: 0.1,
            plan: [
              { op: "navigate", to: "B", require_tracked: true, p_reached: 0.1, quantiles: quantiles(90, 90, 90) },
              { op: "observe", target: "B", observation: "b1", p_reached: 0.1, quantiles: quantiles(90, 90, 90) },
              { op: "navigate", to: "C", p_reached: 0.1, quantiles: quantiles(90, 90, 90) },
              { op: "observe", target: "C", observation: "c1", p_reached: 0.1, quantiles: quantiles(150, 160, 170) },
            ],
          },
        ],
      },
      { op: "navigate", to: "B", require_tracked: true, p_reached: 0.9, quantiles: quantiles(90, 90, 90) },
      { op: "observe", target: "B", observation: "b1", p_reached: 0.9, quantiles: quantiles(120, 130, 140) },
    ],
  });

  it("neither drives to that target nor counts for its request, and the next drive leaves from where it stands", () => {
    expect(lines[1]?.steps.map((step) => [step.target, step.idle])).toEqual([["B", true], ["B", true], ["C", false], ["C", false]]);
    expect(legsOf(lines).filter((leg) => leg.line === "lost").map((leg) => [leg.from, leg.to])).toEqual([["A", "C"]]);
    expect(reachOf(lines).get("b1")).toBeCloseTo(0.9);
  });

  it("is said not to be taken as far as that is known: odds are the plan's of a day that came to its end", () => {
    expect(noBranchTaken("", lines)).toBe("None so far.");
    expect(noBranchTaken("SUCCEEDED", lines)).toBe("None: the mainline to its end, as was to be expected with 90 %.");
    expect(noBranchTaken("SUCCEEDED", lines.slice(0, 1))).toBe("None: the mainline to its end.");
    expect(noBranchTaken("ABORTED", lines)).toBe("None before the run ended: aborted.");
    expect(noBranchTaken("FAILED", lines)).toBe("None before the run ended: failed.");
  });

  it("has no bars for what it skips", () => {
    expect(byTime(lines, () => 10).bars.filter((bar) => bar.step.line === "lost").map((bar) => bar.step.target)).toEqual(["C", "C"]);
  });
});
