"""The tree of a plan's CRL with how often a campaign came to each of its nodes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ground.campaigns.case import Case
from ground.campaigns.result import CampaignResult
from ground.campaigns.row import OUTCOMES
from ground.reports.plan_drawing import Box

if TYPE_CHECKING:
    from executive.crl import Plan


def frequency_tree(plan: Plan, result: CampaignResult) -> Box:
    """Return the plan as boxes: a branch ends one, its options begin others with the share that took them."""
    from executive.crl.nodes import Branch, Task, children

    shares = result.nodes

    def came(node: Any) -> float:
        return 1.0 - shares[node.id][3] if node.id in shares else 0.0

    def fill(node: Any, box: Box) -> Box:
        """Put a node into a box; return the box in which what follows belongs."""
        if isinstance(node, Task):
            box.lines.append(_line(node.id, shares.get(node.id)))
        elif isinstance(node, Branch):
            for option in node.options:
                taken = result.options.get(option.id, 0) / result.runs
                below = Box([], option.id, taken)
                box.options.append(below)
                fill(option.node, below)
        else:
            for child in children(node):
                if box.options:
                    rest = Box([], "afterwards", came(child))
                    box.options.append(rest)
                    box = rest
                fill(child, box)
        return box

    root = Box([], "", 1.0)
    fill(plan.node, root)
    for box in root.walk():
        if not box.lines:
            box.lines.append("choose" if box.options else "end")
        box.shade = box.probability
    return root


def conditions_of_options(plan: Plan) -> dict[str, str]:
    """Return what must hold for each option of a plan to be taken, as its CRL says it, by its id."""
    from executive.crl.nodes import Branch, walk_plan
    from executive.crl.printer import conditions_text

    branches = (node for node in walk_plan(plan) if isinstance(node, Branch))
    options = (option for branch in branches for option in branch.options)
    return {
        o.id: conditions_text(o.eligible_conditions) if o.eligible_conditions else "else" for o in options
    }


def _line(name: str, share: tuple[float, float, float, float] | None) -> str:
    if share is None:
        return name
    succeeded, failed, aborted, _ = share
    wrong = failed + aborted
    return f"{name}  {succeeded:.0%}" + (f", failed {wrong:.1%}" if wrong else "")


def names_in(case: Case) -> dict[str, list[str]]:
    """Return the names of a case that may follow each word of an event."""
    from executive.crl.nodes import Branch, walk_plan

    plan = case.plan()
    nodes = list(walk_plan(plan))
    return {
        "failed": [node.id for node in nodes],
        "lost": [str(t["id"]) for t in case.problem.get("targets", ())],
        "over": [budget.resource for budget in plan.budgets],
        "option": [option.id for node in nodes if isinstance(node, Branch) for option in node.options],
        "outcome": list(OUTCOMES),
    }
