"""The bound that remembers by place: never below the best policy, whatever multipliers and memory are."""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.special import ndtri

from planner.contingency.by_place import bound
from planner.contingency.by_place.bound import ng_bound
from planner.contingency.by_place.bundle import Bundle
from planner.contingency.by_place.kernels import BLOCK, before_legs, past_block
from planner.contingency.by_place.layout import Memory, Size, Wanted, legs_of
from planner.contingency.by_place.masses_above import fine_cells, later, masses_above
from planner.contingency.by_place.memories import Credits
from planner.contingency.by_place.multipliers import Multipliers
from planner.contingency.by_place.relaxation import Actions, NgRelaxation
from planner.contingency.by_place.visited import lengths, weights_at
from planner.contingency.policy import Moves, Policy
from planner.contingency.priced_relaxation import Weights
from planner.evaluate.grid import Grid, Rounding
from planner.evaluate.model import Floats, Model
from planner.problem import Problem, problem_from_dict
from planner.tally import tallied
from tests.planner.examples import amount, observation, problem_document
from tests.planner.reference.optimum import optimum
from tests.planner.reference.problems import FAMILIES, generated

SLACK = 1e-4
"""Relative to all that is summed: single precision, without the margin that `ng_bound` adds."""


def _any_memory(model: Model, rng: np.random.Generator) -> Memory:
    """Return a memory of each place drawn at random, in any order; its own observations are in it."""
    place = Wanted.of(model).place
    at = []
    for p in range(model.n + 1):
        some = set(rng.permutation(len(place))[: rng.integers(len(place) + 1)].tolist())
        every = sorted(some | set(np.nonzero(place == p)[0].tolist()))
        at.append(rng.permutation(every).tolist())
    if rng.random() < 0.4:
        return Memory.of(at)
    kept = rng.random((model.n + 1, model.n + 1, len(place))) < rng.choice([0.0, 0.5, 0.8])
    return Memory.of(at, {(a, b): set(np.nonzero(kept[a, b])[0].tolist()) for a, b in legs_of(model)})


def _any_relaxation(model: Model, rng: np.random.Generator) -> float:
    """Return the bound of a relaxation with memory, count, prices, resource and grid drawn at random."""
    weights = Weights.of(model, float(rng.choice([0.0, 0.3, 1.0])))
    steps, most = int(rng.choice([16, 32, 64])), int(rng.integers(5))
    relaxation = NgRelaxation(model, Actions.of(model, weights, steps, most), _any_memory(model, rng))
    worth = relaxation.wanted.worth
    return relaxation.bound(rng.choice([0.0, 1.0]) * worth * rng.uniform(0.0, 1.2, len(worth)))


@pytest.mark.parametrize("family", FAMILIES)
def test_no_policy_earns_more_where_all_is_certain(family: str) -> None:
    rng = np.random.default_rng(70 + FAMILIES.index(family))
    for seed in range(20):
        problem = generated(family, 3000 + seed)
        best, model = optimum(problem), Model.of(problem)
        for _ in range(2):
            assert _any_relaxation(model, rng) >= best - SLACK * (best + model.penalty), (family, seed)
        if seed < 3:
            with tallied():
                assert ng_bound(model, limit_s=1.0) >= best - 1e-6, (family, seed)


@pytest.mark.parametrize("family", FAMILIES)
def test_each_number_of_tracks_may_have_its_own_multipliers(family: str) -> None:
    """The largest of the least values by number of tracks is a bound, though no multipliers may give it."""
    rng = np.random.default_rng(50 + FAMILIES.index(family))
    for seed in range(12):
        problem = generated(family, 6000 + seed)
        best, model = optimum(problem), Model.of(problem)
        actions = Actions.of(
            model, Weights.of(model, float(rng.choice([0.0, 1.0]))), 32, int(rng.integers(1, 5))
        )
        relaxation = NgRelaxation(model, actions, _any_memory(model, rng))
        worth = relaxation.wanted.worth
        each = [relaxation.by_count(worth * rng.uniform(0.0, 1.0, len(worth))) for _ in range(6)]
        bound = float(np.min(each, axis=0).max())
        assert bound >= best - SLACK * (best + model.penalty), (family, seed)


