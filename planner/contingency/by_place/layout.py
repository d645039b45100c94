"""States and moves of the ng-route relaxation: which observations are remembered where."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Set
from dataclasses import dataclass, replace

import numpy as np

from planner.contingency.by_place.kernels import BLOCK, LANES, Layout, Singles
from planner.contingency.by_place.visited import lengths, weights_at
from planner.evaluate.model import Floats, Ints, Model, Truths
from planner.tally import SECONDS, Step


@dataclass(frozen=True, slots=True)
class Memory:
    """The wanted observations, by their number there, that are remembered, and where.

    `at` holds those of each place, its own among them; `on` those that are not forgotten on a leg, of those
    that both its places remember. Without `on` that is all of them; a leg that it does not name keeps none.
    """

    at: tuple[tuple[int, ...], ...]
    on: Mapping[tuple[int, int], Set[int]] | None = None

    @staticmethod
    def of(at: Iterable[Iterable[int]], on: Mapping[tuple[int, int], Set[int]] | None = None) -> Memory:
        """Return a memory of what each place remembers, in order, and of what is kept on legs."""
        return Memory(tuple(tuple(own) for own in at), on)

    def common(self, a: int, b: int) -> list[int]:
        """Return what is remembered all along a leg, in order."""
        kept = self.at[b] if self.on is None else self.on.get((a, b), ())
        return sorted(m for m in self.at[a] if m in kept and m in self.at[b])


EACH, WAY, STATE = 0.6, 22.0, 57.0
"""What a product of a drive takes, in moves of `Step.PRICED`, and what a leg-state and a state take at each
node. By hand, on 15 and 30 targets with 65 and 385 nodes at load 10, where tables do not fit into the
processor's cache."""


@dataclass(frozen=True, eq=False)
class Wanted:
    """The observations that can win anything, in the order of their places."""

    number: Ints  # (wanted,) in the model
    place: Ints
    worth: Floats  # utility times chance of success
    chance: Floats  # what no policy exceeds
    counted: Truths  # asks for a track that no other one asks for

    @staticmethod
    def of(model: Model) -> Wanted:
        able = np.nonzero((model.utility > 0.0) & (model.chances.most > 0.0))[0]
        number = np.asarray(able[np.argsort(model.obs_place[able], kind="stable")])
        place = model.obs_place[number]
        alone = np.array([int(model.place_bits[p]).bit_count() == 1 for p in place], bool)
        worth = (model.utility * model.p_success)[number]
        return Wanted(number, place, worth, model.chances.most[number], model.is_place[number] & alone)


@dataclass(frozen=True, slots=True)
class Size:
    """What a relaxation has of states and of leg-states, for each count of tracks and node."""

    legs: int
    counts: int  # of tracks, idle ones among them
    nodes: int
    states: float
    ways: float

    @staticmethod
    def of(model: Model, memory: Memory, most: int, steps: int) -> Size:
        """Return the size of a relaxation before anything is made."""
        counts = lanes_of(min(most, int(Wanted.of(model).counted.sum())))
        states = sum(2.0 ** len(own) for own in memory.at)
        legs = legs_of(model)
        ways = sum(2.0 ** len(memory.common(a, b)) for a, b in legs)
        return Size(len(legs), counts, steps + 1, states, ways)

    def with_more(self, states: float, ways: float) -> Size:
        """Return the size with so many more states and leg-states."""
        return replace(self, states=self.states + states, ways=self.ways + ways)

    @property
    def seconds(self) -> float:
        """What a question takes of a processor, as reckoned."""
        drives = self.ways * (EACH * self.nodes + WAY)
        return self.counts * self.nodes * (drives + STATE * self.states) * SECONDS[Step.PRICED]

    @property
    def table_mb(self) -> float:
        """What the tables of a policy that is followed take, and masses of drives while they are made, MB."""
        return self.bound_mb + self.counts * self.nodes * 6.0 * self.states / 1e6

    @property
    def bound_mb(self) -> float:
        """The same where the bound alone is asked for."""
        each = 4.0 * self.states + 8.0 * self.ways + 48.0 * self.legs
        return self.counts * (self.nodes * each + 8.0 * BLOCK * self.ways) / 1e6


