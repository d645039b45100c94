import { describe, expect, it } from "vitest";
import { bandOf, phaseWords, reasonsOf } from "../src/lib/planning";

describe("words about a search for a plan", () => {
  it("tells the phase without figures, which stand beside the plan that is drawn", () => {
    expect(phaseWords("branching: 39.80, 0 branches")).toBe("Looking for better plans");
    expect(phaseWords("bounds: 43.57, 8 branches")).not.toMatch(/\d/);
    expect(phaseWords("done: 44.40, 8 branches, at most 48.23")).not.toMatch(/\d/);
    expect(phaseWords("")).toBe("Planning");
  });
  it("keeps a word that it does not know", () => {
    expect(phaseWords("sols: 2")).toBe("sols: 2");
  });
  it("makes sentences of reasons, and nothing of what is none", () => {
    expect(reasonsOf({ reasons: ["no branches were tried: the limit of 3 s was used up", "", 4, "Whole."] })).toEqual([
      "No branches were tried: the limit of 3 s was used up.",
      "Whole.",
    ]);
    expect(reasonsOf({})).toEqual([]);
    expect(reasonsOf({ reasons: "text" })).toEqual([]);
  });
});

describe("what a day may earn", () => {
  it("is read from the summary of a plan", () => {
    expect(bandOf({ utility_p05: -3, utility_p50: 20.5, utility_p95: 31 })).toEqual([-3, 20.5, 31]);
  });

  it("is not known without a plan, or of one made before it was told", () => {
    expect(bandOf({ utility_p05: null, utility_p50: null, utility_p95: null })).toBeNull();
    expect(bandOf({})).toBeNull();
  });
});
