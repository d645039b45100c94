"""What every planning strategy promises, and how strategies and options are found."""

from __future__ import annotations

import dataclasses
import math
from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path
from typing import Any

import pytest

from mission import plugins
from mission.errors import MissionError
from planner.errors import PlannerError
from planner.evaluate.grid import Grid
from planner.evaluate.model import Model
from planner.options import PlannerOptions, load_options
from planner.plan_result import Progress
from planner.plan_tree import count_branches
from planner.problem import Problem
from planner.progress import Watch
from planner.solve import PlanStatus, solve
from planner.strategies import STRATEGIES, Found, Task, strategy_named
from planner.tally import Tally
from tests.planner.examples import example, observation


def task(problem: Problem, *, branches: int = 2, stop: bool = False) -> tuple[Task, list[Progress]]:
    told: list[Progress] = []
    model, options = Model.of(problem), PlannerOptions()
    watch = Watch(1e-9 if stop else 60.0, Tally(1.0), told.append)
    grid = Grid(model, *options.quick_nodes)
    return Task(model, grid, branches, 30, (), False, options, watch), told


@pytest.fixture(params=STRATEGIES.names())
def strategy(request: pytest.FixtureRequest) -> Any:
    return strategy_named(request.param)


def limited() -> Problem:
    rows = [[observation(f"O{k + 1}", "image", 3.0 + k, data_mbit=10.0)] for k in range(3)]
    return example(observations=rows, overrun_penalty=5.0)


def test_plans_keep_to_the_number_of_branches_and_values_rise(strategy: Any) -> None:
    for branches in (0, 2):
        asked, told = task(limited(), branches=branches)
        found = strategy(asked)
        assert found.curve
        assert all(count_branches(plan) <= branches for _, plan in found.curve)
        values = [value for value, _ in found.curve]
        assert values == sorted(values)
        assert told
        assert told[-1].plan


def test_the_same_task_gives_the_same_plans(strategy: Any) -> None:
    first, second = (strategy(task(limited())[0]).curve for _ in range(2))
    assert first == second


def test_no_way_through_a_plan_exceeds_the_volume(strategy: Any) -> None:
    problem = limited()
    problem = dataclasses.replace(problem, budget=dataclasses.replace(problem.budget, data_mbit=20.0))
    asked, _ = task(problem)
    for _, plan in strategy(asked).curve:
        assert asked.model.admits_plan(plan)


def test_a_search_that_is_stopped_at_once_still_answers(strategy: Any) -> None:
    assert strategy(task(limited(), stop=True)[0]).curve


class NoPlan:
    def __call__(self, task: Task) -> Found:
        return Found([(0.0, ())])


no_plan = NoPlan()


def test_a_package_adds_a_strategy_and_one_that_fails_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    points = EntryPoints(
        [
            EntryPoint("none", "tests.planner.test_strategies:no_plan", "outcrop.strategies"),
            EntryPoint("broken", "no_such_package:search", "outcrop.strategies"),
            EntryPoint("odd", "math:pi", "outcrop.strategies"),
        ]
    )
    monkeypatch.setattr(plugins, "entry_points", lambda group: points.select(group=group))
    assert solve(example(), strategy="none", iterations=1).status is PlanStatus.EMPTY
    with pytest.raises(PlannerError, match=r'strategy "broken" \(no_such_package:search\) cannot be loaded'):
        solve(example(), strategy="broken")
    with pytest.raises(PlannerError, match=f'strategy "odd" is {math.pi}, which cannot be called'):
        solve(example(), strategy="odd")
    with pytest.raises(PlannerError, match="known are broken, none, odd, optimal, pico2005"):
        solve(example(), strategy="best")


# ------------------------------------------------------------------------------------- options


def test_options_come_from_a_file_and_change_the_work(tmp_path: Path) -> None:
    file = tmp_path / "options.toml"
    file.write_text("search_nodes = [13, 9]\nmain_lines = 1\n", encoding="utf-8")
    options = load_options(file)
    assert options == PlannerOptions(search_nodes=(13, 9), main_lines=1)
    fine = solve(example(), iterations=20, max_branches=1)
    coarse = solve(example(), iterations=20, max_branches=1, options=options)
    assert coarse.optimum_estimate != fine.optimum_estimate


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("search_nodes = [1, 9]", r"search_nodes\[0\] is 1; it must be at least 3"),
        ("bound_s = 0.0", "bound_s is 0.0; it must be more than 0"),
        ("bound = 1.0", "bound is not a known member"),
        ("bound_s = 'x'", 'bound_s must be a number, found "x"'),
        ("bound_s = 0.05", "hasty_bound_s is 0.06; it must be at most bound_s"),
        ("bound_s", "not TOML"),
    ],
)
def test_a_wrong_option_is_named_with_its_value_and_limit(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "options.toml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(PlannerError, match=message):
        load_options(file)


def test_an_options_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(PlannerError, match=r"no such\.toml: No such file"):
        load_options(tmp_path / "no such.toml")


def test_options_that_contradict_each_other_are_refused() -> None:
    with pytest.raises(MissionError, match="hasty_bound_s"):
        PlannerOptions(hasty_bound_s=9.0)
