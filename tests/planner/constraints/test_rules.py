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
from planner.contingency.reduction import mean_route_of, mean_routing
from planner.emit_crl import emit
from planner.errors import ProblemError
from planner.evaluate.model import Model
from planner.evaluate.monte_carlo import simulate
from planner.evaluate.propagate import Evaluator
from planner.explain import why_not
from planner.plan_tree import Navigate, Observe, OnFail, Plan, PlanTree, TrackStart, ways
from planner.problem import ObservationId, Problem, TargetId
from planner.solve import PlanStatus, solve
from tests.planner.constraints.own_rules import Early, Thawed, Unheard
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
        EntryPoint("watched", f"{OWN}:Watching", "outcrop.planner_constraints"),
        EntryPoint("dusk", f"{OWN}:Dusk", "outcrop.planner_constraints"),
    )
    yield
    rule_types.cache_clear()


def test_a_problem_states_only_what_it_holds() -> None:
    plain = example(observations=[[observation("A")], [observation("B")], [observation("C")]])
    assert {rule.name for rule in rules_of(plain)} == {"tracked", "after", "window"}
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


@pytest.mark.usefixtures("own")
def test_a_track_that_a_rule_of_a_package_asks_for_can_be_lost() -> None:
    watched = observation("A", utility=9.0, refs={"watched": "yes"})
    problem = example(observations=[[watched], [observation("B", "place")], [observation("C")]], loss=0.3)
    model = Model.of(problem)
    assert model.loss[0, 1, 1] == 0.3
    to_a: Plan = (
        TrackStart(TargetId("T1")),
        Navigate(TargetId("T1"), True, OnFail.SKIP),
        Observe(ObservationId("A"), TargetId("T1")),
    )
    assert simulate(model, to_a, 20_000, seed=1).utility.mean() < 9.0 * 0.75
    assert mean_routing(problem).experiments[0].prize == round(1000 * 9.0 * 0.7)
    text = canonical_text(emit(problem, PlanTree("watched", to_a)))
    (drive,) = re.findall(r"\(task :id navigate-T1.*?:action", text, re.DOTALL)
    assert "trackerstate T1" in drive, "the drive waits for its track as the plan says"


@pytest.mark.usefixtures("own")
@pytest.mark.parametrize("window", [[100.0, 5000.0], [-50.0, -10.0]])
def test_windows_that_exclude_each_other_are_not_planned_with(window: list[float]) -> None:
    never = observation("A", utility=90.0, window_s=window, refs={"dusk-s": "60"})
    problem = example(observations=[[never], [observation("B")], [observation("C")]])
    to_a: Plan = (Navigate(TargetId("T1"), False, OnFail.SKIP), Observe(ObservationId("A"), TargetId("T1")))
    model = Model.of(problem)
    assert simulate(model, to_a, 2000, seed=1).utility.max() == 0.0
    assert Evaluator(model).value(to_a).value == 0.0
    for strategy in ("optimal", "pico2005"):
        result = solve(problem, strategy=strategy, max_branches=0, iterations=20, quick=True)
        assert "A" not in {str(name) for way in ways(result.tree.plan) for name in way}
        assert result.upper <= 10.0 + 1e-6
    assert "A" not in mean_route_of(problem, 1.0)
    assert why_not(problem, result.tree.plan, "A").limit == "window"


@pytest.mark.usefixtures("own")
def test_a_constraint_without_a_rule_comes_to_others_and_these_again() -> None:
    """The rule "dusk" states nothing itself, so its constraint's own reduction counts."""
    found = stated(Request("R", "T", "mi", 1.0, (Early(),)), Sky(), 9000.0)
    assert found.windows() == ((0.0, 3600.0),)
    assert found.tracked
    with pytest.raises(MissionError, match='R: constraint "unheard" comes to no window and to no constraint'):
        stated(Request("R", "T", "mi", 1.0, (Unheard(),)), Sky(), 9000.0)


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
