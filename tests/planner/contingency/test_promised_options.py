"""Options put in by what the optimal policy would earn after them."""

from __future__ import annotations

import numpy as np

from planner.contingency.policy import Moves, Policy
from planner.contingency.sampled.futures import Growth
from planner.contingency.sampled.promised_options import LEAST, Promises
from planner.contingency.sampled.raced_lines import raced
from planner.contingency.seeding import mean_seed, route_plan
from planner.contingency.valued_plan import ValuedPlan
from planner.evaluate.grid import Grid, Rounding
from planner.evaluate.model import Model
from planner.evaluate.monte_carlo import simulate
from planner.plan_tree import Plan, count_branches
from studies.common.planner_days import day


def _policy(seed: int) -> Policy:
    model = Model.of(day(np.random.default_rng(seed), least=5, most=5))
    return Policy(Grid(model, 33, 21, Rounding.MID, np.float32), moves=Moves.ALL)


def _route(policy: Policy) -> Plan:
    return route_plan(policy.model, mean_seed(policy.model))


def test_each_promised_plan_has_an_option_more_or_another_rest_and_is_given_once() -> None:
    policy = _policy(27)
    plan, promises = _route(policy), Promises(policy, lambda: False)
    given: list[Plan] = []
    while (made := promises.next(plan)) is not None:
        assert policy.model.admits_plan(made)
        assert count_branches(made) <= 1
        given.append(made)
    assert len(set(given)) > 3
    assert plan not in given
    assert promises.next(plan) is None
    other = given[0]
    assert promises.next(other) is not None  # of another plan


def test_no_option_promises_more_than_the_policy_earns_there() -> None:
    policy = _policy(27)
    promises = Promises(policy, lambda: False)
    plan = ValuedPlan(promises.fitter.tails, _route(policy))
    found = list(promises._promises(plan))
    assert found
    for promise in found:
        assert LEAST * plan.value < promise.gain <= promise.point.regret * 1.02


def test_the_policy_that_ends_early_promises_much_of_ending() -> None:
    """A plan that goes on whatever the time is pays for overruns, which the policy avoids."""
    policy = _policy(27)
    promises = Promises(policy, lambda: False)
    plan = _route(policy)
    alone = ValuedPlan(promises.fitter.tails, plan).value
    best = max(
        ValuedPlan(promises.fitter.tails, made).value for made in iter(lambda: promises.next(plan), None)
    )
    assert best > alone  # the first option of a plan needs no others to win


def test_nothing_is_promised_when_time_is_over() -> None:
    policy = _policy(27)
    assert Promises(policy, lambda: True).next(_route(policy)) is None


def test_what_is_grown_on_promises_earns_no_less() -> None:
    policy = _policy(27)
    model, plan, limits = policy.model, _route(policy), Growth(2, 1)
    without = raced(model, [plan], limits, tries=0)
    curve = raced(model, [plan], limits, tries=2, promises=Promises(policy, lambda: False))
    assert all(count_branches(plan) <= most for most, (_, plan) in enumerate(curve))
    worth = [simulate(model, one[-1][1], 200_000, seed=9).estimate().mean for one in (without, curve)]
    assert worth[1] >= worth[0] - 0.001 * abs(worth[0])
