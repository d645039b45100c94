"""Compiled sweeps of the ng-route relaxation: values on one resource, and what their policy does.

Axes: a state s is a place and what is remembered there as made (bits), numbered from `base` of its place on;
a count c of carried tracks; a node i of the resource. A leg-state is a leg and what is remembered after it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from planner.evaluate.model import Floats, Ints

Singles = NDArray[np.float32]
Choices = NDArray[np.int32]

FAINT = 1e-7
"""Chance of a state below which the policy is not followed further."""


class Masses(NamedTuple):
    """What actions move, by nodes moved on; functions are linear between nodes and above the true ones."""

    hat: Singles  # (actions, nodes) mass on nodes
    low: Ints  # (actions,) first node with a mass
    high: Ints  # (actions,) node after the last
    bulge: Singles  # (actions, nodes) what a concave kink so far on adds between two nodes
    within: Singles  # (actions, nodes) chance to use no more than so many nodes, and above it between them
    summed: Singles  # (actions, nodes) sum of `hat` up to there
    quick: Floats  # (actions,) chance that is left out, of a drive that hardly uses anything


class Layout(NamedTuple):
    """States and moves of the relaxation."""

    base: Ints  # (places + 1,) first state of each place
    bits: Ints  # (places,) how many observations are remembered there
    origin: Ints  # (legs,)
    first_leg: Ints  # (places + 1,) legs are in order of their origin
    leg_base: Ints  # (legs + 1,) first leg-state of each leg
    key_base: Ints  # (legs,) first entry in `key` of each leg
    key: Ints  # leg-state that a state of the leg's origin leads to
    held: Ints  # (legs,) bits of what is known on the way: the leg-state's, and tracks of the place itself
    common: Ints  # (legs,) bits of the leg-state among them, the lower ones
    lasting: Floats  # (legs, bits) chance to lose the track of a bit on the way, -1 where it stands for none
    way_base: Ints  # (legs,) first entry in `way` of each leg
    way: Ints  # (ways + 1,) first entry in `arrival` of each set of what is known
    arrival: Ints  # states that may be found on arrival
    alive: Ints  # (states,) tracks remembered
    tracked: Ints  # (places, bits) the bits that stand for tracks, and -1
    living: Ints  # (ways,) tracks that live
    thin: Singles  # (legs, counts, counts) chance that so many of so many other tracks are left
    first_made: Ints  # (places + 1,) observations are in order of their place
    bit: Ints  # (observations,) its bit at its place
    counted: NDArray[np.bool_]  # (observations,) takes one of the tracks
    close: Ints  # (observations,) last node at which it may begin
    whole: bool  # the largest count is a number, and not that many or more
    counts: int
    nodes: int
    penalty: float


class Tables(NamedTuple):
    """Values plus penalty and their concave kinks, at states and after drives; and what is done.

    That is a leg, legs + observation, -1 ends the day, -2 gives up another track, -3 - bit one remembered.
    """

    value: Singles  # (states, counts, nodes)
    kink: Singles  # (states, counts, nodes)
    arriving: Singles  # (leg-states, counts, nodes)
    bend: Singles  # (leg-states, counts, nodes)
    choice: Choices  # (states, counts, nodes) as below


@njit(cache=True, nogil=True, fastmath=True)
def _dot(mass: Singles, value: Singles) -> np.float32:
    found = np.float32(0.0)
    for j in range(len(mass)):
        found += mass[j] * value[j]
    return found


@njit(cache=True, nogil=True, fastmath=True)
def _concave(value: Singles, i: int) -> float:
    """Return by how much the slope falls at a node, in utility a node."""
    return max(np.float32(0.0), value[i] + value[i] - value[i - 1] - value[i + 1])


@njit(cache=True, nogil=True, fastmath=True)
def _before_legs(a: Layout, legs: Masses, w: Tables, i: int, top: float, by: Singles, left: Singles) -> None:
    """Fill in the values before each drive, [leg-states, counts]; `left` holds the last cell's bulges."""
    rest = a.nodes - 1 - i
    for e in range(len(a.origin)):
        for c in range(a.counts):
            k = e * a.counts + c
            low, high = legs.low[k], min(legs.high[k], rest + 1)
            far = np.float32(legs.within[k, rest] - legs.summed[k, rest])
            more = np.float32(legs.quick[k] * top)
            for s in range(a.leg_base[e], a.leg_base[e + 1]):
                v, b = np.float32(0.0), np.float32(0.0)
                if high > low:
                    v = _dot(legs.hat[k, low:high], w.arriving[s, c, i + low : i + high])
                    b = _dot(legs.bulge[k, low:high], w.bend[s, c, i + low : i + high])
                by[s, c] = v + far * w.arriving[s, c, a.nodes - 1] + more + max(b, left[s, c])
                left[s, c] = b


@njit(cache=True, nogil=True)
def _fewer(a: Layout, c: int) -> int:
    """Return the count after one track is gone."""
    return c if c == a.counts - 1 and not a.whole else c - 1


