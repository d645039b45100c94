"""Exact engine, CP-SAT and local search against brute force, against each other and against themselves."""

from __future__ import annotations

from dataclasses import replace
from importlib.metadata import EntryPoint, EntryPoints

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mission import plugins
from planner.errors import RoutingError
from planner.orienteering import Experiment, RoutingProblem, SideLimit, exact, route_value, solve
from planner.orienteering.cp_sat import solve_cp_sat
from planner.orienteering.engines import ENGINES, Effort, RoutingEngine, engine_named
from planner.orienteering.exact import ExactOptions, ExactSolver
from planner.orienteering.label_kernels import expand
from planner.orienteering.survey import is_survey, solve_survey
from planner.tally import Step
from tests.planner.orienteering.brute_force import optimum
from tests.planner.orienteering.strategies import problems

SMALL = ExactOptions(cells=20_000, coarse_cells=4_000, rounds=6)


@settings(max_examples=150, deadline=None)
@given(problems(limits=True))
def test_exact_engine_proves_what_brute_force_finds(problem: RoutingProblem) -> None:
    solution = ExactSolver(problem, SMALL).solve()
    assert solution.proven
    assert solution.value == optimum(problem)
    if solution.value is not None:
        assert solution.upper == solution.value
        assert route_value(problem, solution.route) == solution.value


def test_a_site_without_a_road_to_the_end_is_left_by_way_of_another() -> None:
    roads = np.array([[1, -1, 1], [1, 1, 1], [1, 1, 1]])
    wanted = tuple(Experiment(f"E{k}", site, 0, 1, must_do=True) for k, site in enumerate((0, 2)))
    problem = RoutingProblem(roads, roads * 0 + 1, wanted, 20, end_site=1)
    solution = ExactSolver(problem, SMALL).solve()
    assert (solution.value, solution.proven, solution.route) == (0, True, (0, 1))  # was "proven impossible"


@pytest.mark.parametrize("done", [0, 12])
def test_experiments_that_are_done_take_no_work_of_the_search(
    monkeypatch: pytest.MonkeyPatch, done: int
) -> None:
    rng = np.random.default_rng(5)
    roads = rng.integers(20, 90, (17, 17))
    wanted = tuple(Experiment(f"E{k}", k + 1, int(rng.integers(5, 20)), 10, 10) for k in range(16))
    problem = RoutingProblem(roads, roads, wanted, 250, energy_budget=250, done=frozenset(range(done)))
    counted: list[float] = []
    looked_at: list[int] = []

    def seen(labels: int, *more: object) -> object:
        looked_at.append(labels)
        return expand(labels, *more)

    def spent(step: Step, count: float) -> None:
        if step is Step.WIDE:
            counted.append(count)

    monkeypatch.setattr(exact, "expand", seen)
    monkeypatch.setattr(exact, "spend", spent)
    ExactSolver(problem, ExactOptions(cells=200, coarse_cells=100, rounds=1)).solve()
    assert counted
    assert counted == [(16 - done) * labels for labels in looked_at]


@settings(max_examples=40, deadline=None)
@given(problems(limits=True))
def test_cp_sat_agrees_with_brute_force(problem: RoutingProblem) -> None:
    solution = solve_cp_sat(problem, time_limit_s=20.0)
    assert solution.proven
    assert solution.value == optimum(problem)


@settings(max_examples=60, deadline=None)
@given(problems(must=False), st.data())
def test_a_branch_problem_on_the_same_table_gets_the_same_optimum_as_on_its_own(
    problem: RoutingProblem, data: st.DataObject
) -> None:
    sites = sorted({problem.start_site, *(e.site for e in problem.experiments)})
    variant = replace(
        problem,
        start_site=data.draw(st.sampled_from(sites)),
        start_time=data.draw(st.integers(0, problem.time_budget)),
        energy_used=data.draw(st.integers(0, 30)),
        done=frozenset(data.draw(st.sets(st.integers(0, len(problem.experiments) - 1), max_size=2))),
    )
    shared_table = ExactSolver(problem, SMALL)
    shared_table.prepare()
    solution = shared_table.solve(variant)
    assert solution.proven
    assert solution.value == optimum(variant)
    with pytest.MonkeyPatch.context() as patch:  # a first pass so narrow that the branch gets its own table
        patch.setattr(exact, "_WIDTHS", (1, 100_000))
        sharpened = shared_table.solve(variant)
    assert sharpened.proven
    assert sharpened.value == solution.value


