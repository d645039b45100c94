"""A problem on one resource in which what is remembered depends on where the rover is.

Each place remembers some observations: whether they were made and, where they ask for a track, whether it is
lost; each leg keeps some of those that both its places remember. What a place does not remember, or a leg
does not keep, is forgotten there, and may be made again for a penalty (ng-route relaxation, Baldacci,
Mingozzi and Roberti 2011; the penalties are Lagrange multipliers). Tracks are counted: what is forgotten of a
track is whose it is, not that it is carried, paid for and may be lost. Of a track that was forgotten a place
may assume either, as long as there are as many. For multipliers p >= 0 and chances c that no policy exceeds
(`Model.chances`) every policy that begins with a set of tracks S earns at most

    max over policies of the relaxation of E[sum of (utility - p) over what is made]  +  sum of p c,

the last over the tracked observations of S and all that need no track; the bound is the largest over S. The p
of a counted track weighs more where visits before are remembered (`visited.py`). With
how many tracks a day begins is decided before anything happens, so each number may have its own multipliers:
the bound is then the largest of the least values by number. The
resource is that of `priced_relaxation`, and so is what is left out. Values lie above the true ones between
nodes too (`masses_above`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from planner.contingency.by_place.kernels import Drives, Masses, Singles, Tables, backward, forward
from planner.contingency.by_place.layout import Memory, Size, Wanted, lanes_of, layout_of, legs_of
from planner.contingency.by_place.masses_above import FINE, LESS_FINE, fine_cells, later, masses_above
from planner.contingency.by_place.walks import Walks, walk
from planner.contingency.priced_relaxation import Weights
from planner.evaluate.model import Floats, Ints, Model
from planner.tally import SECONDS, Step, spend

DRAWS = 96
"""Numbers drawn for a walk: one for an observation, two for a drive. By hand: a day has about 15 of each."""


FORWARD, WALK = 0.2, 1.5
"""What following a policy takes of a question, and what a walk with its excursions takes, in `Step.CALL`. By
hand, on 15 and 30 targets."""


@dataclass(frozen=True, eq=False)
class Actions:
    """What drives and observations take on a grid, whatever is remembered."""

    weights: Weights
    steps: int
    most: int
    drives: Drives
    made: Masses

    @staticmethod
    def of(model: Model, weights: Weights, steps: int, most: int, *, above: bool = True) -> Actions:
        """Return those of a model with so many tracks at most.

        Without `above` values between nodes are not kept above the true ones: what is then found bounds
        nothing, but tells of good multipliers and of what policies forget, on few nodes.
        """
        wanted = Wanted.of(model)
        most = min(most, int(wanted.counted.sum()))
        legs = legs_of(model)
        fine = FINE if above else LESS_FINE
        spend(Step.ELEMENT, 2 * len(legs) * (most + 1) * fine)
        each_s = weights.per_s * model.track_leg_s
        drives = (
            later(cells, c * each_s)
            for cells in (fine_cells(model.leg_ln[leg], weights, steps, fine) for leg in legs)
            for c in range(most + 1)
        )
        driven = masses_above(drives, len(legs) * (most + 1), steps + 1, drives=True, above=above)
        seen = (fine_cells(model.obs_ln[m], weights, steps, fine) for m in wanted.number)
        made = masses_above(seen, len(wanted.number), steps + 1, drives=False, above=above)
        return Actions(weights, steps, most, _side_by_side(driven, most + 1, bulging=above), made)


def _side_by_side(masses: Masses, counts: int, *, bulging: bool) -> Drives:
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
        bulging=bulging,
    )


class _Begun(NamedTuple):
    """How the best days with so many tracks begin."""

    state: int
    lane: int  # the count that is worked out
    node: int
    gone: int  # bits of the tracks that the start remembers and lacks


class NgRelaxation:
    """The relaxation of a model on a grid, with a memory; multipliers come with each question."""

    def __init__(
        self, model: Model, actions: Actions, memory: Memory, *, followed: bool = True, few: bool = False
    ) -> None:
        """Make the tables; those of the policy only where it is to be `followed`.

        Where they are for `few` tracks, they know only days that begin with no more than are counted.
        """
        self.model, self.memory, self.actions = model, memory, actions
        self.weights, self.steps, self.most = actions.weights, actions.steps, actions.most
        self.wanted = wanted = Wanted.of(model)
        self.counted = wanted.counted & (self.most > 0)
        self.size = Size.of(model, memory, self.most, self.steps)
        self.start = self.weights.per_s * model.track_t_s + self.weights.per_j * model.track_e_j
        self.layout = a = layout_of(
            model,
            wanted,
            self.counted,
            memory,
            self.most,
            self.steps,
            self._closes(),
            whole=few or self.most == int(self.counted.sum()),
        )
        lanes = lanes_of(self.most)
        at_states, on_legs = (int(a.base[-1]), a.nodes, lanes), (int(a.leg_base[-1]), a.nodes, lanes)
        self.tables = Tables(
            np.zeros(at_states, np.float32),
            np.zeros(on_legs, np.float32),
            np.zeros(on_legs, np.float32),
            np.zeros(at_states if followed else (len(at_states), 0, lanes), np.int16),
        )
        self.tracks = self.most if few else int(self.counted.sum())
        self.begun: list[_Begun] = []
        self.prices = np.zeros(len(wanted.number))
        self.kept = [frozenset(memory.common(a, b)) for a, b in legs_of(model)]

    @property
    def knows_all(self) -> bool:
        """Whether days may begin with any number of tracks."""
        return self.tracks == int(self.counted.sum())

    def _closes(self) -> Ints:
        """Return the last node that the beginning of each observation counts for."""
        if not self.weights.timed:
            return np.full(len(self.wanted.number), self.steps, np.int64)
        share = np.clip(self.model.window[self.wanted.number, 1] / self.model.t_max_s, -1.0, 1.0)
        return np.asarray(np.ceil(share * self.steps * (1.0 + 1e-12)), np.int64)

    def bound(self, prices: Floats) -> float:
        """Return what no policy earns more than at these multipliers [wanted], in utility."""
        return float(self.by_count(prices).max())

    def by_count(self, prices: Floats) -> Floats:
        """Return what no policy earns more than that begins with 0, 1, 2, ... tracks, in utility.

        `prices` [wanted] are the multipliers. It is -inf where so many tracks take longer than the day.
        """
        a, w = self.layout, self.tables
        gain = self.wanted.worth - prices
        spend(Step.PRICED, self.size.seconds / SECONDS[Step.PRICED])
        top = a.penalty + float(np.maximum(gain, 0.0).sum())
        backward(a, self.actions.drives, self.actions.made, gain, prices, top, w)
        self.prices = prices
        self.begun = [_Begun(0, 0, 0, 0)] * (self.tracks + 1)
        values = np.full(self.tracks + 1, -math.inf)
        for state, gone, count, owed in self._starts(prices):
            at = count * self.start * self.steps
            if at > self.steps or count > self.tracks:
                continue
            i, lane = int(at), min(count, self.most)
            j = min(i + 1, self.steps)
            here, there = float(w.value[state, i, lane]), float(w.value[state, j, lane])
            value = here + (at - i) * (there - here) - a.penalty + owed
            if value > values[count]:
                values[count], self.begun[count] = value, _Begun(state, lane, i, gone)
        return values

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
            for unknown in range(len(others) + 1):
                yield state, gone, len(known) + unknown, carried + float(more[unknown])

    def limit(self, count: int) -> Floats:
        """Return the chances that no day exceeds [wanted] that begins with so many tracks."""
        own, others = self._others(self.prices)
        known = [m for k, m in enumerate(own) if not self.begun[count].gone >> k & 1]
        limit = np.where(self.counted, 0.0, self.wanted.chance)
        carried = [*known, *others[: count - len(known)]]
        limit[carried] = self.wanted.chance[carried]
        return limit

    def often(self, count: int) -> Floats:
        """Return how often the policy of the last bound makes each observation [wanted], by weight, on days
        that begin with so many tracks.

        `limit` less this is a subgradient of the bound.
        """
        mass = np.zeros(self.tables.value.shape, np.float32)
        begun = self.begun[count]
        mass[begun.state, begun.node, begun.lane] = 1.0
        spend(Step.PRICED, FORWARD * self.size.seconds / SECONDS[Step.PRICED])
        return forward(self.layout, self.actions.drives, self.actions.made, self.tables, mass)

    def walks(self, count: int, walks: int, *, rng: np.random.Generator) -> Walks:
        """Return what the policy of the last bound does in so many walks that begin with `count` tracks."""
        places = np.full((len(self.memory.at), max(len(own) for own in self.memory.at) + 1), -1)
        for p, own in enumerate(self.memory.at):
            places[p, : len(own)] = own
        draws, out = rng.random((walks, DRAWS)), Walks.room(walks)
        spend(Step.CALL, WALK * walks)
        drives, made = self.actions.drives, self.actions.made
        begun = self.begun[count]
        begin = begun.state, begun.lane, begun.node
        walk(self.layout, drives, made, self.tables, places, begin, draws, out)
        return out
