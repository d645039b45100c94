"""A problem on one resource in which what is remembered depends on where the rover is.

Each place remembers some observations: whether they were made and, where they ask for a track, whether it is
lost. What a place does not remember is forgotten there, and may be made again for a penalty (ng-route
relaxation, Baldacci, Mingozzi and Roberti 2011; the penalties are Lagrange multipliers). Tracks are counted:
what is forgotten of a track is whose it is, not that it is carried, paid for and may be lost. Of a track that
was forgotten a place may assume either, as long as there are as many. For multipliers p >= 0 and chances c
that no policy exceeds (`Model.chances`) every policy that begins with a set of tracks S earns at most

    max over policies of the relaxation of E[sum of (utility - p) over what is made]  +  sum of p c,

the last over the tracked observations of S and all that need no track; the bound is the largest over S. The
resource is that of `priced_relaxation`, and so is what is left out. Values lie above the true ones between
nodes too (`masses_above`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from planner.contingency.by_place.kernels import Tables, backward, forward
from planner.contingency.by_place.layout import Memory, Size, Wanted, layout_of
from planner.contingency.by_place.masses_above import fine_cells, later, masses_above
from planner.contingency.priced_relaxation import Weights
from planner.evaluate.model import Floats, Ints, Model
from planner.tally import SECONDS, Step, spend


class NgRelaxation:
    """The relaxation of a model for a resource, a grid and a memory; multipliers come with each question."""

    def __init__(self, model: Model, weights: Weights, steps: int, memory: Memory, most: int) -> None:
        self.model, self.weights, self.steps, self.memory = model, weights, steps, memory
        self.wanted = wanted = Wanted.of(model)
        self.most = min(most, int(wanted.counted.sum()))
        self.counted = wanted.counted & (self.most > 0)
        self.size = Size.of(model, memory, most, steps)
        self.start = weights.per_s * model.track_t_s + weights.per_j * model.track_e_j
        self.layout = a = layout_of(model, wanted, self.counted, memory, self.most, steps, self._closes())
        spend(Step.ELEMENT, 8 * len(a.origin) * a.counts * steps * 8)
        drives = []
        for at, b in np.argwhere(model.has_leg[:, 1:]):
            if at != b + 1:
                cells = fine_cells(model.leg_ln[at, b + 1], weights, steps)
                drives += [later(cells, c * weights.per_s * model.track_leg_s) for c in range(a.counts)]
        self.drives = masses_above(drives, a.nodes, drives=True)
        made = [fine_cells(model.obs_ln[m], weights, steps) for m in wanted.number]
        self.made = masses_above(made, a.nodes, drives=False)
        at_states, on_legs = (int(a.base[-1]), a.counts, a.nodes), (int(a.leg_base[-1]), a.counts, a.nodes)
        self.tables = Tables(
            np.zeros(at_states, np.float32),
            np.zeros(at_states, np.float32),
            np.zeros(on_legs, np.float32),
            np.zeros(on_legs, np.float32),
            np.zeros(at_states, np.int32),
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
        w.kink[:] = 0.0
        w.bend[:] = 0.0
        backward(a, self.drives, self.made, gain, a.penalty + float(np.maximum(gain, 0.0).sum()), w)
        best = -math.inf
        for state, c, limit in self._starts(prices):
            at = c * self.start * self.steps
            i = min(int(at), self.steps)
            j = min(i + 1, self.steps)
            here, there = w.value[state, c, i], w.value[state, c, j]
            value = float(here + (at - i) * (there - here)) - a.penalty + float(prices @ limit)
            if at <= self.steps and value > best:
                best, self.began, self.limit = value, (state, c, i), limit
        return best

    def _starts(self, prices: Floats) -> Iterator[tuple[int, int, Floats]]:
        """Yield what a day may begin with: state, count, and the chances that no such day exceeds [wanted].

        Of the tracks that the start does not remember those are carried for which most is owed.
        """
        chance, counted = self.wanted.chance, self.counted
        own = [m for m in self.memory[0] if counted[m]]
        others = np.nonzero(counted & ~np.isin(np.arange(len(counted)), own))[0]
        others = others[np.argsort(-(prices * chance)[others], kind="stable")]
        for gone in range(1 << len(own)):
            state = sum(1 << self.memory[0].index(m) for k, m in enumerate(own) if gone >> k & 1)
            known = [m for k, m in enumerate(own) if not gone >> k & 1]
            for c in range(self.most + 1):
                every = c == self.most and not self.layout.whole
                if len(known) > c and not every:
                    continue
                limit = np.where(counted, 0.0, chance)
                carried = [*known, *(others if every else others[: c - len(known)])]
                limit[carried] = chance[carried]
                yield state, c, limit

    def slope(self) -> Floats:
        """Return a subgradient of the last bound [wanted]: chances less how often each is made."""
        mass = np.zeros(self.tables.value.shape)
        mass[self.began] = 1.0
        spend(Step.PRICED, 0.1 * self.size.seconds / SECONDS[Step.PRICED])
        return self.limit - np.asarray(forward(self.layout, self.drives, self.made, self.tables, mass))