@pytest.mark.parametrize("most", [1, 2])
def test_a_search_for_few_tracks_values_their_days_as_one_for_all_does(most: int) -> None:
    """With any memory and multipliers, and no day that begins with more is among them."""
    rng = np.random.default_rng(30 + most)
    for seed in range(12):
        model = Model.of(generated("tracking", 7000 + seed, spread=0.3))
        tracks, memory = int(Wanted.of(model).counted.sum()), _any_memory(model, rng)
        weights = Weights.of(model, float(rng.choice([0.0, 1.0])))
        every = NgRelaxation(model, Actions.of(model, weights, 32, tracks, above=False), memory)
        few = NgRelaxation(model, Actions.of(model, weights, 32, most, above=False), memory, few=True)
        prices = every.wanted.worth * rng.uniform(0.0, 1.0, len(every.wanted.worth))
        known = every.by_count(prices)[: few.tracks + 1]
        assert few.tracks == min(most, tracks)
        assert few.by_count(prices) == pytest.approx(known, rel=1e-4, abs=1e-4), seed


def test_no_policy_earns_more_than_a_search_for_few_tracks_finds(monkeypatch: pytest.MonkeyPatch) -> None:
    """On problems with more tracks than are counted, and than days of the search begin with."""
    monkeypatch.setattr(bound, "MOST_COUNTED", 2)
    monkeypatch.setattr(bound, "FEW", 1)
    searched = 0
    for seed in range(20):
        problem = generated("tracking", 8000 + seed)
        best, model = optimum(problem), Model.of(problem)
        searched += int(Wanted.of(model).counted.sum()) > 2
        with tallied():
            assert ng_bound(model, limit_s=1.0) >= best - 1e-6, seed
    assert searched > 5


@pytest.mark.parametrize("family", FAMILIES)
def test_no_policy_earns_more_where_amounts_vary(family: str) -> None:
    rng = np.random.default_rng(90 + FAMILIES.index(family))
    for seed in range(3):
        problem = generated(family, 4000 + seed, spread=0.4)
        model = Model.of(problem)
        earned = Policy(Grid(model, 33, 21, Rounding.UP), moves=Moves.ALL).best()
        for _ in range(6):
            assert _any_relaxation(model, rng) >= earned - SLACK * (earned + model.penalty), (family, seed)


def _timed(family: str, seed: int) -> Problem:
    """Return a problem in which time alone is short."""
    problem = generated(family, seed, spread=0.3)
    budget = dataclasses.replace(problem.budget, energy_j=1e9)
    return dataclasses.replace(problem, hotel_w=0.0, budget=budget)


@pytest.mark.parametrize("family", ["plain", "hub", "tracking", "penalty", "through"])
def test_with_everything_remembered_it_is_the_optimal_value(family: str) -> None:
    """On coarse grids too it is never below the value, and on finer ones hardly above it."""
    for seed in range(3):
        model = Model.of(_timed(family, 5000 + seed))
        value = Policy(Grid(model, 161, 2), moves=Moves.ALL).best()
        every = tuple(range(len(Wanted.of(model).number)))
        memory = Memory.of([every] * (model.n + 1))
        for steps, above in ((16, math.inf), (24, math.inf), (48, 0.08), (192, 0.01)):
            actions = Actions.of(model, Weights.of(model, 1.0), steps, len(every))
            relaxation = NgRelaxation(model, actions, memory)
            bound = relaxation.bound(np.zeros(len(every)))
            assert value - 2e-4 * (value + model.penalty) <= bound <= (1.0 + above) * value + 0.01


