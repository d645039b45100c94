"""Several main lines grown side by side."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterable
from itertools import combinations
from types import SimpleNamespace
from typing import Any

import pytest

from planner.contingency.long_routes import long_routes, plan_long, varied_routes
from planner.contingency.sampled import raced_lines
from planner.contingency.sampled.branches import Curve, grow_branches
from planner.contingency.sampled.futures import Growth, Sampler
from planner.contingency.sampled.raced_lines import raced
from planner.evaluate.model import Model
from planner.evaluate.monte_carlo import Futures, simulate
from planner.plan_edits import exchanged
from planner.plan_tree import Branch, Comparison, Observe, Option, Plan, TimeCondition, count_branches
from planner.problem import ObservationId, TargetId
from tests.planner.contingency.test_sampled_branches import _many

LINES = {
    "first": [10.0, 11.0, 11.5, 11.6],
    "late": [9.0, 11.2, 12.0, 13.0],
    "poor": [8.0, 8.5, 8.6, 8.7],
    "replaced": [8.0, 11.3, 12.0, 13.0],
}
"""What each line is worth with 0, 1, 2 and 3 branches."""
THREE = ("first", "late", "poor")


class _Line:
    """A line whose values are known beforehand."""

    grown: list[tuple[str, int]]

    def __init__(
        self, _sampler: object, _endings: object, plan: Plan, told: Callable[..., None], **_: object
    ):
        assert isinstance(plan[0], Observe)
        self.name, self.begun, self.branches, self.ended = str(plan[0].observation), 0, 0, False
        self.plan, self.told = plan, told
        self.curve = [(LINES[self.name][0], _plan(self.name))]

    def best(self, branches: int) -> Plan:
        return _plan(self.name, min(branches, self.branches))

    def grow(self) -> None:
        if self.branches == len(LINES[self.name]) - 1:
            self.ended = True
            return
        if self.name == "replaced" and self.branches == 1 and (self.name, 0) not in self.grown:
            self.grown.append((self.name, 0))  # an ending that wins always replaces the rest: no branch more
            return
        self.branches += 1
        self.grown.append((self.name, self.branches))
        self.curve.append((LINES[self.name][self.branches], _plan(self.name, self.branches)))
        self.told(self.curve[-1][1], self.curve[-1][0])

    def finish(self) -> Curve:
        while not self.ended and self.branches < 3:
            self.grow()
        self.grown.append((self.name, -1))
        return self.curve


def _plan(name: str, branches: int = 0) -> Plan:
    return (Observe(ObservationId(name), TargetId(str(branches))),)


def _worth(_model: object, plan: Plan, _futures: int, *, seed: int) -> SimpleNamespace:
    step = plan[0]
    assert isinstance(step, Observe)
    value = LINES[str(step.observation)][int(step.target)]
    return SimpleNamespace(estimate=lambda: SimpleNamespace(mean=value))


@pytest.fixture
def grown(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, int]]:
    """Return which lines got which options, -1 for the last polish."""
    found: list[tuple[str, int]] = []
    monkeypatch.setattr(_Line, "grown", found, raising=False)
    monkeypatch.setattr(raced_lines, "Growing", _Line)
    monkeypatch.setattr(raced_lines, "simulate", _worth)
    return found


def test_the_line_that_gains_most_is_grown_to_its_end_and_the_others_are_given_up(
    grown: list[tuple[str, int]],
) -> None:
    told: list[float] = []
    model = Model.of(_many(3))
    curve = raced(
        model,
        map(_plan, THREE),
        Growth(3, 1),
        told=lambda _, value: told.append(value),
        kept=(3, 2, 1),
        tries=0,
    )
    assert grown == [
        ("first", 1), ("late", 1), ("poor", 1), ("late", 2), ("first", 2), ("late", 3), ("late", -1)
    ]  # fmt: skip
    assert [value for value, _ in curve] == [10.0, 11.2, 12.0, 13.0]
    assert told == sorted(told)


def test_where_time_is_short_the_first_line_is_grown_alone(grown: list[tuple[str, int]]) -> None:
    curve = raced(Model.of(_many(3)), map(_plan, THREE), Growth(3, 1), used=lambda: 0.9, kept=(3,), tries=0)
    assert {name for name, _ in grown} == {"first"}
    assert [value for value, _ in curve] == LINES["first"]


def test_time_that_ends_during_a_round_is_left_to_the_best_line(grown: list[tuple[str, int]]) -> None:
    curve = raced(
        Model.of(_many(3)),
        map(_plan, THREE),
        Growth(3, 1),
        used=lambda: 0.9 if grown else 0.1,
        kept=(3,),
        tries=0,
    )
    assert grown == [("first", 1), ("first", 2), ("first", 3), ("first", -1)]
    assert [value for value, _ in curve] == LINES["first"]


def test_a_line_whose_rest_is_replaced_is_still_grown_to_its_end(grown: list[tuple[str, int]]) -> None:
    lines = map(_plan, ("first", "replaced"))
    curve = raced(Model.of(_many(3)), lines, Growth(3, 1), kept=(2,), tries=0)
    assert [one for one in grown if one[0] == "replaced"] == [
        ("replaced", 1), ("replaced", 0), ("replaced", 2), ("replaced", 3), ("replaced", -1)
    ]  # fmt: skip
    assert [value for value, _ in curve] == [10.0, 11.3, 12.0, 13.0]


def test_a_race_of_two_lines_earns_what_the_better_one_does_alone() -> None:
    problem = _many(5)
    model = Model.of(problem)
    plans = [route.plan for route in long_routes(problem, seed=1)[:2]]
    limits = Growth(1, 1, iterations=10_000)
    alone = [grow_branches(model, plan, limits) for plan in plans]
    together = raced(model, plans, limits)
    for branches, (value, plan) in enumerate(together):
        assert count_branches(plan) <= branches
        assert value >= max(curve[min(branches, len(curve) - 1)][0] for curve in alone) - 1e-9


def test_options_grown_again_are_compared_in_futures_of_their_own(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    problem = _many(5)
    model = Model.of(problem)
    plan = long_routes(problem, seed=1)[0].plan
    fitted: list[int] = []
    compared: list[int] = []

    def samples(model: Model, limits: Growth, *rest: Any, **more: Any) -> Sampler:
        fitted.append(limits.seed)
        return Sampler(model, limits, *rest, **more)

    def simulates(model: Model, plan: Plan, futures: int, *, seed: int) -> Futures:
        compared.append(seed)
        return simulate(model, plan, futures, seed=seed)

    monkeypatch.setattr("planner.contingency.sampled.raced_lines.Sampler", samples)
    monkeypatch.setattr("planner.contingency.sampled.raced_lines.simulate", simulates)
    once = raced(model, [plan], Growth(3, 1), tries=0)
    curve = raced(model, [plan], Growth(3, 1), tries=3)
    assert len(set(fitted)) >= 4
    assert not set(fitted) & set(compared)
    worth = [simulate(model, best[-1][1], 100_000, seed=9).estimate().mean for best in (once, curve)]
    assert worth[1] >= worth[0] - 0.002 * abs(worth[0])
    assert all(count_branches(plan) <= k for k, (_, plan) in enumerate(curve))


def test_varied_routes_differ_and_are_the_same_every_time() -> None:
    problem = _many(14)
    found = [route.plan for route in varied_routes(problem, 4, seed=3)]
    assert len(found) > 1
    assert len(set(found)) == len(found)
    assert found == [route.plan for route in varied_routes(problem, 4, seed=3)]


def test_long_days_are_raced_from_their_routes_and_varied_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    begun: list[Plan] = []

    tried: list[int] = []

    def race(_: Model, beginnings: Iterable[Plan], *_more: object, tries: int, **_named: object) -> Curve:
        tried.append(tries)
        begun.extend(beginnings)
        return [(1.0, begun[0])]

    monkeypatch.setattr("planner.contingency.long_routes.raced", race)
    problem = _many(14)
    assert plan_long(problem, Growth(2, 1, lines=3)) is not None
    routes = [route.plan for route in long_routes(problem, seed=1)]
    assert begun[: len(routes)] == routes
    assert len(begun) > len(routes)
    begun.clear()
    assert plan_long(problem, Growth(2, 1)) is not None
    assert begun == routes[:1]
    assert tried == [raced_lines.TRIES, 0]  # under a chance constraint one growth leaves time for the next


def test_a_plan_is_grown_again_with_the_target_that_is_worth_more_than_one_of_its_own() -> None:
    problem = _many(5)
    model = Model.of(problem)
    route = long_routes(problem, seed=1)[0].plan
    exchanges = raced_lines._Exchanges(model, 7, lambda: False)

    def worth(plan: Plan) -> float:
        return float(simulate(model, plan, 1_024, seed=7).utility.mean())

    changed = (exchanged(model, route, one, other) for one, other in combinations(model.target_ids, 2))
    poor = next(plan for plan in changed if plan is not None and worth(plan) < worth(route))
    found = exchanges.best(poor)
    assert found is not None
    assert worth(found) >= worth(route)
    assert exchanges.best(poor) != found
    assert raced_lines._Exchanges(model, 7, lambda: True).best(poor) is None


def test_no_exchange_is_tried_that_is_far_behind() -> None:
    model = Model.of(_many(2))
    plan = long_routes(_many(2), seed=1)[0].plan
    exchanges = raced_lines._Exchanges(model, 7, lambda: False)
    found = exchanged(model, plan, *model.target_ids)
    assert found is not None
    lag = (
        1.0
        - simulate(model, found, 1_024, seed=7).utility.mean()
        / simulate(model, plan, 1_024, seed=7).utility.mean()
    )
    assert (exchanges.best(plan) is None) == (lag > raced_lines.FAR_BEHIND)


def test_no_more_options_are_taken_out_than_drawn_with_those_that_they_hold() -> None:
    draw = random.Random(3)
    stop = Option((TimeCondition(Comparison.GE, 9.0),), ())
    inner = Option((TimeCondition(Comparison.GE, 5.0),), (Branch((stop, stop)), *_plan("late")))
    plan: Plan = (Branch((inner,)), *_plan("first"), Branch((stop,)), *_plan("poor"), Branch((inner,)))
    assert count_branches(plan) == 7
    left = {count_branches(raced_lines._without_some(plan, draw)) for _ in range(60)}
    assert left == {7 - out for out in raced_lines.TAKEN_OUT}
    assert raced_lines._without_some((Branch((stop,)),), draw) == ()
    assert raced_lines._without_some(_plan("first"), draw) == _plan("first")