def lanes_of(most: int) -> int:
    """Return how many counts of tracks are worked out where so many are the most."""
    return -(-(most + 1) // LANES) * LANES


def legs_of(model: Model) -> list[tuple[int, int]]:
    """Return the legs that lead to a place, in order of their origin."""
    every = range(model.n + 1)
    return [(a, b) for a in every for b in every[1:] if a != b and model.has_leg[a, b]]


def layout_of(
    model: Model,
    wanted: Wanted,
    counted: Truths,
    memory: Memory,
    most: int,
    steps: int,
    close: Ints,
    *,
    whole: bool,
) -> Layout:
    """Return states and moves; `most` tracks are counted; `close` [wanted] is the last node to begin at.

    The largest count is a number where it is `whole`, else that many or more.
    """
    legs = legs_of(model)
    bits = np.array([len(own) for own in memory.at], np.int64)
    base = np.concatenate([[0], np.cumsum(1 << bits)])
    alive = np.zeros(int(base[-1]), np.int64)
    tracked = np.full((len(memory.at), max(1, int(bits.max()))), -1)
    for p, own in enumerate(memory.at):
        held = [j for j, m in enumerate(own) if counted[m]]
        tracked[p, : len(held)] = held
        for j in held:
            alive[base[p] : base[p + 1]] += 1 - (np.arange(1 << bits[p]) >> j & 1)
    ways = _Ways(model, wanted, counted, memory, base)
    for a, b in legs:
        ways.add(a, b)
    origin = np.array([a for a, _ in legs], np.int64)
    places = np.arange(len(memory.at) + 1)
    return Layout(
        base=base,
        bits=bits,
        origin=origin,
        first_leg=np.searchsorted(origin, places),
        leg_base=np.array(ways.leg_base, np.int64),
        key_base=np.array(ways.key_base, np.int64),
        key=np.concatenate(ways.keys),
        held=np.array(ways.held, np.int64),
        common=np.array(ways.common, np.int64),
        lasting=np.array(ways.lasting, float),
        way_base=np.array(ways.way_base, np.int64),
        way=np.array(ways.way, np.int64),
        arrival=np.array(ways.arrival, np.int64),
        living=np.array(ways.living, np.int64),
        turn=np.array(sorted(range(len(legs)), key=lambda e: ways.way_base[e]), np.int64),
        alive=alive,
        tracked=tracked,
        thin=_thinned(model, wanted.place[counted], legs, most, whole),
        first_made=np.searchsorted(wanted.place, places),
        bit=np.array([memory.at[p].index(m) for m, p in enumerate(wanted.place)], np.int64),
        counted=counted,
        weight=_weights(model, wanted, counted, memory, base),
        close=close,
        whole=whole,
        counts=most + 1,
        nodes=steps + 1,
        penalty=model.penalty,
    )


def _weights(model: Model, wanted: Wanted, counted: Truths, memory: Memory, base: Ints) -> Singles:
    """Return how much a multiplier weighs in each state, at least 1, (states, observations of a place).

    It weighs more for a counted track whose chance nothing but its survival limits (`visited.py`).
    """
    first = np.searchsorted(wanted.place, np.arange(len(memory.at) + 1))
    weight = np.ones((int(base[-1]), max(1, int(np.diff(first).max()))))
    image = ~model.is_place[wanted.number]
    survival = model.chances.survival[wanted.number]
    for m in np.nonzero(counted & (wanted.chance >= survival))[0]:
        p = int(wanted.place[m])
        places = np.array([wanted.place[o] if image[o] else -1 for o in memory.at[p]], np.int64)
        weight[base[p] : base[p + 1], m - first[p]] = weights_at(lengths(model, p), p, places)
    return weight.astype(np.float32)


class _Ways:
    """What is known on each leg, and the states that it may turn out to be on arrival.

    Known are what both its places remember, and whether the track of the place itself lives. What the place
    remembers besides is found on arrival, at its best: nothing of it was made, its tracks live or not.
    """

    def __init__(self, model: Model, wanted: Wanted, counted: Truths, memory: Memory, base: Ints) -> None:
        self.model, self.wanted, self.counted, self.memory, self.base = model, wanted, counted, memory, base
        self.widest = max(len(own) for own in memory.at) + 1
        self.leg_base, self.way = [0], [0]
        self.key_base: list[int] = []
        self.keys: list[Ints] = []
        self.held: list[int] = []
        self.common: list[int] = []
        self.lasting: list[list[float]] = []
        self.way_base: list[int] = []
        self.arrival: list[int] = []
        self.living: list[int] = []
        self.ends: list[tuple[int, tuple[int, ...]]] = []  # where each leg leads, and what is known on it
        self.seen: dict[tuple[int, tuple[int, ...]], int] = {}

    def add(self, a: int, b: int) -> None:
        """Add a leg."""
        here, there = self.memory.at[a], self.memory.at[b]
        common = self.memory.common(a, b)
        tracks = [m for m in there if self.counted[m]]
        known = common + [m for m in tracks if self.wanted.place[m] == b and m not in common]
        sets = np.arange(1 << len(here))
        key = np.zeros(len(sets), np.int64)
        for j, m in enumerate(common):
            key |= (sets >> here.index(m) & 1) << j
        self.key_base.append(sum(len(keys) for keys in self.keys))
        self.keys.append(key + self.leg_base[-1])
        self.leg_base.append(self.leg_base[-1] + (1 << len(common)))
        place, loss = self.wanted.place, self.model.loss
        lasting = [float(loss[a, b, place[m]]) if self.counted[m] else -1.0 for m in known]
        self.lasting.append(lasting + [-1.0] * (self.widest - len(known)))
        self.held.append(len(known))
        self.common.append(len(common))
        self.ends.append((b, tuple(known)))
        if self.ends[-1] in self.seen:
            self.way_base.append(self.seen[self.ends[-1]])
            return
        self.way_base.append(len(self.way) - 1)
        self.seen[self.ends[-1]] = len(self.way) - 1
        options = [0]
        for m in tracks:
            if m not in known:
                options += [o | 1 << there.index(m) for o in options]
        for gone in range(1 << len(known)):
            at = sum(1 << there.index(m) for j, m in enumerate(known) if gone >> j & 1)
            self.arrival += [int(self.base[b]) + (at | o) for o in options]
            self.way.append(len(self.arrival))
            self.living.append(sum(not gone >> j & 1 for j, m in enumerate(known) if self.counted[m]))


def _thinned(model: Model, targets: Ints, legs: list[tuple[int, int]], most: int, whole: bool) -> Singles:
    """Return the chances that so many of so many other tracks are left, (legs, most + 1, most + 1)."""
    thin = np.zeros((len(legs), most + 1, most + 1))
    lost = np.array([model.loss[a, b, targets].min(initial=1.0) for a, b in legs])
    thin[:, 0, 0] = 1.0
    for k in range(1, most + 1):
        thin[:, k] = lost[:, None] * thin[:, k - 1]
        thin[:, k, 1:] += (1.0 - lost)[:, None] * thin[:, k - 1, :-1]
    if not whole:
        thin[:, most] = 0.0
        thin[:, most, most] = 1.0
    return thin.astype(np.float32)
