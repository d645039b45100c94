"""Plans where the kind of sol is hidden: proposed for kinds that are known, judged in futures that draw one.

The policy of a table knows its amounts, so it cannot learn. One is made for the amounts of each kind, and one
for their mean and deviation over the kinds; each proposes plans, with the branches that it would take. All
are carried out in common futures, each of which draws its kind of sol. The best are polished and branched
there (`sampled.branches`). A slow sol is slow in all its drives, so the futures that come late to a point are
mostly those of slow sols: by their shares in time and energy, the conditions fitted to them are on the odds
of each kind given the progress so far (Bayes), without a state for them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Set

from planner.contingency.order_in_futures import MOST_ENUMERATED, Order, best_routes, line_of
from planner.contingency.sampled.branches import Curve, better_by_branches, grow_branches
from planner.contingency.sampled.futures import FITTED, Growth
from planner.contingency.seeding import mean_seed
from planner.evaluate.model import Model
from planner.evaluate.monte_carlo import simulate
from planner.plan_edits import without_unused_tracks
from planner.plan_tree import Plan, count_branches
from planner.progress import Watch

Ask = Callable[[Model, Watch], tuple[Curve, float]]
"""A search for a model of one kind of sol, within the limit of a watch of its own: plans by number of
branches, and the share of the search that was done."""

Propose = Callable[[Model], Curve]
"""Plans for a model of one kind of sol, by number of branches."""

PROPOSING_SHARE, GROWING_SHARE = 0.4, 0.7
"""Shares of the limit for plans proposed for known kinds of sols, together, and up to which plans are then
polished and branched in common futures. By hand."""

MOST_ORDERED = 8
"""Observations up to which the order of the main line is searched in futures. By hand: with eight a round of
some 120 changes takes a second."""


def searched_in_hidden_sol(
    model: Model, ask: Ask, growth: Growth, watch: Watch, *, share: float = 1.0, hasty: bool = False
) -> tuple[Curve, float]:
    """Return the plans found by number of branches, with a share of the limit of a watch, and what was done.

    The strategy is asked about each kind of sol, and about the means and deviations over the kinds.
    """
    limit_s, done = share * watch.limit_s, [1.0]
    until_s = min(GROWING_SHARE * watch.limit_s, watch.work_s() + GROWING_SHARE * limit_s)

    def propose(known: Model) -> Curve:
        each_s = PROPOSING_SHARE * limit_s / (1 + len(model.sols.chance))
        found, share_done = ask(
            known, Watch(each_s, watch.tally, lambda _: None, begun_s=watch.tally.seconds)
        )
        done.append(share_done)
        return found

    curve = plans_in_hidden_sol(
        model,
        propose,
        growth,
        hasty=hasty,
        should_stop=lambda: watch.work_s() > until_s,
        told=watch.told,
    )
    return curve, min(done)


def plans_in_hidden_sol(
    model: Model,
    propose: Propose,
    growth: Growth,
    *,
    hasty: bool = False,
    should_stop: Callable[[], bool],
    told: Callable[[Plan, float], None],
) -> Curve:
    """Return the best plans found with at most 0, 1, 2, ... branches, with their means in common futures.

    Plans whose main line lacks what must be done are left out. Empty if no plan is proposed. A `hasty` search
    takes what is proposed for the means and deviations over the kinds: enough to try a multiplier.
    """
    must = {str(model.observation_ids[m]) for m in range(model.m) if model.must_do[m]}
    proposed: dict[Plan, None] = {}
    told_kinds = () if hasty else model.by_kind
    for known in (model.mixed(), *(known for _, known in told_kinds)):
        if proposed and should_stop():
            break
        proposed.update((plan, None) for _, plan in propose(known) if plan)
    values = _valued(model, proposed, must, growth.seed)
    if not values:
        return []
    best = max(values, key=lambda plan: values[plan])
    told(best, values[best])
    if hasty:
        return _by_branches(values, growth.max_branches)
    if not must and (model.m <= MOST_ENUMERATED or (model.m <= MOST_ORDERED and not should_stop())):
        values |= _valued(model, _ordered(model, values, growth.seed, should_stop), must, growth.seed)
    lines = [plan for plan in values if not count_branches(plan)]
    line = max(lines, key=lambda plan: values[plan], default=best)
    curves = [_by_branches(values, growth.max_branches)]
    for start in dict.fromkeys((line, best)):
        if not growth.max_branches or should_stop():
            break
        grown = grow_branches(model, start, growth, should_stop=should_stop)
        kept = _valued(model, [plan for _, plan in grown], must, growth.seed)
        curves.append(_by_branches(kept, growth.max_branches))
    curve = better_by_branches(*curves)
    if curve and curve[-1][0] > values[best]:
        told(curve[-1][1], curve[-1][0])
    return curve


def _valued(model: Model, plans: Iterable[Plan], must: Set[str], seed: int) -> dict[Plan, float]:
    """Return the plans whose main line does what must be done, with their means in common futures."""
    found: dict[Plan, float] = {}
    for plan in plans:
        if plan and must <= {str(o) for o in line_of(plan)} and model.admits_plan(plan):
            found[plan] = float(simulate(model, plan, FITTED, seed=seed).utility.mean())
    return found


def _ordered(model: Model, plans: Iterable[Plan], seed: int, should_stop: Callable[[], bool]) -> list[Plan]:
    """Return plans that follow the best orders found in futures.

    The search begins from the main lines of plans and from the routes on mean values of each kind.
    """
    lines: list[Order] = [tuple(model.number_of[name] for name in dict.fromkeys(line_of(p))) for p in plans]
    lines += [mean_seed(known) for known in (model, *(known for _, known in model.by_kind))]
    routes = best_routes(model, lines, seed=seed, should_stop=should_stop)
    return [without_unused_tracks(model, plan) for plan in routes]


def _by_branches(values: dict[Plan, float], most: int) -> Curve:
    """Return the best of some plans with at most 0, 1, ..., `most` branches; empty without one."""
    curve: Curve = []
    for count in range(most + 1):
        within = [plan for plan in values if count_branches(plan) <= count]
        best = max(within, key=lambda plan: values[plan], default=())
        curve.append((values.get(best, 0.0), best))
    return curve if values else []
