import { describe, expect, it } from "vitest";
import { editLines, memberWords, missionConflictWords, namedIn, rowName, valueWords } from "../src/lib/mission-versions";

const NAMES = {
  target: (id: string) => ({ "tgt-1": "Rock", "tgt-2": "Vein" })[id] ?? "a deleted target",
  request: (id: string) => ({ "req-1": "camera of Rock" })[id] ?? "a deleted request",
};

describe("a mission and its copy", () => {
  it("call resources and members as people do", () => {
    expect(rowName("observation_request", "science_camera of Rock")).toBe("request Science camera of Rock");
    expect(rowName("sol", "sol 1")).toBe("sol 1");
    expect(rowName("mission", "")).toBe("the mission");
    expect(memberWords("drive  tgt-2", NAMES)).toBe("drive from the start to Vein");
    expect(memberWords("drive tgt-1 tgt-2", NAMES)).toBe("drive from Rock to Vein");
    expect(memberWords("time_budget_s", NAMES)).toBe("time budget");
  });

  it("say values in units of people and without ids", () => {
    const told = (field: string, value: unknown): string => valueWords(field, JSON.stringify(value), NAMES);
    expect(told("place", { frame_id: null, east_m: 2.5, north_m: -1 })).toBe("E 2.500 N −1.000 m");
    expect(told("place", { frame_id: null, polygon_m: [[1, 2], [3, 4], [5, 6]] })).toBe("3 corners: (1.00, 2.00) (3.00, 4.00) (5.00, 6.00)");
    expect(told("window_s", [60, null])).toBe("0:01:00 to –");
    expect(told("energy_budget_j", 3600)).toBe("1.00 Wh");
    expect(told("after", ["req-1", "req-9"])).toBe("camera of Rock, a deleted request");
    expect(told("after", [])).toBe("nothing");
    expect(told("must_do", true)).toBe("yes");
    expect(told("drive tgt-1 tgt-2", { via_m: null })).toBe("forbidden");
    expect(valueWords("notes", "true", NAMES)).toBe("“true”");
    expect(valueWords("notes", "", NAMES)).toBe("not set");
    expect(valueWords("instrument", "science_camera", NAMES)).toBe("Science camera");
    expect(namedIn("tgt-1 of msn-1qm8gds67j72f", NAMES)).toBe("Rock of this one");
  });

  it("tell the edits of one side", () => {
    const edit = { side: "theirs", action: "changed", kind: "target", id: "tgt-1", name: "Rock", field: "notes", base: "", now: "red" };
    expect(editLines([edit, { ...edit, side: "ours" }, { ...edit, side: "both" }], "theirs", NAMES)).toEqual([
      { key: "0", action: "changed", row: "target Rock", field: "notes", before: "not set", after: "“red”" },
    ]);
  });

  it("tell what each side of a conflict stands for", () => {
    const conflict = { kind: "both-changed", resource: "target", id: "tgt-1", name: "Rock", field: "notes", base: "", ours: "a", theirs: "b", choosable: true };
    expect(missionConflictWords(conflict, NAMES)).toEqual({ what: "target Rock: notes", why: "both changed it", base: "not set", ours: "“a”", theirs: "“b”" });
    const removed = { ...conflict, kind: "removed-and-changed", field: "", ours: "removed", theirs: "notes, window_s changed" };
    expect(missionConflictWords(removed, NAMES)).toMatchObject({ what: "target Rock", ours: "removed", theirs: "notes, window changed" });
    const refers = { ...conflict, kind: "refers-to-removed", field: "target_id", ours: "target tgt-2 removed", theirs: "refers to Vein" };
    expect(missionConflictWords(refers, NAMES)).toMatchObject({ what: "target Rock: target", ours: "target Vein removed", theirs: "refers to Vein" });
    expect(missionConflictWords({ ...conflict, kind: "same-name", ours: "Rock is tgt-1" }, NAMES).ours).not.toContain("tgt-1");
  });
});
