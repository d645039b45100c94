"""A problem on one resource, with few observations remembered and a multiplier on every other one.

The remembered ones (`memory`) are live or not, as in the table of the optimal policy; the others may be made
again on every new stay, at a penalty (Lagrangean relaxation, Held and Karp 1971; state space enlarged where
it pays, Christofides, Mingozzi and Toth 1981). For multipliers p >= 0 and chances c that no policy exceeds
(`Model.chances`) every policy earns at most

    max over policies of the relaxation of E[sum of (utility - p) over what is made]  +  sum of p c.

The resource is a share of time and a share of energy, (1 - a) E / E_max + a t / t_max: who keeps within both
budgets keeps within 1. Amounts are rounded down to nodes. What is left out: windows but their end where the
resource is time, limits on volume, fading value, precedence among what is not remembered.

Tracks that are not remembered may be counted: how many are carried is known, and not of which targets. Each
costs its start, and its overhead on every drive. On a drive it is lost with the least chance of any target,
and giving one up is free: no policy has more tracks left than are counted. `most` is the largest count;
where there are more such tracks it stands for that many or more, of which none is lost or used up.
With `most` 0 a track that is not remembered costs its start and one drive's overhead when its observation is
made, which is later than it is paid; not so where somebody may wait for light, and the wait would pay for it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.contingency.priced_kernels import Layout, Singles, Tables, backward, forward
from planner.evaluate.grid import probability_below
from planner.evaluate.model import Floats, Model
from planner.tally import SECONDS, Step, spend

Reals = NDArray[np.floating[Any]]

FINER = 8
"""Cells to a node in which the sum of time and energy of an action is worked out. By hand."""

TAIL = 1e-7
"""Chance of a far move that is put on the last node kept: it only loosens the bound."""

STAYS = 0.5
"""Largest chance that an action moves no node on; beyond it the grid is too coarse for any bound. By hand."""

MOST_HERE = 4
"""Observations of one target with a multiplier, up to which a stay is followed: each doubles its states."""

THINNING = 4.0
"""What a product of the losses of counted tracks takes, in those of a move: its values lie apart in memory.
By hand: with 30 targets 45 s as reckoned took a third more than without counting."""

SURE = 1e-9
"""Share of a cell by which an amount may pass a node, as in `grid.weights_from`."""


@dataclass(frozen=True, slots=True)
class Weights:
    """What of the resource a second and a joule of drive energy take."""

    per_s: float
    per_j: float
    timed: bool

    @staticmethod
    def of(model: Model, time_share: float) -> Weights:
        """Return the weights of a share of time in [0, 1]; the rest is energy."""
        per_j = (1.0 - time_share) / model.e_max_j
        return Weights(time_share / model.t_max_s + per_j * model.hotel_w, per_j, time_share == 1.0)


def _cells(mu: float, sigma: float, scale: float, count: int, step: float) -> Floats:
    """Return the chances that a scaled log-normal lies in cells 0, 1, ... of a width."""
    edges = np.asarray(np.arange(count + 1) * step - SURE * step, np.float64)
    edges[0] = -1.0
    at = mu + math.log(scale) if scale > 0.0 else -math.inf
    return np.asarray(np.diff(probability_below(edges, at, sigma)))


def _banded(rows: Reals) -> Singles:
    """Return rows of masses cut where little is left; what is left is put on the last node kept."""
    tails = np.cumsum(rows[..., ::-1], axis=-1)[..., ::-1]
    band = max(2, int(np.count_nonzero((tails > TAIL).any(axis=tuple(range(rows.ndim - 1))))))
    kept = rows[..., :band].copy()
    kept[..., -1] += rows[..., band:].sum(axis=-1)
    return np.ascontiguousarray(kept, np.float32)


def reckoned_mb(model: Model, nodes: int, memory: tuple[int, ...], most: int = 0) -> float:
    """Return what a relaxation takes at most while it is made and asked, MB, before anything is made.

    That is the masses of its drives, whole and cut off, its tables, and where its policy has been.
    """
    wanted = (model.utility > 0.0) & (model.chances.most > 0.0)
    at = model.obs_place[wanted & ~np.isin(np.arange(model.m), memory)]
    here = np.bincount(at, minlength=model.n + 1)[1:]
    legs = int(model.has_leg[:, 1:].sum())
    tracks = 1 + most + sum(bool(model.is_place[m]) for m in memory)
    vertices = 1.0 + float(np.sum(2.0**here))
    sets = 2.0 ** len(memory) * (most + 1)
    masses = 2.0 * 4.0 * (legs * tracks) + 2.0 * 8.0 * int(wanted.sum())
    return (nodes + 1) * (masses + sets * (4.0 * legs + 16.0 * vertices)) / 1e6


class Relaxation:
    """The relaxation of a model for one resource, grid and memory; multipliers come with each question."""

    def __init__(
        self, model: Model, weights: Weights, nodes: int, memory: tuple[int, ...], most: int = 0
    ) -> None:
        self.model, self.weights, self.steps, self.memory = model, weights, nodes, memory
        self.wanted = np.nonzero((model.utility > 0.0) & (model.chances.most > 0.0))[0]
        self.worth = (model.utility * model.p_success)[self.wanted]
        self.chance = model.chances.most[self.wanted]
        self.number = {m: k for k, m in enumerate(memory)}
        self.bit = np.array([self.number.get(int(m), -1) for m in self.wanted], np.int64)
        self.priced = self.bit < 0
        self.tracks = sum(1 << k for k, m in enumerate(memory) if model.is_place[m])
        self.counted = np.array([self._alone(int(m)) and m not in memory for m in self.wanted], bool)
        self.most = min(most, int(self.counted.sum()))
        self.whole = self.most == int(self.counted.sum())
        if not self.most:
            self.counted[:] = False
        self.start = weights.per_s * model.track_t_s + weights.per_j * model.track_e_j
        self.layout = self._layout()
        self.stay = float(max(self.layout.leg[:, :, 0].max(), self.layout.observation[:, 0].max()))
        sets, count = len(self.layout.carried), nodes + 1
        legs, vertices = len(self.layout.origin), len(self.layout.place)
        self.tables = Tables(
            np.zeros((vertices, sets, count), np.float32),
            np.zeros((legs, sets, count), np.float32),
            np.zeros((vertices, sets, count), np.int32),
        )
        moves = legs * self.layout.leg.shape[2] + len(self.layout.made) * self.layout.observation.shape[1]
        thinned = legs * (1 << len(memory)) * self.most * (self.most + 3) / 2.0
        self.products = float(count * (sets * moves + THINNING * thinned))
        self.seconds = self.products * SECONDS[Step.PRICED]
        """What one question takes of a processor, as reckoned."""
        self.size_mb = sum(table.nbytes for table in self.tables) / 1e6

    def _amounts(self, ln: Floats) -> Floats:
        count = (self.steps + 1) * FINER
        step = 1.0 / (self.steps * FINER)
        seconds = _cells(float(ln[0]), float(ln[1]), self.weights.per_s, count, step)
        joules = _cells(float(ln[2]), float(ln[3]), self.weights.per_j, count, step)
        size = 1 << (2 * count - 1).bit_length()
        both = np.fft.irfft(np.fft.rfft(seconds, size) * np.fft.rfft(joules, size), size)[:count]
        return np.maximum(np.asarray(both), 0.0)

    def _rounded(self, cells: Floats, shift: float) -> Floats:
        """Return masses by nodes moved, with a fixed amount more."""
        moved = math.floor(shift * self.steps * FINER * (1.0 - SURE))
        later = np.zeros_like(cells)
        later[moved:] = cells[: max(0, len(cells) - moved)]
        return np.asarray(later.reshape(self.steps + 1, FINER).sum(axis=1))

    def _alone(self, m: int) -> bool:
        """Say whether an observation asks for a track that no other one asks for."""
        bits = int(self.model.place_bits[self.model.obs_place[m]])
        return bool(self.model.is_place[m]) and bits.bit_count() == 1

    def _thinned(self, legs: list[tuple[int, int]]) -> Floats:
        """Return the chances that so many of so many counted tracks are left, (legs, most + 1, most + 1)."""
        targets = self.model.obs_place[self.wanted[self.counted]]
        thin = np.zeros((len(legs), self.most + 1, self.most + 1))
        lost = np.array([self.model.loss[a, b, targets].min(initial=1.0) for a, b in legs])
        thin[:, 0, 0] = 1.0
        for k in range(1, self.most + 1):
            thin[:, k] = lost[:, None] * thin[:, k - 1]
            thin[:, k, 1:] += (1.0 - lost)[:, None] * thin[:, k - 1, :-1]
        if not self.whole:
            thin[:, self.most] = 0.0
            thin[:, self.most, self.most] = 1.0
        return thin

    def _shift(self, m: int) -> float:
        """Return what the track of an observation that is not remembered takes at least."""
        model = self.model
        waits = self.weights.timed and bool(np.any(model.window[self.wanted, 0] > 0.0))
        if not self._alone(m) or waits or m in self.number or self.most:
            return 0.0
        return self.start + self.weights.per_s * model.track_leg_s

    def _by_count(self, legs: list[tuple[int, int]], more: list[float]) -> Singles:
        """Return the masses of the drives by number of carried tracks, (legs, counts, nodes)."""
        kinds, kind = np.unique([self.model.leg_ln[a, b] for a, b in legs], axis=0, return_inverse=True)
        found = np.empty((len(kinds), len(more), self.steps + 1), np.float32)
        for row, ln in zip(found, kinds, strict=True):  # drives of equal length are alike
            cells = self._amounts(ln)
            for k, shift in enumerate(more):
                row[k] = self._rounded(cells, shift)
        return found[kind.reshape(-1)]

    def _layout(self) -> Layout:
        model, every = self.model, range(self.model.n + 1)
        legs = [(a, b) for a in every for b in every[1:] if a != b and model.has_leg[a, b]]
        count = np.array([(s & self.tracks).bit_count() for s in range(1 << len(self.memory))])
        count = np.concatenate([count + k for k in range(self.most + 1)]).astype(np.int64)
        carried = self.weights.per_s * model.track_leg_s
        leg = self._by_count(legs, [c * carried for c in range(int(count.max()) + 1)])
        made = [self._rounded(self._amounts(model.obs_ln[m]), self._shift(int(m))) for m in self.wanted]
        places = [int(model.obs_place[m]) for m in self.memory]
        loss = [
            [model.loss[a, b, p] if self.tracks >> k & 1 else 0.0 for k, p in enumerate(places)]
            for a, b in legs
        ]
        spend(Step.ELEMENT, FINER * self.steps * 8 * (len(legs) + len(made)))
        before, after, which, place, head = self._vertices()
        return Layout(
            origin=np.array([a for a, _ in legs], np.int64),
            to=np.array([b for _, b in legs], np.int64),
            leg=_banded(leg),
            loss=np.array(loss, float).reshape(len(legs), len(self.memory)),
            before=np.array(before, np.int64),
            after=np.array(after, np.int64),
            made=np.array(which, np.int64),
            place=np.array(place, np.int64),
            head=head,
            observation=_banded(np.array(made)),
            close=self._closes(),
            bit=self.bit,
            need=np.array([self._needed(int(m)) for m in self.wanted], np.int64),
            counted=self.counted,
            thin=self._thinned(legs),
            whole=self.whole,
            carried=count,
            tracks=self.tracks,
            bits=len(self.memory),
            nodes=self.steps + 1,
            penalty=model.penalty,
        )

    def _vertices(self) -> tuple[list[int], list[int], list[int], list[int], np.ndarray]:
        """Return the arcs of observations, and places and what is left to do in a stay as vertices."""
        model = self.model
        before: list[int] = []
        after: list[int] = []
        which: list[int] = []
        place, head = [0], np.zeros(model.n + 1, np.int64)
        at = model.obs_place[self.wanted]
        for p in range(1, model.n + 1):
            here = np.nonzero(at == p)[0].tolist()
            free = [k for k in here if self.priced[k]]
            base, full = len(place), (1 << len(free)) - 1
            head[p] = base + full
            for left in range(full + 1):
                place.append(p)
                for k in here:
                    gone = 1 << free.index(k) if self.priced[k] else 0
                    if left & gone == gone:
                        before.append(base + left)
                        after.append(base + (left ^ gone))
                        which.append(k)
        return before, after, which, place, head

    def _closes(self) -> np.ndarray:
        """Return the last node at which each observation may begin."""
        if not self.weights.timed:
            return np.full(len(self.wanted), self.steps, np.int64)
        share = np.clip(self.model.window[self.wanted, 1] / self.model.t_max_s, -1.0, 1.0)
        return np.asarray(np.floor(share * self.steps * (1.0 + 1e-12)), np.int64)

    def _needed(self, m: int) -> int:
        """Return the remembered observations that must be made before one; those that may be lost are not
        asked for, so that losing a track never opens anything.
        """
        before = int(self.model.predecessors[m])
        return sum(1 << k for k, o in enumerate(self.memory) if before >> o & 1) & ~self.tracks

    @cached_property
    def starts(self) -> tuple[tuple[int, int], ...]:
        """Live sets to begin with, by the targets tracked, and their nodes."""
        images = (1 << len(self.memory)) - 1 - self.tracks
        every = [s for s in range(len(self.layout.carried)) if s & images == images]
        nodes = [
            math.floor(int(self.layout.carried[s]) * self.start * self.steps * (1 - SURE)) for s in every
        ]
        return tuple((s, i) for s, i in zip(every, nodes, strict=True) if i <= self.steps)

    def bound(self, prices: Floats) -> float:
        """Return what no policy earns more than at these multipliers [wanted], in utility, one of each wanted
        observation.
        """
        if self.stay > STAYS:
            return math.inf
        a, w = self.layout, self.tables
        spend(Step.PRICED, self.products)
        backward(a, np.where(self.priced, self.worth - prices, self.worth), self.stay, w)
        return max(float(w.value[0, s, i]) for s, i in self.starts) - a.penalty + self.owed(prices)

    def owed(self, prices: Floats) -> float:
        """Return the sum of multipliers [wanted], in utility, times the chances that no policy exceeds."""
        return float((prices * self.chance)[self.priced].sum())

    def made(self) -> Floats:
        """Return how often the policy of the last question makes each wanted observation."""
        a, w = self.layout, self.tables
        s, i = max(self.starts, key=lambda start: float(w.value[0, start[0], start[1]]))
        mass = np.zeros(w.value.shape)
        mass[0, s, i] = 1.0
        spend(Step.NODE, self.steps * self.steps)
        return np.asarray(forward(a, w.choice, mass))
