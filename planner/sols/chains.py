"""The best chain of drives, observations and nights through all sols, for given rewards of each.

A chain goes through the states of `chain_kernels` and sees what its actions took: time, or energy drawn. It
is free in all else: the other resource, and what it observed out of its memory. What holds for every policy
in the mean is charged for by rewards (`path_bound`).

Every policy is a chain. From between two nodes an action that takes x, rounded down to j nodes, comes to the
cell j nodes on or to the next one; `reached` is the better of both. Where the true action fails for what the
chain does not see, the sol ends, and the chain takes the better of both outcomes. It may throw charge away
overnight, and has as much to begin with as the morning can have.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from functools import cached_property

import numpy as np
from scipy.special import ndtr

from planner.evaluate.model import Floats, Ints, Truths
from planner.sols.chain_kernels import Memory, Moves, Rewards, best_chain, followed
from planner.sols.flow_program import FlowProgram
from planner.sols.path_problem import PathProblem
from planner.tally import SECONDS, Step, spend

TAIL, COARSE_TAIL = 1e-10, 1e-3
"""Chance of far moves that is put on the nearest one kept, and the same where values need not be sure."""

SAME = 1e-12
"""Relative difference of a constant duration from a node that counts as none."""

FAR, APART, MOST_APART = 7.0, 0.35, 2001
"""Standard deviations of a duration to which energies are looked at, most between two, and most of them."""

BY_ROW = 120.0
"""What a node of one action's chances takes, in elements (`Step.ELEMENT`). Measured on energies."""

AT_A_NODE = 24.0
"""What one move to one node takes in those of a large matrix (`Step.NODE`). Measured on 81 to 801 nodes."""

CHOSEN = 24.0
"""The same for a choice between two drives at one state."""


class Along(Enum):
    """What a chain's nodes count: the time of the sol, or the energy drawn since the fullest morning."""

    TIME = "time"
    CHARGE = "charge"


@dataclass(frozen=True, eq=False)
class Followed:
    """What the best chain does in the mean: columns of the flow program, and seconds waited by sol (K,)."""

    columns: Floats
    waited_s: Floats


