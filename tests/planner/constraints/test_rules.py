"""Constraints as rules of the planning problem: what they come to, and those of packages."""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Iterator
from importlib.metadata import EntryPoint, EntryPoints

import pytest

from executive.crl import canonical_text
from mission import MissionError, MustDo, Request, Sky, SunElevation, Tracked, Window, plugins
from mission.constraints import constraint_kinds
from planner.constraints.registry import BUILT_IN, rule_types, rules_of, stated
from planner.emit_crl import emit
from planner.errors import ProblemError
from planner.evaluate.model import Model
from planner.evaluate.monte_carlo import simulate
from planner.explain import why_not
from planner.plan_tree import Navigate, Observe, OnFail, Plan, ways
from planner.problem import ObservationId, Problem, TargetId
from planner.solve import PlanStatus, solve
from tests.planner.constraints.own_rules import Thawed
from tests.planner.examples import example, observation
from tests.shared import ROOT

OWN = "tests.planner.constraints.own_rules"


def _announce(monkeypatch: pytest.MonkeyPatch, *points: EntryPoint) -> None:
    found = EntryPoints(points)
    monkeypatch.setattr(plugins, "entry_points", lambda group: found.select(group=group))
    rule_types.cache_clear()
    constraint_kinds.cache_clear()


@pytest.fixture
def own(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    _announce(
        monkeypatch,
        EntryPoint("thawed", f"{OWN}:Thawing", "outcrop.planner_constraints"),
        EntryPoint("one_sample", f"{OWN}:OneSample", "outcrop.planner_constraints"),
    )
    yield
    rule_types.cache_clear()


def test_a_problem_states_only_what_it_holds() -> None:
    plain = example(observations=[[observation("A")], [observation("B")], [observation("C")]])
    assert {rule.name for rule in rules_of(plain)} == {"tracked", "after", "window", "overrun"}
    full = example(
        observations=[
            [observation("A", "place", must_do=True, window_s=[0, 900])],
            [observation("B", data_mbit=3.0)],
            [observation("C")],
        ],
        precedence=[["A", "B"]],
        max_overrun_probability=0.05,
        budget={"time_s": 6000.0, "energy_j": 6e5, "data_mbit": 2.0},
    )
    assert [rule.name for rule in rules_of(full)] == [kind.name for kind in BUILT_IN]


def test_the_day_of_a_request_is_what_all_its_constraints_leave() -> None:
    sky = Sky(start_lmst_h=6.0)
    (sun,) = SunElevation(math.radians(20)).reduced(sky, 40_000.0)
    assert isinstance(sun, Window)
    request = Request(
        "R",
        "T",
        "mi",
        1.0,
        (
            Tracked(),
            MustDo(),
            Window(0.0, 10_000.0),
            Window(30_000.0, 39_000.0),
            SunElevation(math.radians(20)),
        ),
    )
    found = stated(request, sky, 40_000.0)
    assert found.windows() == (
        (sun.opens_s, 10_000.0),
        (30_000.0, min(39_000.0, sun.closes_s)),
    )
    assert found.tracked
    assert found.must_do
    assert stated(Request("R", "T", "mi", 1.0, (Tracked(),)), sky, 1.0).windows() is None


def test_a_request_that_can_be_made_at_no_time_says_so() -> None:
    night = Request("R7", "T", "mi", 1.0, (SunElevation(math.radians(85)),))
    with pytest.raises(
        MissionError, match=r"observation request R7: the sun stands at 85 to 90 degrees at no"
    ):
        stated(night, Sky(latitude_deg=50.0), 88_775.0)
    apart = Request("R8", "T", "mi", 1.0, (Window(0.0, 60.0), SunElevation(math.radians(20))))
    with pytest.raises(MissionError, match="R8: its time constraints leave no time in common"):
        stated(apart, Sky(start_lmst_h=5.0), 88_775.0)


def _samples() -> Problem:
    sample = {"refs": {"sample": "yes"}}
    return example(
        observations=[
            [observation("A", utility=9.0, **sample)],
            [observation("B", utility=8.0, **sample)],
            [observation("C", refs={"thawed-s": "3000"})],
        ]
    )


@pytest.mark.usefixtures("own")
def test_a_rule_of_a_package_narrows_what_every_part_reads() -> None:
    problem = _samples()
    model = Model.of(problem)
    assert model.window[2].tolist() == [3000.0, math.inf]
    to_c: Plan = (Navigate(TargetId("T3"), False, OnFail.SKIP), Observe(ObservationId("C"), TargetId("T3")))
    assert simulate(model, to_c, 2000, seed=1).time_s.min() > 3000.0
    result = solve(problem, max_branches=1, iterations=20, quick=True)
    assert "C" in {str(name) for way in ways(result.tree.plan) for name in way}
    text = canonical_text(emit(problem, result.tree))
    assert re.search(r"\(block :id window-C [^)]*3000", text), "CRL waits for the thaw"


@pytest.mark.usefixtures("own")
@pytest.mark.parametrize("strategy", ["optimal", "pico2005"])
def test_no_way_through_a_plan_breaks_a_limit_of_a_package(strategy: str) -> None:
    result = solve(_samples(), strategy=strategy, max_branches=1, iterations=20, quick=True)
    assert result.status is PlanStatus.PLANNED
    made = [set(map(str, way)) for way in ways(result.tree.plan)]
    assert all(not {"A", "B"} <= way for way in made)
    assert any({"A", "B"} & way for way in made)
    assert result.expected_utility <= result.upper


@pytest.mark.usefixtures("own")
def test_a_constraint_of_a_package_travels_from_the_request_to_the_reason() -> None:
    request = Request("R", "T", "mi", 1.0, (Thawed(7000.0), Window(0.0, 9000.0)))
    terms = stated(request, Sky(), 9000.0)
    assert (terms.refs, terms.windows()) == ({"thawed-s": "7000"}, ((0.0, 9000.0),))
    frozen = observation("C", instrument="mi", refs=terms.refs)
    problem = example(observations=[[observation("A")], [observation("B")], [frozen]])
    told = why_not(problem, solve(problem, max_branches=0, iterations=5, quick=True).tree.plan, "C")
    assert (told.limit, told.reason) == ("thaw", "mi is frozen until 7000 s")


def test_a_rule_that_cannot_be_loaded_is_an_error_not_a_plan(monkeypatch: pytest.MonkeyPatch) -> None:
    for place, message in (("no_such:Rule", "cannot be loaded"), ("json:loads", "a class of planner Rule")):
        _announce(monkeypatch, EntryPoint("odd", place, "outcrop.planner_constraints"))
        with pytest.raises(ProblemError, match=message):
            Model.of(example())
    monkeypatch.undo()
    rule_types.cache_clear()


def test_the_constraint_of_the_example_package_is_planned_with(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(ROOT / "examples/acme_rover")
    _announce(
        monkeypatch,
        EntryPoint("panel_warm", "acme_rover.constraint:PanelWarm", "outcrop.constraints"),
        EntryPoint("panel_warm", "acme_rover.planning:WarmPanels", "outcrop.planner_constraints"),
    )
    from acme_rover.constraint import PanelWarm

    sky, sunrise_s = Sky(start_lmst_h=4.0), 0.0
    clock = sky.clock()
    while clock.elevation_rad(sunrise_s) < 0.0:
        sunrise_s += 60.0
    request = Request("R", "T", "mi", 1.0, (PanelWarm(7200.0),))
    terms = stated(request, sky, 40_000.0)
    ((opens_s, closes_s),) = terms.windows() or ()
    assert opens_s == pytest.approx(sunrise_s + 7200.0, abs=120.0)
    late = observation("C", window_s=[opens_s, closes_s], refs=terms.refs)
    problem = example(observations=[[observation("A")], [observation("B")], [late]], time_s=6000.0)
    told = why_not(problem, solve(problem, max_branches=0, iterations=5, quick=True).tree.plan, "C")
    assert told.limit == "panels"
    assert "the panels are warm" in told.reason
    monkeypatch.undo()
    rule_types.cache_clear()
    constraint_kinds.cache_clear()
    for name in [name for name in sys.modules if name.startswith("acme_rover")]:
        del sys.modules[name]
