import { describe, expect, it } from "vitest";
import type { Plan, Run, Sol } from "../src/api/types";
import { solStates } from "../src/lib/sols";

const sol = (number: number) => ({ id: `sol-${number}`, number }) as Sol;
const plan = (id: string, sol_id: string, state: Plan["state"], planned = 3) =>
  ({ id, sol_id, state, expected_utility: 1, planned_request_ids: Array(planned).fill("r") }) as unknown as Plan;
const run = (plan_id: string, kind: Run["kind"], done: number) =>
  ({ plan_id, kind, achieved_request_ids: Array(done).fill("r") }) as unknown as Run;

describe("states of sols", () => {
  it("tells what was executed from what was rehearsed and planned", () => {
    const states = solStates(
      [sol(1), sol(2), sol(3)],
      [plan("a", "sol-1", "executed"), plan("b", "sol-1", "computed"), plan("c", "sol-2", "verified"), plan("d", "sol-2", "verified")],
      [run("a", "dry_run", 3), run("a", "execution", 2), run("c", "dry_run", 1)],
    );
    expect(states.map((s) => s.words)).toEqual(["2 of 3 done", "verified", "no plan yet"]);
    expect(states.map((s) => s.plan?.id)).toEqual(["a", "d", undefined]);
  });

  it("does not count a plan that is not computed", () => {
    const waiting = { ...plan("e", "sol-1", "draft"), expected_utility: null };
    expect(solStates([sol(1)], [waiting], [])[0]?.plan).toBeNull();
  });
});