class Chains:
    """Best chains of one problem on grids of so many `nodes`; at a place up to `remembered` observations.

    The value is at least that of every chain: amounts are rounded down to nodes. With `like`, it is about
    what a grid of so many nodes would give: amounts are as much smaller as rounding there makes them in the
    mean, and rounded to the nearest node.
    """

    def __init__(
        self, flow: FlowProgram, along: Along, *, nodes: int, remembered: int, like: int | None = None
    ) -> None:
        self.flow, self.path, self.along, self.sure = flow, flow.path, along, like is None
        path, sols, places = self.path, self.path.sols, self.path.model.n + 1
        if along is Along.TIME:
            self.step = path.time_s / (nodes - 1)
        else:
            spans = [max(path.most_j(k) - float(path.reserve_j[k]), 1e-6) for k in range(sols)]
            self.step = np.array(spans) / (nodes - 1)
        self.memory = _memory(path, remembered)
        has_leg = np.zeros((places, places), np.bool_)
        has_leg[flow.origin, flow.to] = True
        by_step: dict[float, Moves] = {}
        for step in self.step.tolist():
            if step not in by_step:
                shift = 0.0 if like is None else 0.5 * step * ((nodes - 1) / (like - 1) - 1.0)
                by_step[step] = _moves(path, along, has_leg, step, nodes, shift, sure=like is None)
        self.moves = [by_step[step] for step in self.step.tolist()]
        shape = (sols, places, int(self.memory.sets.max()), nodes)
        self.value, self.reached, self.ends = np.zeros(shape), np.zeros(shape), np.zeros(shape)
        self.act = np.zeros(shape, np.int16)
        self.mornings = [self._morning(k, nodes) for k in range(sols - 1)]
        self.rewards: list[Rewards] = []

    def _morning(self, k: int, nodes: int) -> Ints:
        """Return the node of the next morning for each node of a sol, (nodes,)."""
        if self.along is Along.TIME:
            return np.zeros(nodes, np.int64)
        path = self.path
        left = np.maximum(path.most_j(k) - self.step[k] * np.arange(nodes), path.reserve_j[k])
        morning = np.minimum(path.rests[k].ceiling_j, left + path.rests[k].gain_j)
        drawn = (path.most_j(k + 1) - morning) / self.step[k + 1] + (0.0 if self.sure else 0.5)
        return np.clip(np.floor(drawn), 0, nodes - 1).astype(np.int64)

    def best(self, worth: Floats, wait_w: Floats) -> float:
        """Return what the best chain earns for rewards of the flow's columns, in utility; `wait_w` (K,) is
        what a second of waiting takes from it. Infinite where chains without end pay.
        """
        flow, sols = self.flow, self.path.sols
        self.rewards = [self._rewards(k, worth, float(wait_w[k])) for k in range(sols)]
        for k in range(sols - 1, -1, -1):
            self.ends[k] = worth[flow.e[k]][:, None, None]
            if k + 1 < sols:
                later = self.reached[k + 1][:, :, self.mornings[k]]
                # charge may be thrown away overnight: an end is worth no less than one with more drawn
                self.ends[k] += np.maximum.accumulate(later[:, :, ::-1], axis=2)[:, :, ::-1]
            if not best_chain(
                self.moves[k], self.memory, self.rewards[k], self.ends[k], self.sure, self.value[k],
                self.reached[k], self.act[k],
            ):  # fmt: skip
                return math.inf
        spend(Step.NODE, self._products)
        return float(self.reached[0, 0, 0, 0])

    def _rewards(self, k: int, worth: Floats, wait_w: float) -> Rewards:
        flow, path, step = self.flow, self.path, float(self.step[k])
        leg = np.zeros((path.model.n + 1,) * 2)
        leg[flow.origin, flow.to] = worth[flow.x[k]]
        last = self.value.shape[3] - 1.0
        opens, closes = np.clip(path.window[k] / step, -1.0, last).T
        if self.along is Along.CHARGE:
            opens, closes = np.zeros_like(opens), np.full_like(closes, last)
        return Rewards(
            leg,
            worth[flow.y[k]],
            wait_w * step,
            np.maximum(np.floor(opens), 0.0).astype(np.int64),
            np.where(path.allowed[k], np.floor(closes), -1.0).astype(np.int64),
        )

    def follow(self) -> Followed:
        """Return what the chain of the last call of `best` does."""
        flow, path, model = self.flow, self.path, self.path.model
        columns, waited = np.zeros(flow.count), np.zeros(path.sols)
        chance = np.zeros(self.ends.shape[1:])
        chance[0, 0, 0] = 1.0
        for k in range(path.sols):
            driven, made = np.zeros((model.n + 1,) * 2), np.zeros(model.m)
            ended = np.zeros_like(chance)
            nodes = followed(
                self.moves[k], self.memory, self.rewards[k], self.ends[k], self.reached[k], self.act[k],
                chance, driven, made, ended,
            )  # fmt: skip
            waited[k] = nodes * self.step[k] if self.along is Along.TIME else 0.0
            columns[flow.x[k]], columns[flow.y[k]] = driven[flow.origin, flow.to], made
            columns[flow.e[k]] = ended.sum(axis=(1, 2))
            chance = np.zeros_like(ended)
            if k + 1 < path.sols:
                for node, morning in enumerate(self.mornings[k]):
                    chance[:, :, morning] += ended[:, :, node]
        spend(Step.NODE, 0.2 * self._products)
        return Followed(columns, waited)

    @property
    def seconds(self) -> float:
        """Reckoned seconds of a processor that one call of `best` takes."""
        return self._products * SECONDS[Step.NODE]

    @cached_property
    def _products(self) -> float:
        """What one call of `best` takes, in products of a large matrix."""
        nodes, total = self.value.shape[3], 0.0
        own = self.memory.sets[self.path.model.obs_place]
        for moves in self.moves:
            legs = np.diff(moves.leg_span, axis=2)[:, :, 0] * self.memory.classes * moves.has_leg
            observed = np.diff(moves.obs_span, axis=1)[:, 0] * own
            total += AT_A_NODE * nodes * float(legs.sum() + observed.sum())
            total += CHOSEN * nodes * float(self.memory.sets @ moves.has_leg.sum(axis=1))
        return total


def _below(ln: Floats, edges: Floats) -> Floats:
    """Return the chances of a log-normal to be below edges; `ln` (2,) is of its logarithm."""
    if ln[1] <= 0.0:
        amount = 0.0 if math.isinf(ln[0]) else math.exp(float(ln[0]))
        return (edges > amount * (1.0 + SAME)).astype(np.float64)
    with np.errstate(divide="ignore"):
        return np.asarray(ndtr((np.log(np.maximum(edges, 0.0)) - ln[0]) / ln[1]))


