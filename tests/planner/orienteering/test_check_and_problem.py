"""The checker rejects what breaks a rule, and a problem that makes no sense is refused."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from planner.errors import RoutingError, SolverError
from planner.orienteering import (
    Experiment,
    RoutingProblem,
    RoutingSolution,
    SideLimit,
    checked,
    route_value,
)

ROADS = np.array([[0, 10, 20], [10, 0, -1], [25, 12, 0]], dtype=np.int64)
PROBLEM = RoutingProblem(
    ROADS,
    np.abs(ROADS),
    (
        Experiment("a", 1, 5, duration=10, energy=3),
        Experiment("b", 1, 7, duration=5, energy=2, earliest_start=40, latest_end=60),
        Experiment("c", 2, 9, duration=10, energy=1, latest_end=35),
    ),
    time_budget=80,
    energy_budget=45,
    end_site=0,
    precedence=((0, 1),),
    limits=(SideLimit("kind", (1, 1, 1), 2),),
    base_prize=1,
)


def test_a_feasible_route_is_worth_its_prizes() -> None:
    assert route_value(PROBLEM, (0, 1)) == 13
    assert route_value(PROBLEM, ()) == 1


@pytest.mark.parametrize(
    ("route", "change", "message"),
    [
        ((0, 0), {}, "experiment a is done twice"),
        ((1,), {}, "b is done before"),
        ((0, 2), {}, "no road from site 1 to site 2"),
        ((2,), {"start_time": 6}, "c ends at 36, its latest end is 35"),
        ((0,), {"energy_used": 33}, "energy to 46, budget 45"),
        ((0,), {"energy_used": 23}, "uses energy 46, budget 45"),
        ((0, 1), {"time_budget": 54}, "ends at 55"),
        ((0,), {"time_budget": 29}, "route ends at 30"),
        ((0, 1), {"limits": (SideLimit("kind", (1, 1, 1), 1),)}, "brings kind to 2, limit 1"),
        ((0,), {"done": frozenset({0})}, "done twice"),
        ((7,), {}, "route holds 7"),
    ],
)
def test_the_checker_rejects(route: tuple[int, ...], change: dict[str, Any], message: str) -> None:
    with pytest.raises(RoutingError, match=message):
        route_value(replace(PROBLEM, **change), route)


def test_a_must_do_that_is_missing_is_rejected() -> None:
    experiments = (replace(PROBLEM.experiments[0], must_do=True), *PROBLEM.experiments[1:])
    with pytest.raises(RoutingError, match="experiment a must be done"):
        route_value(replace(PROBLEM, experiments=experiments), ())


@pytest.mark.parametrize(("value", "upper", "route"), [(99, None, (0,)), (6, 5, (0,)), (13, None, (1, 0))])
def test_an_engine_that_claims_what_is_not_so_is_caught(
    value: int, upper: int | None, route: tuple[int, ...]
) -> None:
    with pytest.raises(SolverError):
        checked(PROBLEM, RoutingSolution(value, upper, False, route, "test"))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"start_site": 3}, "start_site is 3; sites run from 0 to 2"),
        ({"end_site": -1}, "end_site is -1"),
        ({"time_budget": -1}, "time_budget is -1"),
        ({"travel_time": np.zeros((2, 3), dtype=np.int64)}, "square matrix"),
        ({"travel_time": np.zeros((3, 3))}, "integers are needed"),
        ({"travel_energy": -np.ones((3, 3), dtype=np.int64)}, "negative energy"),
        ({"precedence": ((0, 1), (1, 0))}, "circle"),
        ({"precedence": ((0, 5),)}, "does not name two"),
        ({"experiments": (Experiment("a", 9, 1),)}, "site 9"),
        ({"experiments": (Experiment("a", 1, -1),)}, "prize is -1"),
        ({"experiments": (Experiment("a", 1, 1), Experiment("a", 1, 1))}, "given twice"),
        ({"limits": (SideLimit("v", (1,), 2),)}, "needs 3 amounts"),
        ({"done": frozenset({4})}, "done holds 4"),
    ],
)
def test_a_problem_that_makes_no_sense_is_refused(change: dict[str, Any], message: str) -> None:
    if "experiments" in change:
        change = {"precedence": (), "limits": (), **change}
    with pytest.raises(RoutingError, match=message):
        replace(PROBLEM, **change)