def test_a_branch_is_not_credited_with_what_was_earned_before_it() -> None:
    problem = _random_rover(10, 3)
    solver = ExactSolver(problem, SMALL)
    first = solver.solve()
    dear = max(first.route, key=lambda i: problem.experiments[i].prize)
    done = frozenset(first.route[: first.route.index(dear) + 1])
    branch = replace(problem, start_site=problem.experiments[dear].site, start_time=9000, done=done)
    fresh = replace(branch, experiments=tuple(replace(e, prize=1) for e in problem.experiments))
    left = len(problem.experiments) - len(done)
    cheap = ExactSolver(fresh, SMALL)
    cheap.prepare()
    assert (cheap.solve(iterations=1).upper or 0) <= left
    quick = solver.solve(branch, iterations=1)
    assert quick.upper is not None
    assert first.value is not None
    assert quick.upper < first.value


@settings(max_examples=60, deadline=None)
@given(problems(must=False), st.integers(1, 40))
def test_more_budget_never_lowers_the_optimum(problem: RoutingProblem, more: int) -> None:
    less = ExactSolver(problem, SMALL).solve().value
    longer = ExactSolver(replace(problem, time_budget=problem.time_budget + more), SMALL).solve().value
    assert less is None or (longer is not None and longer >= less)
    if problem.energy_budget is not None:
        richer = replace(problem, energy_budget=problem.energy_budget + more)
        value = ExactSolver(richer, SMALL).solve().value
        assert less is None or (value is not None and value >= less)


