"""The table of a policy along an order against carrying it out, and against itself on fewer places."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from planner.evaluate.model import Ints
from planner.problem import Amount
from planner.sols.order_kernels import mean_starts
from planner.sols.order_policy import AHEAD, OrderPolicies
from planner.sols.order_search import days_of, needs_of
from planner.sols.path_problem import PathProblem, path_problem
from planner.sols.policy_kernels import policy_along
from tests.planner.sols.test_sol_path import constant

NODES = (41, 49)


def spread(seed: int) -> PathProblem:
    """Return a problem of six targets whose amounts scatter by a quarter."""
    problem, series = constant(np.random.default_rng(seed), 6)

    def wide(amount: Amount) -> Amount:
        return dataclasses.replace(amount, sd=0.25 * amount.mean)

    targets = tuple(
        dataclasses.replace(
            t,
            observations=tuple(
                dataclasses.replace(o, time_s=wide(o.time_s), energy_j=wide(o.energy_j))
                for o in t.observations
            ),
        )
        for t in problem.targets
    )
    legs = tuple(
        dataclasses.replace(leg, time_s=wide(leg.time_s), energy_j=wide(leg.energy_j)) for leg in problem.legs
    )
    return path_problem(dataclasses.replace(problem, targets=targets, legs=legs), series)


def value_between(policies: OrderPolicies, order: Ints, low: Ints, high: Ints) -> float:
    shape = (policies.path.sols, len(order) + 1, *policies.nodes)
    value, _ = policy_along(
        policies.table_nodes, policies.rows, policies.needs, order, len(order), low, high, AHEAD,
        policies.path.model.penalty, np.zeros(shape, np.int8), np.zeros(shape, np.int8),
    )  # fmt: skip
    return float(value)


@pytest.mark.parametrize("seed", range(4))
def test_a_table_says_what_its_policy_earns(seed: int) -> None:
    path = spread(seed)
    days, needs = days_of(path), needs_of(path, seed=1, futures=4)
    policies = OrderPolicies(path, needs, NODES)
    found = policies.best(np.random.default_rng(seed).permutation(path.model.m))
    told = policies.carry_out(found.table, days, needs, seed=2, futures=20_000)
    earned = told.utility.sum(axis=1)
    assert earned.mean() > 0.0
    assert found.value == pytest.approx(earned.mean(), rel=0.03)


@pytest.mark.parametrize("seed", range(4))
def test_places_left_out_of_a_table_earn_nothing(seed: int) -> None:
    path = spread(seed)
    needs = needs_of(path, seed=1, futures=4)
    policies, order = OrderPolicies(path, needs, NODES), np.arange(path.model.m)
    low, high = np.zeros(path.sols, np.int64), np.full(path.sols, path.model.m)
    whole = value_between(policies, order, low, high)
    assert whole == pytest.approx(policies.best(order).value)
    for margin in (0, 1, 2):
        part = value_between(policies, order, *mean_starts(days_of(path), needs, order, len(order), margin))
        assert part <= whole + 1e-9
    high[:] = 0
    assert value_between(policies, order, low, high) == 0.0
