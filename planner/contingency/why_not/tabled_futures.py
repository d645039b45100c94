"""Futures as tables in which each amount is spread evenly over its odds.

Every amount of every action takes each of as many equally likely values once, in an order of its own, and a
track is lost on a drive in its exact share of the futures (Latin hypercube: McKay, Beckman and Conover 1979).
Values of orders are off by half to two thirds of what they are off in as many futures drawn at random.
Tables may be nested (Qian 2009): their first futures are spread as evenly as so few can be.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.special import ndtri

from planner.evaluate.hashing import bits, uniform
from planner.evaluate.model import Floats, Ints, Model, Truths
from planner.evaluate.rollout import SOL_COUNTER, World, key_of, kind_of


class TabledFutures(NamedTuple):
    """Amounts of N futures; those of a drive are worked out when one first asks for it (`ready`).

    `lost` are bits: of places whose tracks the drive loses, and bit 0 where it fails. `load` is the factor of
    the kind of sol on the hotel load and on the starts of tracks; `slow` and `hungry` are those on drives.
    """

    seed: int
    levels: Ints  # (L,) rising numbers of futures, of which as many are spread evenly by themselves; N last
    deviates: Floats  # (N,) of the standard normal, in rising order
    ready: Truths  # (n + 1, n + 1)
    leg_s: Floats  # (n + 1, n + 1, N)
    leg_j: Floats
    lost: Ints
    obs_s: Floats  # (m, N)
    obs_j: Floats
    load: Floats  # (N,)
    slow: Floats
    hungry: Floats

    @staticmethod
    def of(model: Model, count: int, *, seed: int, nested: tuple[int, ...] = ()) -> TabledFutures:
        """Return so many futures of a seed; the first `nested`, which divide each other and `count`, are
        spread evenly by themselves.
        """
        n1, m = model.n + 1, model.m
        deviates = ndtri((np.arange(count) + 0.5) / count)
        deviates /= deviates.std() or 1.0  # the middles of equal shares scatter less than their contents
        legs, observations = (n1, n1, count), (m, count)
        futures = TabledFutures(
            seed, np.array((*nested, count), np.int64), deviates, np.zeros((n1, n1), np.bool_),
            np.empty(legs), np.empty(legs), np.empty(legs, np.int64), np.empty(observations),
            np.empty(observations), np.ones(count), np.ones(count), np.ones(count),
        )  # fmt: skip
        _begin(World.of(model, model.utility * model.p_success), futures)
        return futures


@njit(cache=True, nogil=True)
def _shuffled(seed: int, counter: int, levels: Ints) -> Ints:
    """Return the numbers below the last of `levels` in an order of its own for each counter (Fisher and
    Yates), of which the first of each level lie one in each of as many equal parts.
    """
    key, count = key_of(seed, counter), levels[-1]
    found, filled, drawn = np.empty(count, np.int64), 0, 0
    for level in levels:
        width = count // level
        taken = np.zeros(level, np.bool_)
        for f in range(filled):
            taken[found[f] // width] = True
        cells = np.flatnonzero(~taken)
        for k in range(len(cells) - 1, 0, -1):
            other = int(bits(key, drawn + k) >> np.uint64(33)) * (k + 1) >> 31
            cells[k], cells[other] = cells[other], cells[k]
        drawn += len(cells)
        for k in range(len(cells)):
            within = int(bits(key, drawn + k) >> np.uint64(33)) * width >> 31 if width > 1 else 0
            found[filled + k] = cells[k] * width + within
        drawn += len(cells)
        filled = level
    return found


@njit(cache=True, nogil=True)
def _begin(world: World, futures: TabledFutures) -> None:
    """Write what does not depend on drives: kinds of sols and observations."""
    count, n1 = futures.deviates.shape[0], world.n + 1
    if world.sols.chance.shape[0] > 0:
        rank = _shuffled(futures.seed, SOL_COUNTER, futures.levels)
        for f in range(count):
            kind = kind_of(world.sols.chance, (rank[f] + 0.5) / count)
            futures.load[f] = world.sols.energy[kind]
            futures.slow[f] = world.sols.drive_time[kind]
            futures.hungry[f] = world.sols.drive_energy[kind] * world.sols.energy[kind]
    for i in range(world.obs_ln.shape[0]):
        base, ln = 16 + n1 * n1 * (n1 + 2) + 2 * i, world.obs_ln[i]
        time = _shuffled(futures.seed, base, futures.levels)
        energy = _shuffled(futures.seed, base + 1, futures.levels)
        for f in range(count):
            futures.obs_s[i, f] = np.exp(ln[0] + ln[1] * futures.deviates[time[f]])
            futures.obs_j[i, f] = futures.load[f] * np.exp(ln[2] + ln[3] * futures.deviates[energy[f]])


@njit(cache=True, nogil=True)
def work_out_drive(world: World, futures: TabledFutures, a: int, b: int) -> None:
    """Write the amounts of one drive, the tracks that it loses and whether it fails."""
    count, n1, seed = futures.deviates.shape[0], world.n + 1, futures.seed
    base, ln = 16 + (a * n1 + b) * (n1 + 2), world.leg_ln[a, b]
    time, energy = _shuffled(seed, base, futures.levels), _shuffled(seed, base + 1, futures.levels)
    for f in range(count):
        futures.leg_s[a, b, f] = futures.slow[f] * np.exp(ln[0] + ln[1] * futures.deviates[time[f]])
        futures.leg_j[a, b, f] = futures.hungry[f] * np.exp(ln[2] + ln[3] * futures.deviates[energy[f]])
        futures.lost[a, b, f] = 0
    for k in range(n1):
        chance = world.loss[a, b, k] if k > 0 else world.fails[a, b]
        if chance > 0.0:
            rank = _shuffled(seed, base + 2 + k, futures.levels)
            shift = uniform(key_of(seed, base + 2 + k), 2 * count)
            for f in range(count):
                if rank[f] + shift < chance * count:
                    futures.lost[a, b, f] |= 1 << k
    futures.ready[a, b] = True