def _drawn_below(ln: Floats, hotel_w: float, edges: Floats) -> Floats:
    """Return the chances of G + hotel_w X to be below edges; `ln` (4,) is of X, then of G.

    Sums over X at equal distances of its normal variable are exact to the tails where the distances are not
    wider than what the chances of G bend over.
    """
    mean_x, mean_g = (float(np.exp(ln[k] + 0.5 * ln[k + 1] ** 2)) for k in (0, 2))
    deviation = float(ln[1])
    if deviation <= 0.0:
        return _below(ln[2:], edges - hotel_w * mean_x)
    if ln[3] <= 0.0:
        return _below(ln[:2], (edges - mean_g) / hotel_w) if hotel_w > 0.0 else _below(ln[2:], edges)
    bends = min(APART, ln[3] * mean_g / max(hotel_w * deviation * mean_x, 1e-300))
    z = np.linspace(-FAR, FAR, min(int(2.0 * FAR / bends) + 2, MOST_APART))
    share = np.exp(-0.5 * z**2)
    rest = edges[:, None] - hotel_w * np.exp(ln[0] + deviation * z)
    return np.asarray(_below(ln[2:], rest) @ (share / share.sum()))


def _moves(
    path: PathProblem, along: Along, has_leg: Truths, step: float, nodes: int, shift: float, *, sure: bool
) -> Moves:
    model = path.model
    edges: Floats = np.arange(nodes + 1, dtype=np.float64) * step + shift

    def row(ln: Floats) -> tuple[Floats, tuple[int, int]]:
        """Return chances to move on by nodes, and the span of those that are not faint."""
        below = _below(ln, edges) if along is Along.TIME else _drawn_below(ln, model.hotel_w, edges)
        chance = np.diff(below)
        chance[0] += below[0]
        if not sure:
            chance[1], chance[0] = chance[1] + chance[0], 0.0  # no move stays at its node
        kept = np.nonzero(chance > (TAIL if sure else COARSE_TAIL))[0]
        if not len(kept):
            return chance, (0, 0)
        low, high = int(kept[0]), int(kept[-1]) + 1
        chance[low] += chance[:low].sum()
        chance[high - 1] += chance[high:].sum()
        chance[:low] = chance[high:] = 0.0
        return chance, (low, high)

    places = model.n + 1
    leg, leg_span = np.zeros((places, places, nodes)), np.zeros((places, places, 2), np.int64)
    obs, obs_span = np.zeros((model.m, nodes)), np.zeros((model.m, 2), np.int64)
    for a, b in np.argwhere(has_leg).tolist():
        leg[a, b], leg_span[a, b] = row(model.leg_ln[a, b])
    for m in range(model.m):
        obs[m], obs_span[m] = row(model.obs_ln[m])
    spend(Step.ELEMENT, BY_ROW * float(nodes * (has_leg.sum() + model.m)))
    in_time = np.zeros((places, places, nodes + 1))
    in_time[:, :, 1:] = np.cumsum(leg, axis=2)
    return Moves(leg, in_time, leg_span, obs, obs_span, has_leg, model.fail > 0.0)


def _memory(path: PathProblem, remembered: int) -> Memory:
    """Return what places remember: their own observations, then those of the nearest places."""
    model = path.model
    places = model.n + 1
    far_s = np.where(model.has_leg, model.leg[:, :, 0], np.inf)
    np.fill_diagonal(far_s, -1.0)
    wanted = np.nonzero((model.utility * model.p_success > 0.0) & path.allowed.any(axis=0))[0]
    near: list[list[int]] = []
    for p in range(places):
        away = np.minimum(far_s[p], far_s[:, p])[model.obs_place[wanted]]
        order = np.argsort(away, kind="stable")[:remembered]
        near.append([int(wanted[i]) for i in order if p and math.isfinite(away[i])])
    sets = np.array([1 << len(row) for row in near], np.int64)
    most = int(sets.max())
    count = np.ones((places, places), np.int64)
    kept, there, here = (np.zeros((places, places, most), np.int64) for _ in range(3))
    for a in range(places):
        for b in range(places):
            both = [m for m in near[a] if m in near[b]]
            count[a, b] = 1 << len(both)
            for number, m in enumerate(both):
                kept[a, b] |= (np.arange(most) >> near[a].index(m) & 1) << number
                there[a, b] |= (np.arange(most) >> number & 1) << near[b].index(m)
                here[a, b] |= (np.arange(most) >> number & 1) << near[a].index(m)
    at = [np.nonzero(model.obs_place == p)[0].tolist() for p in range(places)]
    own = np.full((places, max(map(len, at))), -1, np.int64)
    bit = np.zeros(model.m, np.int64)
    for p, row in enumerate(at):
        own[p, : len(row)] = row
        for m in row:
            bit[m] = 1 << near[p].index(m) if m in near[p] else 0
    return Memory(sets, count, kept, there, here, own, bit)
