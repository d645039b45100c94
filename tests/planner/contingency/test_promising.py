"""What a relaxation tells before a plan is made, and the lines that it leads to."""

from __future__ import annotations

from collections.abc import Iterable

import pytest

from planner.contingency.by_place.promising import promising
from planner.contingency.long_routes import long_routes, plan_long
from planner.contingency.sampled import beginnings
from planner.contingency.sampled.beginnings import best_beginnings
from planner.contingency.sampled.branches import Curve
from planner.contingency.sampled.futures import Growth
from planner.evaluate.model import Model
from planner.evaluate.monte_carlo import simulate
from planner.plan_tree import Navigate, Plan
from planner.problem import problem_from_dict
from planner.tally import tallied
from tests.planner.contingency.test_sampled_branches import _many
from tests.planner.examples import observation, problem_document

SECONDS = 2.0


def _with_one_far() -> Model:
    rows = [[observation(f"O{k}", "image", utility=4.0 + k)] for k in range(6)]
    places = [(4.0 * k - 10.0, 6.0 * (-1) ** k) for k in range(5)] + [(400.0, 0.0)]
    document = problem_document(places=places, observations=rows, spread=0.3, time_s=9000.0, energy_j=1e8)
    return Model.of(problem_from_dict(document))


def test_a_target_that_no_day_comes_to_does_not_matter() -> None:
    model = _with_one_far()
    with tallied():
        found = promising(model, limit_s=SECONDS)
    assert model.target_ids[5] not in found.targets
    assert len(found.targets) >= 3
    assert found.lines
    for line in found.lines:
        assert len(set(line)) == len(line)
        assert set(line) < set(model.observation_ids)


def test_it_tells_nothing_where_there_is_no_time() -> None:
    with tallied():
        found = promising(_with_one_far(), limit_s=1e-6)
    assert (found.targets, found.lines) == (frozenset(), ())


def test_the_best_polished_line_comes_first_and_no_two_drive_alike() -> None:
    problem = _many(14)
    model = Model.of(problem)
    plans = [route.plan for route in long_routes(problem, seed=1)]
    found = best_beginnings(model, [*plans, plans[0]], Growth(2, 1), lambda: False)
    worth = [simulate(model, plan, beginnings.FITTED, seed=1).utility.mean() for plan in found]
    assert worth == sorted(worth, reverse=True)
    assert worth[0] >= max(simulate(model, plan, beginnings.FITTED, seed=1).utility.mean() for plan in plans)
    drives = [tuple(step.to for step in plan if isinstance(step, Navigate)) for plan in found]
    assert len(set(drives)) == len(drives)
    assert len(best_beginnings(model, plans, Growth(2, 1), lambda: True)) == 1


def test_lines_that_the_relaxation_leads_to_are_raced(monkeypatch: pytest.MonkeyPatch) -> None:
    """The best of them is worth no less than the best route after the same polishing."""
    problem = _many(14)
    begun: list[tuple[Model, list[Plan]]] = []

    def race(model: Model, plans: Iterable[Plan], *_more: object, **_named: object) -> Curve:
        begun.append((model, list(plans)))
        return [(1.0, begun[-1][1][0])]

    monkeypatch.setattr("planner.contingency.long_routes.raced", race)
    with tallied():
        assert plan_long(problem, Growth(2, 1, lines=3), guide_s=SECONDS) is not None
    (model, guided), route = begun[0], long_routes(problem, seed=1)[0].plan
    assert len(guided) > 1
    polished = best_beginnings(model, [route], Growth(2, 1), lambda: False)[0]
    earned = [
        simulate(model, plan, beginnings.FITTED, seed=1).utility.mean() for plan in (guided[0], polished)
    ]
    assert earned[0] >= earned[1]