def test_an_expectation_lies_below_the_chords_between_its_nodes() -> None:
    """For one concave kink, and for the end of the day, at every fine cell between two nodes."""
    rng = np.random.default_rng(5)
    each, steps, knot = 8, 6, 4
    cells = np.zeros(each * steps + 1)
    cells[each : 5 * each // 2] = rng.uniform(0.0, 1.0, 3 * each // 2) ** 6  # takes 1 to 2.5 nodes
    cells /= cells.sum()
    masses, fine = masses_above([cells], 1, steps + 1, drives=False), np.arange(each * steps + 1)
    kink = np.minimum(0.0, knot - np.arange(steps + 1.0))
    bulge = np.append(masses.bulge[0], 0.0)  # what lies before the action ends adds nothing
    node = [
        masses.hat[0, : steps + 1 - k] @ kink[k:] + max(bulge[knot - k], bulge[knot - k - 1])
        for k in range(4)
    ]
    for t in range(3 * each):
        true = float(cells @ np.minimum(0.0, knot - (t + fine) / each))
        assert np.interp(t / each, range(4), node) >= true - 1e-6, t
    for left in fine:
        within = np.interp(left / each, range(steps + 1), masses.within[0])
        assert within >= cells[: left + 1].sum() - 1e-6, left


def test_a_drive_of_less_than_a_node_is_split_between_two_nodes() -> None:
    """For a value that falls in a straight line, and one that bends where the drive begins."""
    rng = np.random.default_rng(9)
    each, steps = 16, 4
    cells = np.zeros(each * steps + 1)
    cells[1:each] = rng.uniform(0.0, 1.0, each - 1) ** 4
    cells /= cells.sum()
    masses, at = masses_above([cells], 1, steps + 1, drives=True), np.arange(len(cells)) / each
    assert 0.0 < masses.quick[0] < 1.0
    assert masses.quick[0] + masses.hat[0].sum() == pytest.approx(1.0, abs=1e-5)
    assert masses.hat[0] @ np.arange(steps + 1) == pytest.approx(cells @ at, rel=1e-4)
    quick, kinked = float(masses.quick[0]), float(masses.bulge[0, 0])
    before, here = kinked, kinked - float(masses.hat[0, 1])  # it falls by one a node from here on
    assert quick > 0.0
    for left in np.arange(0.0, 1.0, 1 / each):
        true = float(cells @ np.minimum(0.0, left - at))
        assert np.interp(left, (0.0, 1.0), (here, before)) >= true - 1e-6, left


def test_targets_close_together_leave_the_bound_close_on_few_nodes() -> None:
    """Drives of less than a node (250 s) had been paid for as if each won all: 23 % too much here."""
    rows = [[observation(f"O{k}", "image", utility=4.0 + k % 3)] for k in range(8)]
    places = [(6.0 * (k // 2), 0.1 * (-1) ** k) for k in range(8)]
    document = problem_document(places=places, observations=rows, spread=0.4, time_s=6000.0, energy_j=1e8)
    model = Model.of(problem_from_dict(document))
    own = Memory.of([[], *([k] for k in range(8))])
    values = [
        NgRelaxation(model, Actions.of(model, Weights.of(model, 1.0), steps, 0), own).bound(np.full(8, 2.0))
        for steps in (24, 384)
    ]
    assert values[1] <= values[0] <= 1.02 * values[1]


@pytest.mark.parametrize("per_j", [0.0, 1.0])
@pytest.mark.parametrize("spread", [0.0, 0.1, 0.5])
def test_an_amount_split_between_fine_nodes_stays_below_the_chords(spread: float, per_j: float) -> None:
    """Of an action that takes 2.3 nodes, with its tracks, for one concave kink and for the end of the day."""
    steps, knot, longer = 12, 8, 0.37
    sigma = math.sqrt(math.log1p(spread**2))
    ln = np.array([math.log(2.3 / steps) - sigma**2 / 2, sigma] * 2)
    weights = Weights(1.0, per_j, timed=per_j == 0.0)
    masses = masses_above(
        [later(fine_cells(ln, weights, steps, 96), longer / steps)], 1, steps + 1, drives=False
    )
    rng, draws = np.random.default_rng(8), 40_001
    quantiles = [
        np.exp(rng.permutation(ln[0] + sigma * ndtri((np.arange(draws) + 0.5) / draws))) * steps
        for _ in range(2)
    ]
    taken = quantiles[0] + per_j * quantiles[1] + longer
    kink = np.minimum(0.0, knot - np.arange(steps + 1.0))
    bulge = np.append(masses.bulge[0], 0.0)
    node = [
        masses.hat[0, : steps + 1 - k] @ kink[k:]
        + (masses.within[0, steps - k] - masses.hat[0, : steps + 1 - k].sum()) * kink[-1]
        + max(bulge[knot - k], bulge[knot - k - 1] if k < knot else 0.0)
        for k in range(knot)
    ]
    unlucky = 5.0 * (taken.std() if per_j else 0.0) / math.sqrt(draws)  # drawn at random where both are taken
    for t in np.arange(0.0, 3.0, 0.05):
        true = float(np.minimum(0.0, knot - np.minimum(t + taken, steps)).mean())
        assert np.interp(t, range(knot), node) >= true - 1e-4 - unlucky, t
    for left in np.arange(0.0, steps, 0.05):
        within = np.interp(left, range(steps + 1), masses.within[0])
        assert within >= np.mean(taken <= left) - 1e-4 - 5.0 * per_j / math.sqrt(draws), left
    assert masses.within[0].max() <= 1.0 + 1e-5


def test_a_grid_that_only_lies_near_keeps_means() -> None:
    """A drive takes a node at least, since those that begin at a node are worked out before it."""
    rng = np.random.default_rng(6)
    each, steps = 8, 10
    for low, drives in ((0, False), (each, True), (2, True)):
        cells = np.zeros(each * steps + 1)
        cells[low : 6 * each] = rng.uniform(0.0, 1.0, 6 * each - low)
        cells /= cells.sum()
        masses, at = (
            masses_above([cells], 1, steps + 1, drives=drives, above=False),
            np.arange(len(cells)) / each,
        )
        mean = cells @ (np.maximum(at, 1.0) if drives else at)
        assert masses.hat[0].sum() == pytest.approx(1.0, abs=1e-5)
        assert masses.hat[0] @ np.arange(steps + 1) == pytest.approx(mean, rel=1e-3)
        assert masses.within[0] == pytest.approx(cells.cumsum()[::each], abs=1e-5)
        assert not masses.bulge.any()
        assert not masses.quick.any()


def test_only_what_is_tracked_is_owed_for() -> None:
    """Where two tracks do not fit into the day, no day owes the multipliers of two."""
    rows = [[observation(f"O{k}", "place", utility=5.0)] for k in range(2)]
    document = problem_document(places=[(9.0, 0.0)] * 2, observations=rows, time_s=9000.0)
    problem = dataclasses.replace(problem_from_dict(document), track_start_time_s=5000.0)
    model = Model.of(problem)
    actions = Actions.of(model, Weights.of(model, 1.0), 64, 2)
    relaxation = NgRelaxation(model, actions, Memory.of([(), (0,), (1,)]))
    owed = relaxation.wanted.worth * relaxation.wanted.chance
    assert relaxation.bound(relaxation.wanted.worth) == pytest.approx(owed.max(), rel=1e-3)


def _day() -> Problem:
    rows = [[observation(f"O{k}", "image", utility=4.0 + k)] for k in range(6)]
    places = [(4.0 * k - 10.0, 6.0 * (-1) ** k) for k in range(6)]
    return problem_from_dict(
        problem_document(places=places, observations=rows, spread=0.3, time_s=9000.0, energy_j=1e8)
    )


def test_it_comes_near_the_best_policy_and_is_the_same_again() -> None:
    model = Model.of(_day())
    earned = Policy(Grid(model, 97, 3), moves=Moves.ALL).best()
    found = []
    for _ in range(2):
        with tallied():
            found.append(ng_bound(model, limit_s=4.0))
    assert 0.999 * earned <= found[0] <= 1.03 * earned
    assert found[0] == found[1]


def _best_count(relaxation: NgRelaxation) -> int:
    return int(relaxation.by_count(relaxation.prices).argmax())


def _made_again(relaxation: NgRelaxation) -> float:
    """Return what the policy of the last bound makes again, in observations in the mean of a day."""
    walks = relaxation.walks(_best_count(relaxation), 2000, rng=np.random.default_rng(3))
    again = sum(int((e[:n, 2] >= 0).sum()) for e, n in zip(walks.events, walks.happened, strict=True))
    assert walks.happened.sum() > 0
    return again / len(walks.happened)


def _relaxed(model: Model, memory: Memory) -> NgRelaxation:
    """Return the relaxation of a model in time with a memory, asked without multipliers."""
    relaxation = NgRelaxation(model, Actions.of(model, Weights.of(model, 1.0), 96, 15), memory)
    relaxation.bound(np.zeros(len(relaxation.wanted.worth)))
    return relaxation


def test_a_policy_makes_again_what_it_forgets_and_nothing_that_it_remembers() -> None:
    model = Model.of(_day())
    own = [[m] if p else [] for p, m in enumerate([-1, *range(6)])]
    assert _made_again(_relaxed(model, Memory.of(own))) > 0.5
    assert _made_again(_relaxed(model, Memory.of([range(6)] * 7))) == 0.0
    assert _made_again(_relaxed(model, Memory.of([range(6)] * 7, {}))) > 0.5  # every leg forgets


def test_memory_grows_where_the_policy_comes_back_and_makes_the_bound_closer() -> None:
    model = Model.of(_day())
    own = Memory.of([[m] if p else [] for p, m in enumerate([-1, *range(6)])], {})
    relaxation, credits = _relaxed(model, own), Credits(model)
    none = np.zeros(6)
    before, again = relaxation.bound(none), _made_again(relaxation)
    for more in (2.0, 6.0, 30.0):
        credits.add([(1.0, credits.followed(relaxation, _best_count(relaxation)))])
        limit = more * relaxation.size.seconds
        larger = _relaxed(model, credits.enlarged(relaxation.memory, [(96, 15, limit)]))
        assert larger.size.seconds <= limit
        for leg in legs_of(model):
            assert set(relaxation.memory.common(*leg)) <= set(larger.memory.common(*leg))
        relaxation = larger
    assert relaxation.bound(none) < 0.9 * before
    assert _made_again(relaxation) < 0.5 * again


def test_what_wins_most_for_the_time_that_it_takes_is_remembered_first() -> None:
    """Of two that fit alone, the one at places that remember little: the other one wins half as much more."""
    model = Model.of(_day())
    legs = legs_of(model)
    memory = Memory.of([[], [0], [1], range(1, 6), [3], [4], [5]], {})
    credits = Credits(model)
    dear, cheap = (0, (legs.index((1, 3)),)), (1, (legs.index((4, 5)),))
    credits.add([(1.0, {dear: 1.5, cheap: 1.0})])
    alone = Credits(model)
    alone.add([(1.0, {dear: 1.5})])
    room = Size.of(model, alone.enlarged(memory, [(96, 15, 1e9)]), 15, 96).seconds
    kept = credits.enlarged(memory, [(96, 15, room)])
    assert kept.common(4, 5) == [1]
    assert kept.common(1, 3) == []


def test_numbers_of_tracks_that_are_new_begin_with_the_best_multipliers() -> None:
    model = Model.of(generated("tracking", 8003, spread=0.3))
    assert int(Wanted.of(model).counted.sum()) > 1
    own = Memory.of([np.nonzero(Wanted.of(model).place == p)[0].tolist() for p in range(model.n + 1)], {})

    def relaxation(most: int) -> NgRelaxation:
        actions = Actions.of(model, Weights.of(model, 1.0), 32, most, above=False)
        return NgRelaxation(model, actions, own, few=most == 1)

    search = Multipliers(relaxation(1), Credits(model))
    search.lower(6, 0.1, lambda: False)
    wider = search.with_more_tracks(relaxation(15))
    best = search.points[int(search.least.argmax())]
    assert wider.least[:2] == pytest.approx(search.least)
    assert wider.least[2:] == pytest.approx(relaxation(15).by_count(best)[2:])
    assert all(np.array_equal(point, best) for point in wider.points[2:])


def test_a_lost_track_is_remembered_from_the_start_on() -> None:
    rows = [[observation(f"O{k}", "place", utility=5.0)] for k in range(3)]
    places = [(6.0, 0.0), (0.0, 6.0), (-6.0, 0.0)]
    model = Model.of(problem_from_dict(problem_document(places=places, observations=rows, time_s=12000.0)))
    relaxation, credits = _relaxed(model, Memory.of([(), (0,), (1,), (2,)], {})), Credits(model)
    credits.add([(1.0, credits.followed(relaxation, _best_count(relaxation)))])
    memory = credits.enlarged(relaxation.memory, [(96, 15, 1e9)])
    assert memory.at[0]
    assert any(set(memory.common(a, b)) for a, b in legs_of(model) if a)


def test_drives_are_summed_over_all_nodes_whatever_the_block() -> None:
    """At every node as one sum over the whole day says, with what concave kinks add."""
    model = Model.of(_day())
    relaxation = _relaxed(model, Memory.of([[m] if p else [] for p, m in enumerate([-1, *range(6)])]))
    a, w = relaxation.layout, relaxation.tables
    legs = relaxation.actions.drives
    size, lanes = len(w.arriving), w.arriving.shape[2]
    past = np.zeros((size, BLOCK, 2, lanes), np.float32)
    by = np.zeros((size, lanes), np.float32)
    left = np.zeros_like(by)
    kinks = np.zeros_like(w.arriving)
    kinks[:, 1:-1] = np.maximum(0.0, 2.0 * w.arriving[:, 1:-1] - w.arriving[:, :-2] - w.arriving[:, 2:])
    for i in range(a.nodes - 1, -1, -1):
        if i == a.nodes - 1 or i % BLOCK == BLOCK - 1:
            past_block(a, legs, w, i // BLOCK * BLOCK, past)
        before_legs(a, legs, w, i, past, by, left)
        rest, last = a.nodes - 1 - i, w.arriving[:, -1]
        for s in range(size):
            e = int(np.searchsorted(a.leg_base, s, side="right")) - 1
            chord = (legs.hat[e, 1 : rest + 1] * w.arriving[s, i + 1 :]).sum(axis=0)
            chord += (legs.within[e, rest] - legs.summed[e, rest]) * last[s]
            bulge = (legs.bulge[e, 2:rest] * kinks[s, i + 2 : -1]).sum(axis=0)
            assert left[s] == pytest.approx(bulge, rel=1e-4, abs=1e-5), (i, s)
            assert np.all(by[s] >= chord + bulge - 1e-4), (i, s)


@pytest.mark.parametrize("count", [3, 9])
def test_every_count_of_tracks_is_worked_out(count: int) -> None:
    """A day with time for all earns all, whether the counts fill one register or two."""
    rows = [[observation(f"O{k}", "place", utility=2.0 + k)] for k in range(count)]
    places = [(2.0 * math.cos(k), 2.0 * math.sin(k)) for k in range(count)]
    document = problem_document(places=places, observations=rows, time_s=12000.0, energy_j=1e9, loss=0.0)
    model = Model.of(problem_from_dict(document))
    every = Memory.of([range(count)] * (count + 1))
    relaxation = NgRelaxation(model, Actions.of(model, Weights.of(model, 1.0), 64, 15), every)
    every_worth = float(relaxation.wanted.worth.sum())
    assert 0.999 * every_worth <= relaxation.bound(np.zeros(count)) <= 1.05 * every_worth
    assert _best_count(relaxation) == count
    assert (relaxation.begun[count].state, relaxation.begun[count].lane) == (0, count)


def test_a_search_ends_where_questions_in_a_row_win_too_little() -> None:
    """After the first and two more, where nothing wins 90 % of the value; else after all that it may ask."""
    relaxation = _relaxed(
        Model.of(_day()), Memory.of([[m] if p else [] for p, m in enumerate([-1, *range(6)])])
    )
    asked = []
    for enough in ((2, 0.9), (0, 0.0)):
        search = Multipliers(relaxation, Credits(relaxation.model))
        search.lower(7, 0.1, lambda: False, enough=enough)
        asked.append(len(search.largest))
    assert asked == [3, 7]


def test_a_bundle_finds_the_lowest_point() -> None:
    """Of a maximum of planes, as linear programming finds it."""
    rng = np.random.default_rng(11)
    slopes, at_zero = rng.normal(size=(40, 8)), rng.uniform(0.0, 5.0, 40)
    slopes[:8] = -np.eye(8)

    def look(point: Floats) -> tuple[float, Floats]:
        values = at_zero + slopes @ point
        return float(values.max()) + 10.0, slopes[int(values.argmax())]

    program = linprog(
        np.append(np.zeros(8), 1.0), np.hstack([slopes, -np.ones((40, 1))]), -at_zero, bounds=[(0, None)] * 9
    )
    found = Bundle(np.full(8, 3.0)).lowered(look, 200, first=0.1, should_stop=lambda: False)
    assert found.point.min() >= 0.0
    assert found.value == pytest.approx(look(found.point)[0])
    assert found.value == pytest.approx(float(program.fun) + 10.0, rel=2e-3)


def test_shares_of_looks_are_those_of_policies_that_are_as_good() -> None:
    """In the mean of them nothing is left to win: no slope where a multiplier counts, none below 0 else."""
    rng = np.random.default_rng(12)
    slopes, at_zero = rng.normal(size=(40, 6)), rng.uniform(0.0, 5.0, 40)
    slopes[:6] = -2.0 * np.eye(6)
    chosen: list[int] = []

    def look(point: Floats) -> tuple[float, Floats]:
        values = at_zero + slopes @ point
        chosen.append(int(values.argmax()))
        return float(values.max()) + 10.0, slopes[chosen[-1]]

    found = Bundle(np.full(6, 3.0)).lowered(look, 300, first=0.1, should_stop=lambda: False)
    shares = found.shares()
    assert sum(shares.values()) == pytest.approx(1.0)
    mean = sum(share * slopes[chosen[number]] for number, share in shares.items())
    assert np.all(mean > -0.05)
    assert np.all(np.abs(mean[found.point > 0.05]) < 0.05)


def test_what_takes_too_much_is_not_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    model = Model.of(_day())
    monkeypatch.setattr("planner.contingency.by_place.bound.LARGEST_MB", 0.01)
    with tallied():
        assert ng_bound(model, limit_s=4.0) == math.inf


def test_a_path_through_visited_places_is_as_short_as_the_best_order_of_them() -> None:
    """Against every order, and every leg of every order looked for among all paths."""
    rng = np.random.default_rng(17)
    for seed in range(6):
        model = Model.of(generated("hub" if seed % 2 else "tracking", 7000 + seed))
        kept = np.where(model.has_leg, 1.0 - rng.uniform(0.0, 0.9, model.loss.shape[:2]), 0.0)
        model.loss[:, :, 1] = 1.0 - kept
        own = np.array([2, -1, 3], np.int64)
        weights = weights_at(lengths(model, 1), 1, own)

        def survival(a: int, b: int, kept: Floats = kept) -> float:
            between = [p for p in range(1, len(kept)) if p not in (a, b)]
            paths = (path for k in range(3) for path in itertools.permutations(between, k))
            legs = (list(itertools.pairwise((a, *path, b))) for path in paths)
            return max(math.prod(float(kept[leg]) for leg in path) for path in legs)

        for state in range(8):
            visited = [int(p) for bit, p in enumerate(own) if state >> bit & 1 and p > 0]
            through = max(
                math.prod(survival(a, b) for a, b in itertools.pairwise((0, *order, 1)))
                for order in itertools.permutations(visited)
            )
            assert weights[state] == pytest.approx(max(1.0, survival(0, 1) / max(through, 1e-12)), rel=1e-6)


def test_a_track_that_is_used_after_a_visit_weighs_what_the_path_there_lost() -> None:
    """An image is to be made before a track is used: half of the tracks are lost on each of two drives.

    A multiplier then costs exactly what is owed for it, so at each the relaxation, on a grid that keeps
    means, has the value of the best policy.
    """
    image, tracked = observation("O1", "image", utility=5.0), observation("O2", "place", utility=10.0)
    image["window_s"] = [0.0, 3000.0]
    document = problem_document(
        places=[(5.0, 0.0), (5.0, 5.0)],
        observations=[[image], [tracked]],
        time_s=9_000.0,
        energy_j=1e8,
        loss=0.5,
    )
    for o in document["targets"]:
        for made in o["observations"]:
            made["observe"] = {"time_s": amount(300.0), "energy_j": amount(9000.0)}
    for leg in document["legs"]:
        leg["time_s"], leg["energy_j"] = amount(2000.0), amount(9000.0)
    problem = problem_from_dict(document)
    best, model = optimum(problem), Model.of(problem)
    actions = Actions.of(model, Weights.of(model, 1.0), 64, 1, above=False)
    relaxation = NgRelaxation(model, actions, Memory.of([(0, 1)] * 3))
    for share in (0.1, 0.2, 0.4):
        bound = relaxation.bound(np.where(relaxation.counted, share, 0.0) * relaxation.wanted.worth)
        assert bound == pytest.approx(best, rel=1e-5), share
