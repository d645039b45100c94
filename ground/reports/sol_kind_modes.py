"""What hidden kinds of sols cost a plan, for the list of what may go wrong with it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ground.reports.failure_modes import FailureMode

if TYPE_CHECKING:
    from planner.plan_tree_document import TreeDocument
    from planner.problem_document import ProblemDocument

FUTURES, SEED = 20_000, 1
"""For each kind: a standard error of 1/141 of the standard deviation of a day."""


def sol_kind_modes(tree: TreeDocument, problem: ProblemDocument) -> list[FailureMode]:
    """Return a mode for each kind of sol on which a plan earns less than on an ordinary one.

    At stake is the difference of the means, on the draws that both share. Where no sol is ordinary, the
    likeliest kind stands for it.
    """
    if not problem.get("sol_kinds"):
        return []
    from planner.contingency.reduction import held_by
    from planner.evaluate.model import Model
    from planner.evaluate.monte_carlo import simulate
    from planner.plan_tree import plan_tree_from_dict
    from planner.problem import problem_from_dict
    from planner.sol_kind import ORDINARY_NAME, all_kinds

    read = problem_from_dict(problem)
    plan = plan_tree_from_dict(tree, read).plan
    kinds = all_kinds(read.sol_kinds)
    earned = [
        float(simulate(known, plan, FUTURES, seed=SEED).utility.mean())
        for _, known in Model.of(held_by(read, plan)).by_kind
    ]
    usual = max(range(len(kinds)), key=lambda k: (kinds[k].name == ORDINARY_NAME, kinds[k].p))
    return [
        FailureMode(f"the sol is {kind.name}", kind.p, earned[usual] - value)
        for kind, value in zip(kinds, earned, strict=True)
        if value < earned[usual] - 1e-9
    ]