@njit(cache=True, nogil=True)
def _tracks(a: Layout, e: int, held: int) -> int:
    """Return how many of the tracks known on a leg live."""
    count = 0
    for b in range(a.held[e]):
        if a.lasting[e, b] >= 0.0 and not held >> b & 1:
            count += 1
    return count


@njit(cache=True, nogil=True)
def _found(a: Layout, value: Singles, e: int, held: int, c: int, i: int) -> int:
    """Return the best state on arrival with what is known, -1 where there are fewer tracks."""
    best, found = np.float32(-1.0), -1
    first = a.way_base[e] + held
    for k in range(a.way[first], a.way[first + 1]):
        s = a.arrival[k]
        if (a.alive[s] <= c or (c == a.counts - 1 and not a.whole)) and value[s, c, i] > best:
            best, found = value[s, c, i], s
    return found


@njit(cache=True, nogil=True, fastmath=True)
def _after_node(a: Layout, w: Tables, i: int, now: Singles, at: Singles, other: Singles) -> None:
    """Fill in what comes after each drive at a node, where all states are known.

    `now` [states, counts] holds their values there, 0 where more tracks are remembered than counted.
    """
    counts = a.counts
    fixed = counts if a.whole else counts - 1  # counts that are numbers
    for e in range(len(a.origin)):
        size, keys = 1 << a.held[e], 1 << a.common[e]
        for held in range(size):
            first = a.way_base[e] + held
            tracks = a.living[first]
            at[held] = 0.0
            for k in range(a.way[first], a.way[first + 1]):
                state = now[a.arrival[k]]
                for c in range(counts):
                    at[held, c] = max(at[held, c], state[c])
            other[held] = at[held]
            for c in range(tracks, fixed):
                chance, values = a.thin[e, c - tracks, : c - tracks + 1], at[held, tracks : c + 1]
                other[held, c] = _dot(chance, values)
        for b in range(a.held[e]):
            lost = np.float32(a.lasting[e, b])
            if lost <= 0.0:
                continue
            for held in range(size):
                if held >> b & 1:
                    continue
                gone = other[held | 1 << b]
                if not a.whole:
                    other[held, counts - 1] += lost * (gone[counts - 1] - other[held, counts - 1])
                for c in range(1, fixed):
                    other[held, c] += lost * (gone[c - 1] - other[held, c])
        for held in range(keys, size):
            before = other[held & (keys - 1)]
            for c in range(counts):
                before[c] = max(before[c], other[held, c])
        for key in range(keys):
            s = a.leg_base[e] + key
            for c in range(counts):
                w.arriving[s, c, i] = other[key, c]
                if 0 < i + 1 < a.nodes - 1:
                    w.bend[s, c, i + 1] = _concave(w.arriving[s, c], i + 1)


@njit(cache=True, nogil=True, fastmath=True)
def backward(a: Layout, legs: Masses, made: Masses, gain: Floats, top: float, w: Tables) -> None:
    """Fill the tables from the last node to the first.

    `gain` [observations] is the worth of each less its multiplier, and no policy that makes each once at most
    has a value plus penalty above `top`, both in utility.
    """
    by = np.zeros((len(w.arriving), a.counts), np.float32)
    left = np.zeros((len(w.arriving), a.counts), np.float32)
    at = np.zeros((1 << a.held.max(), a.counts), np.float32)
    other = np.zeros_like(at)
    now = np.zeros((len(w.value), a.counts), np.float32)
    last = np.zeros((len(w.value), a.counts, 8), np.float32)
    count = len(a.origin)
    for i in range(a.nodes - 1, -1, -1):
        rest = a.nodes - 1 - i
        _before_legs(a, legs, w, i, top, by, left)
        for p in range(len(a.bits)):
            for bits in range((1 << a.bits[p]) - 1, -1, -1):
                s = a.base[p] + bits
                for c in range(a.counts):
                    full = c == a.counts - 1 and not a.whole
                    if a.alive[s] > c and not full:
                        continue
                    best, done = np.float32(a.penalty), -1
                    if c > a.alive[s] and w.value[s, c - 1, i] > best:
                        best, done = w.value[s, c - 1, i], -2
                    for m in range(len(a.tracked[p])):
                        b = a.tracked[p, m]
                        if b >= 0 and not bits >> b & 1:
                            q = s + (1 << b)
                            d = c if full else c - 1
                            if w.value[q, d, i] > best:
                                best, done = w.value[q, d, i], -3 - b
                    for e in range(a.first_leg[p], a.first_leg[p + 1]):
                        v = by[a.key[a.key_base[e] + bits], c]
                        if v > best:
                            best, done = v, e
                    for m in range(a.first_made[p], a.first_made[p + 1]):
                        if bits >> a.bit[m] & 1 or gain[m] <= 0.0 or i > a.close[m]:
                            continue
                        d = c - 1 if a.counted[m] and not full else c
                        q = s + (1 << a.bit[m])
                        h = min(made.high[m], rest + 1)
                        b = _dot(made.bulge[m, :h], w.kink[q, d, i : i + h])
                        v = _dot(made.hat[m, :h], w.value[q, d, i : i + h])
                        v += (made.within[m, rest] - made.summed[m, rest]) * w.value[q, d, a.nodes - 1]
                        v += made.within[m, rest] * np.float32(gain[m])
                        v += max(b, last[s, c, m - a.first_made[p]])
                        last[s, c, m - a.first_made[p]] = b
                        if v > best:
                            best, done = v, count + m
                    if rest and w.value[s, c, i + 1] > best:
                        best = w.value[s, c, i + 1]
                    w.value[s, c, i] = now[s, c] = best
                    w.choice[s, c, i] = done
                    if 0 < i + 1 < a.nodes - 1:
                        w.kink[s, c, i + 1] = _concave(w.value[s, c], i + 1)
        _after_node(a, w, i, now, at, other)


