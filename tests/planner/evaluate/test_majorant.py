"""Functions above the value: no expectation, sampled or enumerated, lies above them."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from planner.contingency.bounds import ABOVE, upper_bound
from planner.contingency.policy import Moves, Policy
from planner.evaluate.grid import Grid, Rounding
from planner.evaluate.majorant import Majorant
from planner.evaluate.model import Floats, Model
from planner.evaluate.raised_chances import least_above
from tests.planner.examples import example
from tests.planner.reference.optimum import optimum
from tests.planner.reference.problems import FAMILIES, generated

DRAWS = 20_000


def _at(grid: Grid, nodes: Floats, t: Floats, g: Floats) -> Floats:
    """Return a function linear between nodes at points: 0 one cell behind the last time, and as at the last
    energy behind that.
    """
    padded = np.zeros((grid.nt + 2, grid.ng + 2))
    padded[: grid.nt] = np.pad(nodes, ((0, 0), (0, 2)), mode="edge")
    x, y = np.minimum(t / grid.step_t, grid.nt), np.minimum(g / grid.step_g, grid.ng)
    i, j = x.astype(int), y.astype(int)
    x, y = x - i, y - j
    low = (1 - y) * padded[i, j] + y * padded[i, j + 1]
    high = (1 - y) * padded[i + 1, j] + y * padded[i + 1, j + 1]
    return np.asarray((1 - x) * low + x * high)


@pytest.mark.parametrize("spread", [0.02, 0.15, 0.5])
@pytest.mark.parametrize("nodes", [(9, 8), (21, 25)])
def test_between_nodes_no_expectation_is_above(spread: float, nodes: tuple[int, int]) -> None:
    problem = dataclasses.replace(example(spread=spread), overrun_penalty=7.0)
    first, *others = problem.targets
    light = tuple(
        dataclasses.replace(o, window_s=(0.37 * problem.budget.time_s, 1e9)) for o in first.observations
    )
    model = Model.of(
        dataclasses.replace(problem, targets=(dataclasses.replace(first, observations=light), *others))
    )
    grid = Majorant(model, *nodes)
    assert 0.4 * model.e_max_j < grid.g[-1] < 0.95 * model.e_max_j
    rng = np.random.default_rng(11)
    after = rng.uniform(0.0, 10.0, grid.shape)
    after = np.maximum.accumulate(np.maximum.accumulate(after[::-1, ::-1], 0), 1)[::-1, ::-1]
    after[grid.energy > model.e_max_j] = 0.0
    after = after.astype(grid.dtype)
    ((_, drives),) = grid.before_legs([0], 1, 0, after[None])
    made = int(np.flatnonzero(model.obs_place == 1)[0])
    observed = grid.before_observation(made, after, 5.0)
    for values, ln, opens, worth in (
        (drives[0], model.leg_ln[0, 1], 0.0, 0.0),
        (observed, model.obs_ln[made], float(model.window[made, 0]), 5.0),
    ):
        for share_t, share_g in rng.uniform(0.0, 1.0, (60, 2)):
            t, g = share_t * model.t_max_s, share_g * model.e_max_j
            if model.hotel_w * t + g > model.e_max_j:
                continue
            ends_t = max(t, opens) + np.exp(rng.normal(ln[0], ln[1], DRAWS))
            ends_g = g + np.exp(rng.normal(ln[2], ln[3], DRAWS))
            within = (ends_t <= model.t_max_s) & (model.hotel_w * ends_t + ends_g <= model.e_max_j)
            got = np.where(within, worth + _at(grid, after, ends_t, ends_g), -model.penalty)
            above = float(_at(grid, values + model.penalty, np.array([t]), np.array([g]))[0]) - model.penalty
            unseen = 8.0 / DRAWS * (model.penalty + worth + 10.0)  # an overrun may be too rare for any draw
            assert above >= got.mean() - 4.0 * got.std() / DRAWS**0.5 - unseen


@pytest.mark.parametrize("steep", [0.7, 3.0, 20.0])
def test_chances_are_raised_as_little_as_chords_allow_and_none_above_1(steep: float) -> None:
    """Of chances to end that fall in both axes, between gently and at once, and bulge a little."""
    finer, shape, bulge = 4, (9, 7), 1e-3
    at = [np.arange((count - 1) * finer + 1) / finer for count in shape]
    rest = 6.3 - at[0][:, None] - 0.8 * at[1]
    fine = (1.0 / (1.0 + np.exp(-steep * rest))).astype(np.float32)
    nodes = least_above(fine, bulge, finer)

    def holds(nodes: Floats) -> bool:
        """Whether on each fine cell the upper corner is above the lower one's chance, or all above theirs."""
        rows = np.array([np.interp(at[0], range(shape[0]), column) for column in nodes.T]).T
        chord = np.array([np.interp(at[1], range(shape[1]), row) for row in rows])
        over = chord - fine - bulge
        every = np.min([over[:-1, :-1], over[1:, :-1], over[:-1, 1:], over[1:, 1:]], axis=0)
        return bool(np.all((chord[1:, 1:] >= fine[:-1, :-1] - 1e-9) | (every >= -1e-9)))

    assert holds(nodes)
    assert nodes.max() <= 1.0 + 1e-2  # noise of the last turn
    assert np.all(nodes >= fine[::finer, ::finer] - 1e-9)
    for i, j in np.argwhere(nodes > fine[::finer, ::finer] + 1e-3):
        less = nodes.copy()
        less[i, j] -= 1e-3
        assert not holds(less), (i, j)


@pytest.mark.parametrize("family", FAMILIES)
def test_no_policy_earns_more_than_a_coarse_table(family: str) -> None:
    for number in (3, 4):
        problem = generated(family, number)
        for nodes in ((9, 8), (25, 29)):
            table = Policy(Majorant(Model.of(problem), *nodes), moves=Moves.ALL)
            best = optimum(problem)
            assert table.complete
            assert table.best() * (1.0 + 2e-5) >= best - 1e-6 * max(1.0, best)


def test_it_is_closer_than_rounding_down_on_more_nodes() -> None:
    model = Model.of(dataclasses.replace(example(spread=0.4), overrun_penalty=7.0))
    value = Policy(Grid(model, 121, 73, Rounding.MID), moves=Moves.ALL).best()
    down = Policy(Grid(model, 97, 57, Rounding.DOWN), moves=Moves.ALL).best()
    above = Policy(Majorant(model, 57, 66), moves=Moves.ALL).best()
    assert value * 0.9995 < above < down
    assert above - value < 0.5 * (down - value)
    assert upper_bound(model, limit_s=2.0).method == ABOVE
