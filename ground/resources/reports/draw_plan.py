"""Draw the tree of a plan."""

from __future__ import annotations

from ground.gdr.repository import Repository
from ground.records.actor import Actor
from ground.reports.plan_drawing import boxes, target_names, to_dot, to_svg
from ground.resources.plans.read_plan import computed_plan, tree_of
from ground.resources.problems.row import ProblemRow


def draw_plan(repo: Repository, actor: Actor, plan_id: str, *, form: str) -> str:
    """Return the tree of a computed plan as `svg` or `dot`."""
    with repo.database.read() as session:
        plan = computed_plan(session, actor, plan_id)
        row = session.get_one(ProblemRow, plan.problem_id) if plan.problem_id else None
        root = boxes(tree_of(plan), {} if row is None else target_names(row.document))
    return to_dot(root) if form == "dot" else to_svg(root)
