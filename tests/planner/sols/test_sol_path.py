"""Sol paths against every choice tried, and what they refuse."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from mission.errors import MissionError
from mission.sol_timeline import SOL_SERIES, Battery, PowerSegment, SolSeries, SolTimeline, SolWindow, rest_of
from planner.errors import ProblemError
from planner.plan_result import Progress
from planner.problem import Kind, Problem, problem_from_dict
from planner.sols import path_bound as bounds
from planner.sols.chains import Along
from planner.sols.flow_program import FlowProgram
from planner.sols.path_bound import path_bound
from planner.sols.path_problem import path_problem, same_budgets
from planner.sols.solve_path import SolPath, solve_sols
from studies.common.sol_paths import several_sols
from tests.planner.examples import amount, example, observation, problem_document
from tests.planner.sols.reference import after_rest, best_of_all, survives


def constant(rng: np.random.Generator, targets: int = 4) -> tuple[Problem, SolSeries]:
    """Return a small problem of constant amounts over two or three sols that nights make tight."""
    rows = []
    for k in range(targets):
        row = observation(
            f"O{k + 1}", "image", float(rng.integers(1, 10)), p_success=float(rng.uniform(0.5, 1.0))
        )
        row["observe"] = {"time_s": amount(float(rng.uniform(100, 900))), "energy_j": amount(9000.0)}
        if rng.random() < 0.4:
            opens = float(rng.uniform(0.0, 2000.0))
            row["window_s"] = [opens, opens + 1500.0]
        rows.append([row])
    places = [(float(x), float(y)) for x, y in rng.uniform(-7.0, 7.0, (targets, 2))]
    problem = example(places=places, observations=rows, spread=0.0, loss=0.0, overrun_penalty=2.0)
    legs = tuple(
        dataclasses.replace(leg, energy_j=dataclasses.replace(leg.energy_j, sd=0.0)) for leg in problem.legs
    )
    night = PowerSegment(40_000.0, sleep_w=2.0, heater_w=3.0)
    sols = tuple(
        SolTimeline(
            float(rng.uniform(1500.0, 4000.0)),
            (PowerSegment(10_000.0, float(rng.uniform(22.0, 55.0))), night),
        )
        for _ in range(int(rng.integers(2, 4)))
    )
    windows = (SolWindow("O1", len(sols)),) if rng.random() < 0.3 else ()
    series = SolSeries(Battery(700_000.0, float(rng.uniform(400_000, 700_000)), 50_000.0), sols, windows)
    return dataclasses.replace(problem, legs=legs), series


@pytest.mark.parametrize("seed", range(3))
def test_the_bound_holds_and_the_policy_earns_what_is_possible(seed: int) -> None:
    problem, series = constant(np.random.default_rng(seed))
    best = best_of_all(problem, series)
    found = solve_sols(problem, series, time_limit_s=0.1)
    assert found.upper >= best - 1e-6
    assert found.mean <= best + 1e-6
    assert found.mean >= 0.8 * best
    assert sum(sol.utility for sol in found.outline) == pytest.approx(found.mean)


def test_bounds_of_many_small_problems_hold() -> None:
    rng = np.random.default_rng(77)
    for _ in range(40):
        problem, series = constant(rng, 3)
        best = best_of_all(problem, series)
        assert path_bound(path_problem(problem, series), limit_s=5.0).value >= best - 1e-6


@pytest.mark.parametrize("along", list(Along))
def test_bounds_of_chains_that_see_time_or_charge_hold(along: Along, monkeypatch: pytest.MonkeyPatch) -> None:
    """The flow's own bound is taken away, so that only the best chain is left."""
    monkeypatch.setattr(bounds, "_scarce", lambda *_: along)
    rng, alone = np.random.default_rng(79), 0
    for _ in range(25):
        problem, series = constant(rng, 3)
        path = path_problem(problem, series)
        best, whole = best_of_all(problem, series), path_bound(path, limit_s=0.0).value
        flow = FlowProgram(path)
        answer = flow.solve(60.0)
        value = bounds._chain_bound(flow, -answer.ineqlin.marginals, whole, 60.0)
        assert value >= best - 1e-6
        alone += value < whole - 1e-6
    assert alone >= 5