def _random_rover(sites: int, seed: int) -> RoutingProblem:
    rng = np.random.default_rng(seed)
    xy = rng.uniform(0, 10 * sites**0.5, (sites, 2))
    length = np.hypot(*(xy[:, None] - xy[None]).transpose(2, 0, 1))
    roads = (100 + 60 * length * rng.uniform(1, 1.3, length.shape)).astype(np.int64)
    experiments = []
    for site in range(1, sites):
        for _ in range(int(rng.integers(1, 4))):
            opens = int(rng.integers(0, 9000)) if rng.random() < 0.5 else 0
            experiments.append(
                Experiment(
                    len(experiments),
                    site,
                    int(rng.integers(5, 50)),
                    int(rng.integers(300, 1800)),
                    int(rng.integers(20, 90)),
                    opens,
                    opens + int(rng.integers(4000, 9000)) if opens else None,
                )
            )
    return RoutingProblem(roads, roads // 30, tuple(experiments), 14_400, 700)


@pytest.mark.parametrize("seed", range(3))
def test_exact_engine_and_cp_sat_agree_on_six_sites(seed: int) -> None:
    problem = _random_rover(6, seed)
    proof = ExactSolver(problem).solve()
    model = solve_cp_sat(problem, time_limit_s=60.0, hint=proof.route)
    assert proof.proven
    assert proof.value is not None
    assert model.value == proof.value
    assert model.upper is not None
    assert model.upper >= proof.value


def test_a_label_limit_gives_a_route_with_an_honest_bound() -> None:
    problem = _random_rover(12, 5)
    full = ExactSolver(problem).solve()
    cut = ExactSolver(problem, SMALL).solve(iterations=50)
    assert full.proven
    assert not cut.proven
    assert cut.value is not None
    assert full.value is not None
    assert cut.upper is not None
    assert cut.value <= full.value <= cut.upper


def test_same_seed_and_iterations_give_the_same_route() -> None:
    problem = _random_rover(12, 6)
    for engine in ("exact", "cp-sat"):
        first = solve(problem, time_limit_s=300, iterations=400, seed=3, engine=engine)
        again = solve(problem, time_limit_s=300, iterations=400, seed=3, engine=engine)
        assert (first.route, first.value, first.upper) == (again.route, again.value, again.upper)
    survey = _lattice(6)
    first = solve(survey, time_limit_s=300, iterations=4000, seed=3, engine="survey")
    again = solve(survey, time_limit_s=300, iterations=4000, seed=3, engine="survey")
    assert first.route == again.route


def _lattice(side: int) -> RoutingProblem:
    xy = np.array([(i, j) for i in range(side) for j in range(side)], dtype=float)
    roads = np.rint(10 * np.hypot(*(xy[:, None] - xy[None]).transpose(2, 0, 1))).astype(np.int64)
    nodes = [n for n in range(side * side) if n]
    rng = np.random.default_rng(4)
    experiments = tuple(Experiment(n, n, int(rng.integers(1, 30))) for n in nodes)
    return RoutingProblem(roads, roads * 0, experiments, 110, end_site=0)


def test_local_search_reaches_the_optimum_of_a_small_survey() -> None:
    problem = _lattice(4)
    assert is_survey(problem)
    found = solve_survey(problem, time_limit_s=60.0, iterations=6000, seed=1)
    proof = solve_cp_sat(problem, time_limit_s=60.0, hint=found.route, threads=2)
    assert proof.value == found.value


def test_a_choice_group_and_a_kind_are_kept_by_every_engine_that_takes_them() -> None:
    problem = _random_rover(5, 9)
    count = len(problem.experiments)
    group = SideLimit("one of the first three", tuple(int(i < 3) for i in range(count)), 1)
    kind = SideLimit("two of a kind", tuple(i % 2 for i in range(count)), 2)
    limited = replace(problem, limits=(group, kind))
    proof, model = ExactSolver(limited).solve(), solve_cp_sat(limited, time_limit_s=60)
    assert proof.proven
    assert proof.value == model.value
    assert sum(i < 3 for i in proof.route) <= 1
    assert sum(i % 2 for i in proof.route) <= 2


def test_auto_takes_each_problem_to_an_engine_that_can() -> None:
    roads = np.array([[0, 4], [4, 0]], dtype=np.int64)
    timeless = RoutingProblem(roads * 0, roads, (Experiment("a", 1, 3), Experiment("b", 0, 2)), 10, 4)
    assert solve(timeless).engine == "cp-sat"
    assert solve(timeless).value == 5
    assert solve(_lattice(3), time_limit_s=1.0).engine.startswith("survey")
    assert solve(_random_rover(4, 1)).engine == "exact"
    with pytest.raises(RoutingError, match="survey engine takes"):
        solve(_random_rover(4, 1), engine="survey")
    with pytest.raises(RoutingError, match='unknown engine "magic"'):
        solve(timeless, engine="magic")


def test_a_start_that_the_table_does_not_know_is_refused() -> None:
    roads = np.full((3, 3), 4, dtype=np.int64)
    solver = ExactSolver(RoutingProblem(roads, roads, (Experiment("a", 1, 3, 1),), 20, 20), SMALL)
    solver.prepare()
    with pytest.raises(RoutingError, match="start_site is 2"):
        solver.solve(replace(RoutingProblem(roads, roads, (Experiment("a", 1, 3, 1),), 20, 20), start_site=2))


def test_nothing_to_choose_and_nothing_possible_are_answers() -> None:
    roads = np.array([[0, 4], [4, 0]], dtype=np.int64)
    empty = RoutingProblem(roads, roads, (), 10, base_prize=7)
    assert (solve(empty).value, solve(empty).proven) == (7, True)
    far = RoutingProblem(roads, roads, (Experiment("a", 1, 3, 1, must_do=True),), 4, 9)
    assert (solve(far).value, solve(far).proven) == (None, True)
    too_far = RoutingProblem(roads, roads, (Experiment("a", 0, 3, 1),), 3, 9, end_site=1)
    assert (solve(too_far).value, solve(too_far).proven) == (None, True)
    zero = RoutingProblem(roads, roads, (Experiment("a", 1, 3, 1),), 0, 0)
    assert (solve(zero).value, solve(zero).route) == (0, ())


def test_two_hundred_identical_targets_are_solved() -> None:
    roads = np.full((201, 201), 10, dtype=np.int64)
    np.fill_diagonal(roads, 0)
    experiments = tuple(Experiment(i, i, 5, 90) for i in range(1, 201))
    solution = solve(RoutingProblem(roads, roads, experiments, 1000, 10_000), time_limit_s=5.0)
    assert solution.value == 50
    assert solution.upper is not None
    assert solution.upper >= 50


# ------------------------------------------------------------------------------------- every engine


@pytest.fixture(params=ENGINES.names())
def engine(request: pytest.FixtureRequest) -> RoutingEngine:
    return engine_named(request.param)


def _survey(seed: int) -> RoutingProblem:
    """Return a problem that every engine takes: symmetric, one budget, no other rule."""
    rng = np.random.default_rng(seed)
    at = rng.uniform(0.0, 100.0, (9, 2))
    roads = np.rint(np.hypot(*(at[:, None] - at[None]).transpose(2, 0, 1))).astype(np.int64)
    prizes = rng.integers(1, 20, 9)
    experiments = tuple(Experiment(f"E{k}", k, int(prizes[k])) for k in range(1, 9))
    return RoutingProblem(roads, roads * 0, experiments, 180, end_site=0)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_every_engine_keeps_its_promise(engine: RoutingEngine, seed: int) -> None:
    problem = _survey(seed)
    found = engine(problem, Effort(20.0, iterations=20_000, seed=seed))
    best = optimum(problem)
    assert best is not None
    assert found.value == route_value(problem, found.route)
    assert found.value >= 0.9 * best
    assert found.upper is None or found.upper >= best
    assert found.proven is False or found.value == best
    assert engine(problem, Effort(20.0, iterations=20_000, seed=seed)).route == found.route


def test_an_engine_of_a_package_that_fails_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    points = EntryPoints([EntryPoint("broken", "no_such_package:solve", "outcrop.engines")])
    monkeypatch.setattr(plugins, "entry_points", lambda group: points.select(group=group))
    with pytest.raises(RoutingError, match=r'engine "broken" \(no_such_package:solve\) cannot be loaded'):
        solve(_survey(1), engine="broken")
    with pytest.raises(RoutingError, match="known are branch-and-cut, broken, cp-sat, exact, survey"):
        solve(_survey(1), engine="best")
