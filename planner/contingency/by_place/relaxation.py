"""A problem on one resource in which what is remembered depends on where the rover is.

Each place remembers some observations: whether they were made and, where they ask for a track, whether it is
lost; each leg keeps some of those that both its places remember. What a place does not remember, or a leg
does not keep, is forgotten there, and may be made again for a penalty (ng-route relaxation, Baldacci,
Mingozzi and Roberti 2011; the penalties are Lagrange multipliers). Tracks are counted: what is forgotten of a
track is whose it is, not that it is carried, paid for and may be lost. Of a track that was forgotten a place
may assume either, as long as there are as many. For multipliers p >= 0 and chances c that no policy exceeds
(`Model.chances`) every policy that begins with a set of tracks S earns at most

    max over policies of the relaxation of E[sum of (utility - p) over what is made]  +  sum of p c,

the last over the tracked observations of S and all that need no track; the bound is the largest over S. The
resource is that of `priced_relaxation`, and so is what is left out. Values lie above the true ones between
nodes too (`masses_above`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from planner.contingency.by_place.kernels import Drives, Masses, Singles, Tables, backward, forward
from planner.contingency.by_place.layout import Memory, Size, Wanted, lanes_of, layout_of, legs_of
from planner.contingency.by_place.masses_above import FINE, fine_cells, later, masses_above
from planner.contingency.by_place.walks import Walks, walk
from planner.contingency.priced_relaxation import Weights
from planner.evaluate.model import Floats, Ints, Model
from planner.tally import SECONDS, Step, spend

DRAWS = 96
"""Numbers drawn for a walk: one for an observation, two for a drive. By hand: a day has about 15 of each."""


@dataclass(frozen=True, eq=False)
class Actions:
    """What drives and observations take on a grid, whatever is remembered."""

    weights: Weights
    steps: int
    most: int
    drives: Drives
    made: Masses

    @staticmethod
    def of(model: Model, weights: Weights, steps: int, most: int) -> Actions:
        """Return those of a model with so many tracks at most."""
        wanted = Wanted.of(model)
        most = min(most, int(wanted.counted.sum()))
        legs = legs_of(model)
        spend(Step.ELEMENT, len(legs) * (most + 1) * FINE)
        each_s = weights.per_s * model.track_leg_s
        drives = (
            later(cells, c * each_s)
            for cells in (fine_cells(model.leg_ln[leg], weights, steps) for leg in legs)
            for c in range(most + 1)
        )
        above = masses_above(drives, len(legs) * (most + 1), steps + 1, drives=True)
        seen = (fine_cells(model.obs_ln[m], weights, steps) for m in wanted.number)
        made = masses_above(seen, len(wanted.number), steps + 1, drives=False)
        return Actions(weights, steps, most, _side_by_side(above, most + 1), made)


def _side_by_side(masses: Masses, counts: int) -> Drives:
    """Return the masses of drives with each count of tracks, one after the other, side by side."""

    def beside(values: Singles) -> Singles:
        by_leg = values.reshape(-1, counts, values.shape[1]).transpose(0, 2, 1)
        return np.ascontiguousarray(np.pad(by_leg, ((0, 0), (0, 0), (0, lanes_of(counts - 1) - counts))))

    return Drives(
        hat=beside(masses.hat),
        bulge=beside(masses.bulge),
        within=beside(masses.within),
        summed=beside(masses.summed),
        low=masses.low.reshape(-1, counts).min(axis=1),
        high=masses.high.reshape(-1, counts).max(axis=1),
        quick=beside(masses.quick[:, None].astype(np.float32))[:, 0],
    )


class NgRelaxation:
    """The relaxation of a model on a grid, with a memory; multipliers come with each question."""

    def __init__(self, model: Model, actions: Actions, memory: Memory, *, followed: bool = True) -> None:
        """Make the tables; those of the policy only where it is to be `followed`."""
        self.model, self.memory, self.actions = model, memory, actions
        self.weights, self.steps, self.most = actions.weights, actions.steps, actions.most
        self.wanted = wanted = Wanted.of(model)
        self.counted = wanted.counted & (self.most > 0)
        self.size = Size.of(model, memory, self.most, self.steps)
        self.start = self.weights.per_s * model.track_t_s + self.weights.per_j * model.track_e_j
        self.layout = a = layout_of(
            model, wanted, self.counted, memory, self.most, self.steps, self._closes()
        )
        lanes = lanes_of(self.most)
        at_states, on_legs = (int(a.base[-1]), a.nodes, lanes), (int(a.leg_base[-1]), a.nodes, lanes)
        self.tables = Tables(
            np.zeros(at_states, np.float32),
            np.zeros(on_legs, np.float32),
            np.zeros(at_states if followed else (len(at_states), 0, lanes), np.int16),
        )
        self.began, self.limit = (0, 0, 0), self.wanted.chance

    def _closes(self) -> Ints:
        """Return the last node that the beginning of each observation counts for."""
        if not self.weights.timed:
            return np.full(len(self.wanted.number), self.steps, np.int64)
        share = np.clip(self.model.window[self.wanted.number, 1] / self.model.t_max_s, -1.0, 1.0)
        return np.asarray(np.ceil(share * self.steps * (1.0 + 1e-12)), np.int64)

    def bound(self, prices: Floats) -> float:
        """Return what no policy earns more than at these multipliers [wanted], in utility."""
        a, w = self.layout, self.tables
        gain = self.wanted.worth - prices
        spend(Step.PRICED, self.size.seconds / SECONDS[Step.PRICED])
        top = a.penalty + float(np.maximum(gain, 0.0).sum())
        backward(a, self.actions.drives, self.actions.made, gain, top, w)
        best, which = -math.inf, (0, 0)
        for state, gone, c, owed in self._starts(prices):
            at = c * self.start * self.steps
            i = min(int(at), self.steps)
            j = min(i + 1, self.steps)
            here, there = float(w.value[state, i, c]), float(w.value[state, j, c])
            value = here + (at - i) * (there - here) - a.penalty + owed
            if at <= self.steps and value > best:
                best, which, self.began = value, (gone, c), (state, c, i)
        self.limit = self._limit(prices, *which)
        return best

    def _others(self, prices: Floats) -> tuple[list[int], Ints]:
        """Return the tracks that the start remembers, and the other ones, for which most is owed first."""
        own = [m for m in self.memory.at[0] if self.counted[m]]
        others = np.nonzero(self.counted & ~np.isin(np.arange(len(self.counted)), own))[0]
        return own, others[np.argsort(-(prices * self.wanted.chance)[others], kind="stable")]

    def _starts(self, prices: Floats) -> Iterator[tuple[int, int, int, float]]:
        """Yield what a day may begin with: state, the start's tracks that it lacks, count, and what is owed.

        Of the tracks that the start does not remember those are carried for which most is owed.
        """
        owed = prices * self.wanted.chance
        own, others = self._others(prices)
        least = float(owed[~self.counted].sum())
        more = np.concatenate([[0.0], np.cumsum(owed[others])])
        for gone in range(1 << len(own)):
            known = [m for k, m in enumerate(own) if not gone >> k & 1]
            state = sum(1 << self.memory.at[0].index(m) for k, m in enumerate(own) if gone >> k & 1)
            carried = least + float(owed[known].sum())
            for c in range(self.most + 1):
                every = c == self.most and not self.layout.whole
                if every:
                    yield state, gone, c, carried + float(more[-1])
                elif len(known) <= c:
                    yield state, gone, c, carried + float(more[min(c - len(known), len(others))])

    def _limit(self, prices: Floats, gone: int, c: int) -> Floats:
        """Return the chances that no day exceeds [wanted] that begins so."""
        own, others = self._others(prices)
        known = [m for k, m in enumerate(own) if not gone >> k & 1]
        every = c == self.most and not self.layout.whole
        limit = np.where(self.counted, 0.0, self.wanted.chance)
        carried = [*known, *(others if every else others[: c - len(known)])]
        limit[carried] = self.wanted.chance[carried]
        return limit

    def slope(self) -> Floats:
        """Return a subgradient of the last bound [wanted]: chances less how often each is made."""
        mass = np.zeros(self.tables.value.shape, np.float32)
        state, c, i = self.began
        mass[state, i, c] = 1.0
        spend(Step.PRICED, 0.1 * self.size.seconds / SECONDS[Step.PRICED])
        drives, made = self.actions.drives, self.actions.made
        return self.limit - forward(self.layout, drives, made, self.tables, mass)

    def walks(self, count: int, *, rng: np.random.Generator) -> Walks:
        """Return what the policy of the last bound does in so many futures."""
        places = np.full((len(self.memory.at), max(len(own) for own in self.memory.at) + 1), -1)
        for p, own in enumerate(self.memory.at):
            places[p, : len(own)] = own
        draws, out = rng.random((count, DRAWS)), Walks.room(count)
        spend(Step.ELEMENT, count * DRAWS)
        drives, made = self.actions.drives, self.actions.made
        walk(self.layout, drives, made, self.tables, places, self.began, draws, out)
        return out
