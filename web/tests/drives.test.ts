import { describe, expect, it } from "vitest";
import { cornersOf, drivesAt, type DriveRule, ruleLooks, stateOf, withRule } from "../src/lib/drives";

const segment = (start: string, end: string, length_m: number, loss = 0) => ({
  start,
  end,
  points_m: [],
  length_m,
  time_mean_s: 20 * length_m,
  p_lose: { B: loss },
});
const NETWORK = {
  nodes: [
    { id: "start", target_id: null, pose: { east_m: 0, north_m: 0 } },
    { id: "A.1", target_id: "A", pose: { east_m: 4, north_m: 0 } },
    { id: "B.1", target_id: "B", pose: { east_m: 0, north_m: 9 } },
  ],
  segments: [segment("start", "A.1", 4), segment("A.1", "B.1", 10, 0.1), segment("B.1", "A.1", 10, 0.4)],
};

describe("what is said of drives", () => {
  const rules: DriveRule[] = [{ from_target_id: null, to_target_id: "A", via_m: null }];

  it("holds in both directions", () => {
    expect(stateOf(rules, "A", null)).toBe("forbidden");
    expect(stateOf(rules, null, "A")).toBe("forbidden");
    expect(stateOf(rules, "A", "B")).toBe("free");
  });

  it("is replaced for a drive, or taken back, and stays for the others", () => {
    const drawn = withRule(rules, "B", "A", [[1, 2]]);
    expect(drawn).toHaveLength(2);
    expect(withRule(drawn, "A", "B", null)).toEqual([...rules, { from_target_id: "A", to_target_id: "B", via_m: null }]);
    expect(withRule(drawn, "A", "B", "free")).toEqual(rules);
  });
});

describe("the drives at a target", () => {
  it("stand in order of their length, with the larger chance of both directions", () => {
    expect(drivesAt(NETWORK, [], "A").map((d) => [d.other, d.length_m, d.loss])).toEqual([
      [null, 4, 0],
      ["B", 10, 0.4],
    ]);
  });

  it("say the larger chance of both directions to end short, none where the network knows of none", () => {
    const segments = NETWORK.segments.map((s, k) => (k === 0 ? s : { ...s, p_fail: 0.05 * k }));
    expect(drivesAt({ ...NETWORK, segments }, [], "A").map((d) => d.short)).toEqual([0, 0.1]);
  });

  it("show a forbidden one that the network no longer has", () => {
    const gone = { ...NETWORK, segments: NETWORK.segments.slice(1) };
    const rules: DriveRule[] = [{ from_target_id: null, to_target_id: "A", via_m: null }];
    expect(drivesAt(gone, rules, "A").map((d) => [d.other, d.state, d.length_m])).toEqual([
      ["B", "free", 10],
      [null, "forbidden", null],
    ]);
  });
});

describe("a way that is drawn", () => {
  it("has no corners where its ends were clicked", () => {
    expect(cornersOf([[0.2, 0.1], [2, 3], [4.1, -0.2]], [0, 0], [4, 0])).toEqual([[2, 3]]);
    expect(cornersOf([[2, 3]], [0, 0], [4, 0])).toEqual([[2, 3]]);
    expect(cornersOf([[0, 0], [4, 0]], [0, 0], [4, 0])).toEqual([]);
  });

  it("is drawn from stand to stand, a forbidden drive as a straight line", () => {
    const place = (target: string | null): [number, number] => (target === null ? [0, 0] : [4, 0]);
    const rules: DriveRule[] = [
      { from_target_id: null, to_target_id: "A", via_m: [[2, 3]] },
      { from_target_id: null, to_target_id: "B", via_m: null },
    ];
    expect(ruleLooks(rules, place)).toEqual([
      { path: [[0, 0], [2, 3], [4, 0]], forbidden: false },
      { path: [[0, 0], [4, 0]], forbidden: true },
    ]);
  });
});
