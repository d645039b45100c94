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
    expect([learned?.days, learned?.between]).toEqual([0, []]);
  });

  it("say how often each activity succeeded, and pass over what is none", () => {
    const mi = { name: "mi", tried: 30, succeeded: 21, p_success: 0.729, p_se: 0.074 };
    const learned = calibrationOf({ arrival_rate: 0.11, arrival_se: 0.05, activities: [mi, null, { tried: 2 }] });
    expect(learned && rate(learned.arrival)).toBe("0.110 ± 0.050");
    expect(learned?.activities.map((row) => [row.name, row.succeeded, row.tried, rate(row.chance)])).toEqual([
      ["mi", 21, 30, "0.729 ± 0.074"],
    ]);
    expect(calibrationOf({ legs: 3 })?.activities).toEqual([]);
  });

  it("say how far days are apart where they differ", () => {
    const learned = calibrationOf({ days: 7, day_time_sd: 0.28, day_time_se: 0.08, day_energy_sd: 0 });
    expect(learned?.days).toBe(7);
    expect(learned?.between.map((row) => [row.where, rate(row)])).toEqual([["times", "0.280 ± 0.080"]]);
  });
});
