"""The steps of an order taken in many futures at once.

What is kept of `LANES` futures lies at fixed places of two flat arrays: `real` [6 * LANES] and `whole`
[8 * LANES]. Loops over them have no branches, so that a processor does several futures at once.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from planner.evaluate.model import Floats, Ints

TIME, ENERGY, BOTH = 0, 1, 2
"""Rows of a curve: which budgets a factor widens."""

LANES = 128
"""Futures in which a step is taken at once: what is kept of them fills half of a first-level cache."""

T, G, HOTEL, EARNED, MORE, MORE_J = (LANES * lane for lane in range(6))
LIVE, GOES, PLACE, TRACKED, DONE, CLOSED, BEFORE, LOST = (LANES * lane for lane in range(8))
"""Where each quantity of so many futures begins in a flat array: time, energy of drives and observations, its
hotel load, what is earned and what tracks add to a drive; and, as whole numbers, whether it is within the
budgets and takes the step, where it is, and bits of what is tracked, done, out of reach and done before.
"""

SHADE = 1e-11
"""Share by which an amount may be above a limit that it meets."""


@njit(cache=True, nogil=True)
def begin_in(
    real: Floats, whole: Ints, n: int, begin: int, load: Floats, hotel: float, starts: int, started: int,
    track_t: float, track_e: float, t_max: float, e_max: float,
) -> None:  # fmt: skip
    """Put n futures from `begin` on at the start, with so many tracks started (`starts` are their bits).

    `real` and `whole` are [lanes], `load` [futures].
    """
    t, ended = started * track_t, started * track_t > t_max
    for j in range(n):
        real[HOTEL + j] = hotel * load[begin + j]
        real[G + j] = started * track_e * load[begin + j]
        within = np.int64(real[G + j] + real[HOTEL + j] * t <= e_max)
        real[T + j], real[EARNED + j] = t, 0.0
        whole[LIVE + j] = 0 if ended else within
        whole[PLACE + j], whole[TRACKED + j], whole[DONE + j], whole[CLOSED + j] = 0, starts, 0, 0


@njit(inline="always")
def _bits(x: int) -> int:
    """Return how many bits of a number that is not negative are set; without a loop, as is needed here."""
    x = (x & 0x5555555555555555) + ((x >> 1) & 0x5555555555555555)
    x = (x & 0x3333333333333333) + ((x >> 2) & 0x3333333333333333)
    x = (x + (x >> 4)) & 0x0F0F0F0F0F0F0F0F
    x = x + (x >> 8)
    x = x + (x >> 16)
    return (x + (x >> 32)) & 0x7F


@njit(cache=True, nogil=True)
def drive_in(
    real: Floats, whole: Ints, n: int, begin: int, count: int, n1: int, leg_s: Floats, leg_j: Floats,
    lost: Ints, legs: int, i: int, for_track: bool, track_leg: float, t_max: float, e_max: float,
) -> None:  # fmt: skip
    """Take the drive to place `i` in those of n futures from `begin` on, of `count`, in which that is done.

    `real` and `whole` are [lanes]; the tables of drives `leg_s`, `leg_j` and `lost` are
    [drives], those of a place to a place after each other; `legs` are bits of the places from which one
    leads here.
    """
    untracked, places = 1 - np.int64(for_track), np.int64(0)
    for j in range(n):
        place = whole[PLACE + j]
        goes = (legs >> place) & ~(whole[CLOSED + j] >> i) & ((whole[TRACKED + j] >> i) | untracked)
        goes &= whole[LIVE + j]
        whole[GOES + j] = goes
        places |= goes << place
        real[MORE + j], real[MORE_J + j], whole[LOST + j] = 0.0, 0.0, 0
    for place in range(n1):
        if (places >> place) & 1:
            first = np.uint64((place * n1 + i) * count + begin)
            for j in range(n):
                here, at = whole[PLACE + j] == place, first + np.uint64(j)
                more_s, more_j, gone = leg_s[at], leg_j[at], lost[at]
                real[MORE + j] = more_s if here else real[MORE + j]
                real[MORE_J + j] = more_j if here else real[MORE_J + j]
                whole[LOST + j] = gone if here else whole[LOST + j]
    if track_leg > 0.0:
        for j in range(n):
            real[MORE + j] += track_leg * _bits(whole[TRACKED + j])
    for j in range(n):
        goes, t, g = whole[GOES + j], real[T + j], real[G + j]
        gone, more_s, more_j = whole[LOST + j] & -goes, t + real[MORE + j], g + real[MORE_J + j]
        t = more_s if goes else t
        g = more_j if goes else g
        real[T + j], real[G + j] = t, g
        whole[LIVE + j] &= np.int64(t <= t_max) & np.int64(g + real[HOTEL + j] * t <= e_max)
        whole[TRACKED + j] &= ~gone
        place = whole[PLACE + j]
        whole[PLACE + j] = i if goes & ~gone else place
        whole[CLOSED + j] |= (gone & 1) << i


@njit(cache=True, nogil=True)
def observe_in(
    real: Floats, whole: Ints, n: int, begin: int, obs_s: Floats, obs_j: Floats, i: int, target: int,
    target_bits: int, opens: float, closes: float, placed: bool, must: int, all_of_it: int, t_max: float,
    e_max: float,
) -> int:  # fmt: skip
    """Make observation `i` in those of n futures in which that is done, and say in `GOES` where it was within
    the budgets, and in `BEFORE` which of its target were made before. Return how many futures are still
    within them.

    `real` and `whole` are [lanes]; its amounts are those of `obs_s` and `obs_j`
    [amounts] from `begin` on.
    """
    track, still, first = np.int64(placed), 0, np.uint64(begin)
    for j in range(n):
        tracked, done, t, g = whole[TRACKED + j], whole[DONE + j], real[T + j], real[G + j]
        goes = whole[LIVE + j] & np.int64(whole[PLACE + j] == target) & np.int64(t <= closes) & ~(done >> i)
        goes &= ((tracked >> target) | (1 - track)) & np.int64((must & ~done) == 0)
        at = first + np.uint64(j)
        more_s, more_j = (t if t > opens else opens) + obs_s[at], obs_j[at]
        t = more_s if goes else t
        g = g + more_j if goes else g
        live = whole[LIVE + j] & np.int64(t <= t_max) & np.int64(g + real[HOTEL + j] * t <= e_max)
        goes &= live
        real[T + j], real[G + j], whole[LIVE + j], whole[GOES + j] = t, g, live, goes
        whole[BEFORE + j] = done & target_bits
        done |= goes << i
        whole[DONE + j] = done
        whole[TRACKED + j] = tracked & ~((goes & track & np.int64((all_of_it & ~done) == 0)) << target)
        still += live
    return still


@njit(inline="always")
def _number(x: float, factors: Floats, first: Ints, cells: float) -> int:
    """Return the number of the least factor that is at least x; how many there are, where none is."""
    if x <= 1.0 + SHADE:
        return 0
    if x > factors[-1] * (1.0 + SHADE):
        return factors.shape[0]
    number = np.uint64(first[np.uint64((x - 1.0) * cells)])
    return int(number) + int(x > factors[number] * (1.0 + SHADE))


@njit(cache=True, nogil=True)
def tell_in(
    gained: Floats, line: int, real: Floats, whole: Ints, n: int, which: int, much: float, fewer: float,
    time_s: float, energy_j: float, factors: Floats, first: Ints, cells: float,
) -> None:  # fmt: skip
    """Add what is won in n futures to the factors on the budgets from which it is, rows `line` on of
    `gained` [6, factors + 1].

    That is `much` in those that lane `which` says, times `fewer` for each of the observations of `BEFORE`;
    the last are the members of `Scale`.
    """
    t_max, e_max = time_s * (1.0 + SHADE), energy_j * (1.0 + SHADE)
    at_once, later = 0, 0
    for j in range(n):
        t, here = real[T + j], whole[which + j]
        within = np.int64(t <= t_max) & np.int64(real[G + j] + real[HOTEL + j] * t <= e_max)
        at_once += here & within
        later += here & ~within
    if fewer == 1.0:  # most keep to the budgets at factor 1
        for row in range(line, line + 3):
            gained[row, 0] += at_once * much
        if not later:
            return
    for j in range(n):
        t = real[T + j]
        real[MORE + j] = t / time_s
        real[MORE_J + j] = (real[G + j] + real[HOTEL + j] * t) / energy_j
    for j in range(n):
        if not whole[which + j]:
            continue
        by_time = _number(real[MORE + j], factors, first, cells)
        by_energy = _number(real[MORE_J + j], factors, first, cells)
        if fewer == 1.0 and by_time == 0 and by_energy == 0:
            continue
        won, bits = much, whole[BEFORE + j]
        if fewer != 1.0:
            while bits:
                won *= fewer
                bits &= bits - 1
        if by_energy == 0:
            gained[line + TIME, by_time] += won
        if by_time == 0:
            gained[line + ENERGY, by_energy] += won
        gained[line + BOTH, max(by_time, by_energy)] += won


@njit(cache=True, nogil=True)
def earn_in(real: Floats, whole: Ints, n: int, much: float, fewer: float) -> None:
    """Add to what is earned in n futures what an observation wins, as `tell_in` has it.

    `real` and `whole` are [lanes].
    """
    if fewer == 1.0:
        for j in range(n):
            real[EARNED + j] += much if whole[GOES + j] else 0.0
        return
    for j in range(n):
        won, bits = much if whole[GOES + j] else 0.0, whole[BEFORE + j]
        while bits:
            won *= fewer
            bits &= bits - 1
        real[EARNED + j] += won
