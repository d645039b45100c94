import { describe, expect, it } from "vitest";
import { type Columns, newestUntil, trailOf } from "../src/lib/replay";

const records = [0, 5, 5, 9].map((t_s, k) => ({ t_s, event: "start", arguments: [`n${k}`] }));
const times = records.map((record) => record.t_s);

describe("a run at a moment", () => {
  it("has the records until then, newest first, and no more than are wanted", () => {
    expect(newestUntil(records, times, 5, 60).map((found) => found.index)).toEqual([2, 1, 0]);
    expect(newestUntil(records, times, 8.9, 2).map((found) => found.record.arguments[0])).toEqual(["n2", "n1"]);
    expect(newestUntil(records, times, -1, 60)).toEqual([]);
  });

  it("has a trail of places that are apart, each with its sample", () => {
    const east_m = [0, 0.01, null, 0.06, 0.07, 0.2];
    const columns = { t_s: [0, 1, 2, 3, 4, 5], east_m, north_m: [0, 0, 0, 0, 0, 0] } as unknown as Columns;
    expect(trailOf(columns)).toEqual({ samples: [0, 3, 5], points: [[0, 0], [0.06, 0], [0.2, 0]] });
  });
});
