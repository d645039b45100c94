/** What became of each sol: the plan that counts for it, its execution, and what was asked and done. */

import type { Plan, Run, Sol } from "../api/types";

const ORDER = ["draft", "computed", "verified", "approved", "uplinked", "executed"];

export interface SolState {
  sol: Sol;
  /** The plan that is nearest to the rover; of equals the newest. */
  plan: Plan | null;
  execution: Run | null;
  /** Requests in that plan, and those of them that the execution answered. */
  asked: number;
  done: number;
  /** In a few words. */
  words: string;
}

/** Whether a run executed a package: on a rover, or on the mission's training rover. */
export const isExecution = (run: Run): boolean => run.kind === "execution" || run.kind === "training";

export function solStates(sols: readonly Sol[], plans: readonly Plan[], runs: readonly Run[]): SolState[] {
  return sols.map((sol) => {
    const own = plans.filter((plan) => plan.sol_id === sol.id && plan.expected_utility !== null);
    const plan = own.reduce<Plan | null>(
      (best, one) => (best === null || ORDER.indexOf(one.state) >= ORDER.indexOf(best.state) ? one : best),
      null,
    );
    const execution = runs.findLast((run) => isExecution(run) && run.plan_id === plan?.id) ?? null;
    const asked = plan?.planned_request_ids.length ?? 0;
    const done = execution?.achieved_request_ids.length ?? 0;
    const words = execution !== null ? `${done} of ${asked} done` : plan === null ? "no plan yet" : plan.state;
    return { sol, plan, execution, asked, done, words };
  });
}
