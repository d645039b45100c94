import { describe, expect, it } from "vitest";
import { branchesFlown, ends, type Frequency, helpWords, optionOf, verdict, within } from "../src/lib/campaign";
import type { Line } from "../src/lib/plan-tree";

const found = (what: string, share: number, predicted: number | null): Frequency => ({
  what, runs: 1000 * share, share, interval: { low: share - 0.02, high: share + 0.02 }, predicted,
});
const line = (id: string, depth: number) => ({ id, depth, when: [], p: 0.1 }) as unknown as Line;

describe("what a campaign says", () => {
  it("puts options in the order of the plan, also those that no run took", () => {
    const lines = [line("main", 0), line("option-1", 1), line("option-2", 2)];
    const told = branchesFlown(lines, [found("outcome SUCCEEDED", 1, null), found("option option-2", 0.3, 0.31)]);
    expect(told.map(({ line, flown }) => [line.id, flown?.share ?? null])).toEqual([["option-1", null], ["option-2", 0.3]]);
    expect(optionOf(found("over budget", 0, null))).toBeNull();
  });

  it("tells a prediction outside the interval", () => {
    expect(within(found("option a", 0.3, 0.31))).toBe(true);
    expect(within(found("option a", 0.3, 0.33))).toBe(false);
    expect(within(found("option a", 0.3, null))).toBe(true);
  });

  it("says how far the mean is from what was expected", () => {
    const utility = { mean: 1, sd: 1, standard_error: 1, interval: { low: null, high: null }, quantiles: {}, predicted: 2, deviation: -1.26 };
    expect(verdict(utility)?.text).toBe("The planner expected 2.00; the mean is 1.3 standard errors below it, which is within chance.");
    expect(verdict({ ...utility, deviation: 4.2 })).toMatchObject({ far: true });
    expect(verdict({ ...utility, predicted: null })).toBeNull();
  });

  it("names what would help in the units of the page", () => {
    expect(["time-plus-600-s", "energy-plus-36000-j", "half-the-losses-of-tracks"].map(helpWords)).toEqual([
      "0:10:00 more time", "10.0 Wh more energy", "half the losses of tracks",
    ]);
    expect(ends({ low: null, high: 0.5 }, String)).toBe("up to 0.5");
  });
});
