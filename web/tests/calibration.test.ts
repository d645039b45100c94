import { describe, expect, it } from "vitest";
import { calibrationOf, rate } from "../src/lib/calibration";

describe("the odds that a mission has learned", () => {
  it("are those of the profile where there is no document", () => {
    expect(calibrationOf(null)).toBeNull();
  });

  it("say each rate with its error, and what no run has told", () => {
    const learned = calibrationOf({
      source: "12 legs of 3 recorded runs",
      inside_per_m: 0.0271,
      inside_se_per_m: 0.0067,
      outside_per_m: 0.05,
      outside_se_per_m: 0,
      occluded_per_m: 0.15,
      tracks: 20,
      losses: 4,
      legs: 12,
      failures: 3,
      fail_per_m: 0.021,
      fail_se_per_m: 0.012,
    });
    expect(learned?.rates.map(rate)).toEqual(["0.027 ± 0.007", "0.050, not seen", "0.150, not seen"]);
    expect([learned?.losses, learned?.tracks]).toEqual([4, 20]);
    expect([learned?.failures, learned?.legs, learned && rate(learned.short)]).toEqual([3, 12, "0.021 ± 0.012"]);
  });
});
