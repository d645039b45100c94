import { describe, expect, it } from "vitest";
import type { PlanChange } from "../src/api/version-calls";
import { nodesOf } from "../src/lib/crl";
import { changeLines, commonBase, conflictWords, marksOf, partName, plainText } from "../src/lib/plan-versions";
import { linesOf } from "../src/lib/plan-tree";

const CRL = `(plan :id pln-1 :node (block :id root :metadata (step = "") :node-list (
  (task :id trackstart-tgt-1 :action trackstart :metadata (step = "0" target = tgt-1))
  (branch :id branch :metadata (step = "1") :options (
    (option :id option-1 :metadata (step = "1.0") :node (block :id plan-option-1 :metadata (step = "1.0") :node-list (
      (task :id observe-req-1 :action image :metadata (request = req-1 target = tgt-1 step = 1.0.0)))))
    (option :id go-on :node (block :id plan-go-on :metadata (step = "1") :node-list (
      (task :id observe-req-1-2 :action image :metadata (request = req-1 target = tgt-1 step = "2"))))))))))`;
const PARTS = new Map(nodesOf(CRL).map((node) => [node.id, node]));
const NAMES = {
  target: (id: string) => ({ "tgt-1": "North" })[id] ?? "a deleted target",
  request: (id: string) => ({ "req-1": "North · camera" })[id] ?? "a deleted request",
};
const LINES = linesOf({
  format: "plan-tree/2",
  plan: [
    { op: "track_start", target: "tgt-1" },
    { op: "branch", options: [{ id: "option-1", when: [], plan: [{ op: "observe", observation: "req-1" }] }] },
    { op: "observe", observation: "req-1" },
  ],
});
const change = (id: string, more: Partial<PlanChange> = {}): PlanChange => ({ deed: "changed", group: "steps", kind: "task", id, field: "retries", before: "", after: "2", ...more });

describe("versions of a plan", () => {
  it("call the parts of a plan by what they do and where, and tell two of one kind apart by their branch", () => {
    expect(partName("trackstart-tgt-1", PARTS, NAMES)).toBe("track North");
    expect(partName("observe-req-1", PARTS, NAMES)).toBe("observe North · camera, branch 1");
    expect(partName("observe-req-1-2", PARTS, NAMES)).toBe("observe North · camera");
    expect(partName("plan-option-1", PARTS, NAMES)).toBe("steps of branch 1");
    expect(partName("navigate-tgt-9", new Map(), NAMES)).toBe("navigate-a deleted target");
    expect(partName("", PARTS, NAMES)).toBe("the plan itself");
  });

  it("say texts with names in the place of ids", () => {
    expect(plainText("((database (:outcome trackstart-tgt-1 = succeeded)) (:range tgt-1 < 3))", PARTS, NAMES)).toBe(
      "((database (:outcome “track North” = succeeded)) (:range North < 3))",
    );
  });

  it("call what a plan says of itself the plan itself", () => {
    const kept = changeLines([change("", { kind: "plan", group: "resources", field: "metadata" })], PARTS, NAMES);
    expect(kept.map((line) => line.part)).toEqual(["the plan itself"]);
  });

  it("name where a moved part stood and stands", () => {
    const [line] = changeLines([change("trackstart-tgt-1", { deed: "moved", field: "", before: "root", after: "plan-option-1" })], PARTS, NAMES);
    expect(line).toMatchObject({ part: "track North", deed: "moved", before: "main line", after: "steps of branch 1" });
  });

  it("mark the steps and branches of the tree by the path that a node was made of", () => {
    const marks = marksOf(
      [
        change("trackstart-tgt-1"),
        change("observe-req-1", { deed: "added", field: "" }),
        change("observe-req-1", { field: "reward" }),
        change("option-1", { group: "branches", kind: "option", field: "utility" }),
        change("observe-req-1-2", { group: "words", field: "expectations" }),
        change("gone", { deed: "removed", field: "" }),
      ],
      PARTS,
      LINES,
    );
    expect([...marks.steps]).toEqual([["main/0", "changed"], ["option-1/0", "new"]]);
    expect([...marks.lines]).toEqual([["option-1", "changed"]]);
  });

  it("say a conflict in words, also where a side has set nothing", () => {
    const conflict = { kind: "both-changed", id: "trackstart-tgt-1", field: "start-conditions", base: "", ours: "(:range tgt-1 < 3)", theirs: "(:range tgt-1 < 5)", choosable: true };
    expect(conflictWords(conflict, PARTS, NAMES)).toMatchObject({
      part: "track North",
      field: "may begin if",
      kind: "both changed it",
      base: "not set",
      ours: "(:range North < 3)",
    });
  });

  it("find the plan that two are edits of", () => {
    const plans = [
      { id: "a", parent_id: null },
      { id: "b", parent_id: "a" },
      { id: "c", parent_id: "a" },
      { id: "d", parent_id: "b" },
      { id: "e", parent_id: null },
    ] as const;
    const [a, b, c, d, e] = plans;
    expect(commonBase(plans, d, c)?.id).toBe("a");
    expect(commonBase(plans, d, b)?.id).toBe("b");
    expect(commonBase(plans, d, null)?.id).toBe("b");
    expect(commonBase(plans, e, c)?.id).toBe("a");
    expect(commonBase(plans, a, e)).toBe(null);
  });
});