@njit(cache=True, nogil=True)
def _spread(a: Layout, e: int, held: int, c: int, ways: Ints, chances: Floats) -> int:
    """Fill in what is known and counted after a drive, (entries, 2), with chances; return how many."""
    tracks, count = _tracks(a, e, held), 1
    ways[0, 0], ways[0, 1], chances[0] = held, c, 1.0
    for b in range(a.held[e]):
        lost = a.lasting[e, b]
        if lost > 0.0 and not held >> b & 1:
            for k in range(count):
                ways[count + k, 0], ways[count + k, 1] = ways[k, 0] | 1 << b, _fewer(a, ways[k, 1])
                chances[count + k] = chances[k] * lost
                chances[k] *= 1.0 - lost
            count *= 2
    others, some = c - tracks, count
    if others <= 0 or (c == a.counts - 1 and not a.whole):
        return count
    for gone in range(1, others + 1):
        for k in range(some):
            ways[count, 0], ways[count, 1] = ways[k, 0], ways[k, 1] - gone
            chances[count] = chances[k] * a.thin[e, others, others - gone]
            count += 1
    for k in range(some):
        chances[k] *= a.thin[e, others, others]
    return count


@njit(cache=True, nogil=True)
def _arrive(a: Layout, w: Tables, arriving: Singles, mass: Floats, i: int, ways: Ints, p: Floats) -> None:
    """Put the chances of what arrives at a node on the states that are found there."""
    for e in range(len(a.origin)):
        keys, size = 1 << a.common[e], 1 << a.held[e]
        for key in range(keys):
            for c in range(a.counts):
                here = arriving[a.leg_base[e] + key, c, i]
                if here < FAINT:
                    continue
                best, chosen = -1.0, -1
                for held in range(key, size, keys):
                    if _tracks(a, e, held) <= c or (c == a.counts - 1 and not a.whole):
                        value = 0.0
                        for k in range(_spread(a, e, held, c, ways, p)):
                            s = _found(a, w.value, e, ways[k, 0], ways[k, 1], i)
                            value += p[k] * w.value[s, ways[k, 1], i]
                        if value > best:
                            best, chosen = value, held
                for k in range(_spread(a, e, chosen, c, ways, p)):
                    s = _found(a, w.value, e, ways[k, 0], ways[k, 1], i)
                    mass[s, ways[k, 1], i] += here * p[k]


@njit(cache=True, nogil=True, fastmath=True)
def forward(a: Layout, legs: Masses, made: Masses, w: Tables, mass: Floats) -> Floats:
    """Return how often each observation is made [observations] by the policy of the tables.

    `mass` [states, counts, nodes] holds the chances that the day begins with and is used up. Faint masses are
    dropped, and what moves no node on is moved one: the result steers multipliers, and bounds nothing.
    """
    often = np.zeros(len(a.bit))
    count = len(a.origin)
    arriving = np.zeros(w.arriving.shape, np.float32)
    room = (1 << a.held.max()) * (a.counts + 1)
    ways, chances = np.zeros((room, 2), np.int64), np.zeros(room)
    for i in range(a.nodes):
        _arrive(a, w, arriving, mass, i, ways, chances)
        for p in range(len(a.bits)):
            for bits in range(1 << a.bits[p]):
                s = a.base[p] + bits
                for c in range(a.counts - 1, -1, -1):
                    here, done = mass[s, c, i], w.choice[s, c, i]
                    if here < FAINT or done == -1:
                        continue
                    if done == -2:
                        mass[s, c - 1, i] += here
                    elif done < 0:
                        mass[s + (1 << (-3 - done)), _fewer(a, c), i] += here
                    elif done >= count:
                        m = done - count
                        d = _fewer(a, c) if a.counted[m] else c
                        q = s + (1 << a.bit[m])
                        often[m] += here * made.within[m, a.nodes - 1 - i]
                        for j in range(min(made.high[m], a.nodes - i)):
                            if i + max(j, 1) < a.nodes:
                                mass[q, d, i + max(j, 1)] += here * made.hat[m, j]
                    else:
                        q = a.key[a.key_base[done] + bits]
                        k = done * a.counts + c
                        for j in range(max(1, legs.low[k]), min(legs.high[k], a.nodes - i)):
                            arriving[q, c, i + j] += here * legs.hat[k, j]
    return often