def test_a_chain_sees_what_the_flow_does_not() -> None:
    """Two rocks far apart and time for either: half of both is what a flow does, and no chain can."""
    rows = [[observation("O1", utility=6.0)], [observation("O2", utility=6.0)]]
    document = problem_document(
        places=[(6.0, 0.0), (-6.0, 0.0)], observations=rows, spread=0.0, loss=0.0, time_s=2500.0, energy_j=2e7
    )
    problem = problem_from_dict(document)
    path = path_problem(problem, same_budgets(problem, 1))
    assert path_bound(path, limit_s=60.0).value == pytest.approx(6.0 * path.model.p_success[0], rel=0.02)


def test_no_policy_earns_more_than_the_bound_where_amounts_are_drawn() -> None:
    rng = np.random.default_rng(80)
    for _ in range(3):
        problem, series = several_sols(rng, targets=5, sols=2)
        battery = dataclasses.replace(series.battery, charge_j=0.8e6)
        series = dataclasses.replace(series, battery=battery)
        found = solve_sols(problem, series, time_limit_s=0.5)
        upper = path_bound(path_problem(problem, series), limit_s=60.0).value
        assert found.mean - 4.0 * found.standard_error <= upper


def test_policies_come_to_the_optimum_in_the_mean() -> None:
    rng = np.random.default_rng(78)
    shares = []
    for _ in range(4):
        problem, series = constant(rng, 3)
        best = best_of_all(problem, series)
        if best > 0.0:
            shares.append(solve_sols(problem, series, time_limit_s=0.1).mean / best)
    assert np.mean(shares) >= 0.95


def test_the_closed_form_of_a_rest_is_the_charge_run_through_it() -> None:
    rng = np.random.default_rng(5)
    for _ in range(200):
        segments = tuple(
            PowerSegment(float(rng.uniform(1, 10)), *map(float, rng.uniform(0, 10, 3))) for _ in range(4)
        )
        battery = Battery(100.0, 100.0, 10.0)
        series = SolSeries(battery, (SolTimeline(1.0, segments),))
        rest = rest_of(series.sols[0], battery)
        for charge in np.linspace(10.0, 100.0, 19).tolist():
            assert (charge >= rest.need_j - 1e-9) == survives(series, 0, charge)
            after = after_rest(series, 0, charge)
            if after is not None and charge >= rest.need_j:
                assert rest.morning_j(charge) == pytest.approx(after)


def test_the_same_order_gives_the_same_path() -> None:
    problem = images(example())
    series = same_budgets(problem, 2)

    def told(path: SolPath) -> object:
        return path.mean, path.upper, path.outline, path.order, path.plan and path.plan.tree

    first, second = (solve_sols(problem, series, time_limit_s=0.1, seed=3) for _ in range(2))
    assert told(first) == told(second)
    assert first.lower <= first.mean <= first.upper


def test_a_stopped_search_answers() -> None:
    problem = images(example())
    path = solve_sols(problem, same_budgets(problem, 2), should_stop=lambda: True)
    assert path.stopped
    assert path.mean <= path.upper


def images(problem: Problem) -> Problem:
    """Return the problem with nothing that needs a track."""
    targets = tuple(
        dataclasses.replace(
            t, observations=tuple(dataclasses.replace(o, kind=Kind.IMAGE) for o in t.observations)
        )
        for t in problem.targets
    )
    return dataclasses.replace(problem, targets=targets)


def test_what_cannot_be_is_refused_in_a_sentence() -> None:
    problem = images(example())
    day = same_budgets(problem, 1)
    for count in (0, 31, -2):
        with pytest.raises(MissionError, match=f"number of sols is {count}; it must be 1 to 30"):
            day.repeated(count)
    with pytest.raises(ProblemError, match="needs its track; sol paths do not plan with that"):
        path_problem(example(), day)
    late = dataclasses.replace(day, windows=(SolWindow("O1", 2),))
    with pytest.raises(ProblemError, match="window of observation O1 is on sol 2; the last sol is 1"):
        path_problem(problem, late)
    with pytest.raises(ProblemError, match="unknown observation O9"):
        path_problem(problem, dataclasses.replace(day, windows=(SolWindow("O9", 1),)))
    cold = SolSeries(Battery(1e5, 1e5, 1e4), (SolTimeline(3600.0, (PowerSegment(50_000.0, heater_w=4.0),)),))
    with pytest.raises(ProblemError, match="does not survive the night after sol 1: even full"):
        path_problem(problem, cold)
    low = dataclasses.replace(cold, battery=Battery(3e5, 1e5, 1e4))
    with pytest.raises(ProblemError, match="its charge of 100000 J on sol 1 is below the 210000 J"):
        path_problem(problem, low)


def test_a_series_is_read_as_it_was_written() -> None:
    _, series = constant(np.random.default_rng(1))
    assert SOL_SERIES.read(SOL_SERIES.write(series)) == series


def empty_days() -> list[dict[str, Any]]:
    """Return documents of problems in which nothing can be wanted."""
    nothing = [[observation(f"O{k}", "image", 0.0)] for k in (1, 2, 3)]
    late = [[observation(f"O{k}", "image", window_s=[90_000.0, 91_000.0])] for k in (1, 2, 3)]
    return [
        problem_document(places=[], observations=[]),
        problem_document(observations=nothing),
        problem_document(observations=late),
    ]


@pytest.mark.parametrize("which", range(3))
def test_where_nothing_can_be_wanted_the_path_is_empty_at_once(which: int) -> None:
    problem = problem_from_dict(empty_days()[which])
    told = 0

    def report(_: Progress) -> None:
        nonlocal told
        told += 1
        assert told < 100, "it goes on without end"

    path = solve_sols(problem, same_budgets(problem, 2), time_limit_s=1.0, report=report)
    assert path.order == ()
    assert path.plan is None
    assert path.mean == 0.0


def test_a_way_through_another_place_is_refused_in_a_sentence() -> None:
    rows = [[observation(f"O{k}", "image")] for k in (1, 2, 3)]
    document = problem_document(observations=rows)
    chain = {("start", "T1"), ("T1", "T2"), ("T2", "T3")}
    document["legs"] = [leg for leg in document["legs"] if (leg["from"], leg["to"]) in chain]
    problem = problem_from_dict(document)
    with pytest.raises(ProblemError, match="no leg leads from start to T2, only a way through T1"):
        path_problem(problem, same_budgets(problem, 2))


def test_a_target_that_no_way_leads_to_hinders_no_other() -> None:
    rows = [[observation(f"O{k}", "image")] for k in (1, 2, 3)]
    document = problem_document(observations=rows)
    document["legs"] = [leg for leg in document["legs"] if "T3" not in (leg["from"], leg["to"])]
    problem = problem_from_dict(document)
    path = solve_sols(problem, same_budgets(problem, 2), time_limit_s=0.1)
    assert {o for sol in path.outline for o in sol.observations} == {"O1", "O2"}


def test_a_drive_that_fails_costs_what_it_was_for_on_all_sols() -> None:
    """Two rocks side by side, time for both: each is come to with the chance of its own drive alone."""
    rows = [[observation("O1", utility=10.0)], [observation("O2", utility=4.0)]]
    document = problem_document(
        places=[(3.0, 0.0), (3.0, 1.0)], observations=rows, spread=0.0, loss=0.0, time_s=9000.0, energy_j=2e6
    )
    document["format"] = "problem/2"
    for leg in document["legs"]:
        leg["p_fail"] = 0.4 if leg["to"] == "T1" else 0.25
    problem = problem_from_dict(document)
    found = solve_sols(problem, same_budgets(problem, 1), time_limit_s=0.2)
    expected = 10.0 * 0.6 + 4.0 * 0.75
    assert found.mean == pytest.approx(expected, abs=4.0 * found.standard_error)
    assert found.upper >= expected
    assert found.plan is not None
    assert found.plan.expected_utility == pytest.approx(expected, rel=0.01)


def test_kinds_of_sols_are_refused_by_name() -> None:
    document = problem_document(observations=[[observation("O1")], [observation("O2")], [observation("O3")]])
    document |= {"format": "problem/2", "sol_kinds": [{"name": "slow", "p": 0.2, "drive_time_factor": 1.5}]}
    problem = problem_from_dict(document)
    with pytest.raises(ProblemError, match="sol kind slow is stated; sol paths do not plan with that"):
        solve_sols(problem, same_budgets(problem, 2), time_limit_s=0.1)
