"""Compiled sweeps of the ng-route relaxation: values on one resource, and what their policy does.

Axes: a state s is a place and what is remembered there as made (bits), numbered from `base` of its place on;
a node i of the resource; a count c of carried tracks. A leg-state is a leg and what is remembered after it.
Counts stand side by side, in eights, so that one instruction does eight; those past the last are idle.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from planner.evaluate.model import Floats, Ints

Singles = NDArray[np.float32]
Choices = NDArray[np.int16]

FAINT = 1e-7
"""Chance of a state below which the policy is not followed further."""


LANES = 8
"""Counts that are worked out together: single precision in registers of 256 bits."""


BLOCK = 16
"""Nodes before which drives that end later are worked out together: masses and values, some 30 MB, then come
from memory once for so many nodes. By hand: 8 are as good."""


class Masses(NamedTuple):
    """What actions move, by nodes moved on; functions are linear between nodes and above the true ones."""

    hat: Singles  # (actions, nodes) mass on nodes
    low: Ints  # (actions,) first node with a mass
    high: Ints  # (actions,) node after the last
    bulge: Singles  # (actions, nodes) what a concave kink so far on adds between two nodes
    within: Singles  # (actions, nodes) chance to use no more than so many nodes, and above it between them
    summed: Singles  # (actions, nodes) sum of `hat` up to there
    quick: Floats  # (actions,) mass on the node where a drive begins, left out of the others


class Drives(NamedTuple):
    """Masses of drives with 0, 1, ... tracks, as in `Masses`, the counts side by side."""

    hat: Singles  # (legs, nodes, counts)
    bulge: Singles  # (legs, nodes, counts)
    within: Singles  # (legs, nodes, counts)
    summed: Singles  # (legs, nodes, counts)
    low: Ints  # (legs,) first node with a mass, of any count
    high: Ints  # (legs,) node after the last
    quick: Singles  # (legs, counts)
    bulging: bool  # any mass in `bulge`


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
    tracked: Ints  # (places, bits) the bits that stand for tracks, then -1
    living: Ints  # (ways,) tracks that live
    turn: Ints  # (legs,) legs in order of `way_base`: those side by side that share it find the same
    thin: Singles  # (legs, counts, counts) chance that so many of so many other tracks are left
    first_made: Ints  # (places + 1,) observations are in order of their place
    bit: Ints  # (observations,) its bit at its place
    counted: NDArray[np.bool_]  # (observations,) takes one of the tracks
    weight: Singles  # (states, observations of a place) times its multiplier, at least 1 (`visited.py`)
    close: Ints  # (observations,) last node at which it may begin
    whole: bool  # the largest count is a number, and not that many or more
    counts: int
    nodes: int
    penalty: float


class Tables(NamedTuple):
    """Values plus penalty, at states and after drives; and what is done.

    That is a leg, legs + observation, -1 ends the day, -2 gives up another track, -3 - bit one remembered.
    """

    value: Singles  # (states, nodes, counts)
    arriving: Singles  # (leg-states, nodes, counts)
    bend: Singles  # (leg-states, nodes, counts) by how much the slope of `arriving` falls at a node
    choice: Choices  # (states, nodes, counts) as above; without nodes where it is not asked for


@njit(cache=True, nogil=True, fastmath=True)
def _add(mass: Singles, e: int, rows: Singles, s: int, i: int, low: int, high: int, found: Singles) -> None:
    """Add the sum over low <= j < high of mass[e, j] * rows[s, i + j], (counts,).

    Eight nodes go together: with one at a time the sum would be stored and read again for each.
    """
    if high <= low:
        return
    end = low + (high - low) // 8 * 8
    for j in range(low, end, 8):
        k = i + j
        for c in range(len(found)):
            found[c] += (
                (mass[e, j, c] * rows[s, k, c] + mass[e, j + 1, c] * rows[s, k + 1, c])
                + (mass[e, j + 2, c] * rows[s, k + 2, c] + mass[e, j + 3, c] * rows[s, k + 3, c])
            ) + (
                (mass[e, j + 4, c] * rows[s, k + 4, c] + mass[e, j + 5, c] * rows[s, k + 5, c])
                + (mass[e, j + 6, c] * rows[s, k + 6, c] + mass[e, j + 7, c] * rows[s, k + 7, c])
            )
    for j in range(end, high):
        for c in range(len(found)):
            found[c] += mass[e, j, c] * rows[s, i + j, c]


@njit(cache=True, nogil=True, fastmath=True)
def past_block(a: Layout, legs: Drives, w: Tables, first: int, past: Singles) -> None:
    """Fill in what drives make that begin in a block of nodes and end after it.

    `past` [leg-states, BLOCK, 2, counts] holds sums of values and of bulges.
    """
    past[:] = 0.0
    beyond = first + BLOCK
    for e in range(len(a.origin)):
        for s in range(a.leg_base[e], a.leg_base[e + 1]):
            for b in range(min(BLOCK, a.nodes - first)):
                i = first + b
                high = min(legs.high[e], a.nodes - i)
                _add(legs.hat, e, w.arriving, s, i, max(legs.low[e], beyond - i), high, past[s, b, 0])
                if not legs.bulging:
                    continue
                low = max(legs.low[e], 2, beyond + 1 - i)  # the bend after the block is not yet known
                high = min(high, a.nodes - 1 - i)
                _add(legs.bulge, e, w.bend, s, i, low, high, past[s, b, 1])


@njit(cache=True, nogil=True, fastmath=True)
def _kink(value: Singles, j: int, c: int) -> np.float32:
    """Return by how much the slope falls a node after the j-th, in utility a node."""
    return max(np.float32(0.0), value[j + 1, c] + value[j + 1, c] - value[j, c] - value[j + 2, c])


@njit(cache=True, nogil=True, fastmath=True)
def before_legs(
    a: Layout,
    legs: Drives,
    w: Tables,
    i: int,
    past: Singles,
    by: Singles,
    left: Singles,
) -> None:
    """Fill in the values before each drive, [leg-states, counts]; `left` holds the last cell's bulges.

    `past` is that of `past_block`. What has not left this node is not in it: see `quick_arrivals`.
    """
    rest, lanes = a.nodes - 1 - i, by.shape[1]
    far = np.zeros(lanes, np.float32)
    within = BLOCK - i % BLOCK  # nodes up to the end of the block
    for e in range(len(a.origin)):
        low, high = legs.low[e], min(legs.high[e], rest + 1, within)
        first, last = max(low, 2), min(legs.high[e], rest, within + 1)  # one of one node bulges nowhere
        for c in range(lanes):
            far[c] = legs.within[e, rest, c] - legs.summed[e, rest, c]
        for s in range(a.leg_base[e], a.leg_base[e + 1]):
            found, end = by[s], w.arriving[s, a.nodes - 1]
            bulge = past[s, i % BLOCK, 1]
            found[:] = past[s, i % BLOCK, 0]
            _add(legs.hat, e, w.arriving, s, i, low, high, found)
            if legs.bulging:
                _add(legs.bulge, e, w.bend, s, i, first, last, bulge)
            for c in range(lanes):
                found[c] += far[c] * end[c] + max(bulge[c], left[s, c])
                left[s, c] = bulge[c]


@njit(cache=True, nogil=True, fastmath=True)
def quick_arrivals(
    a: Layout,
    legs: Drives,
    w: Tables,
    i: int,
    top: float,
    most: Floats,
    leads: Ints,
    peak: Singles,
    by: Singles,
) -> None:
    """Add to the values before each drive, [leg-states, counts], what arrives at the node where it begins.

    The values there are not known yet: after an arrival a place's own observations win no more than `most`
    [places], in no time, and then another drive begins. `peak` [places, counts] holds the most that drives
    from each place give at this node or a later one, `top` is more than any value plus penalty, and `leads`
    [legs] says where legs lead. A value that falls to the next node bends there by no more than it falls.
    """
    lanes, quick, highest = by.shape[1], 0.0, np.float32(top)
    for e in range(len(a.origin)):
        p = a.origin[e]
        for c in range(lanes):
            quick = max(quick, float(legs.quick[e, c] + legs.bulge[e, 0, c]))
        for s in range(a.leg_base[e], a.leg_base[e + 1]):
            for c in range(lanes):
                peak[p, c] = max(peak[p, c], by[s, c])
    if quick <= 0.0:
        return
    anywhere = np.zeros(lanes)
    for c in range(lanes):
        anywhere[c] = min(top, (float(peak[:, c].max()) + most.max()) / (1.0 - min(quick, 0.999)))
    for e in range(len(a.origin)):
        p = leads[e]
        for c in range(lanes):
            share, kinked = legs.quick[e, c], legs.bulge[e, 0, c]
            if share <= 0.0:
                continue
            here = np.float32(min(anywhere[c], float(peak[p, c]) + quick * anywhere[c] + most[p]))
            for s in range(a.leg_base[e], a.leg_base[e + 1]):
                soon = w.arriving[s, i + 1, c] if i + 1 < a.nodes else np.float32(0.0)
                later = w.arriving[s, i + 2, c] if i + 2 < a.nodes else np.float32(0.0)
                value = by[s, c] + share * here + kinked * max(here - soon, soon - later, np.float32(0.0))
                by[s, c] = min(value, highest)


@njit(cache=True, nogil=True)
def fewer(a: Layout, c: int) -> int:
    """Return the count after one track is gone."""
    return c if c == a.counts - 1 and not a.whole else c - 1


@njit(cache=True, nogil=True)
def known_tracks(a: Layout, e: int, held: int) -> int:
    """Return how many of the tracks known on a leg live."""
    count = 0
    for b in range(a.held[e]):
        if a.lasting[e, b] >= 0.0 and not held >> b & 1:
            count += 1
    return count


@njit(cache=True, nogil=True)
def found_at(a: Layout, value: Singles, e: int, held: int, c: int, i: int) -> int:
    """Return the best state on arrival with what is known, -1 where there are fewer tracks.

    `value` [states, nodes, counts] is that of `Tables`.
    """
    best, found = np.float32(-1.0), -1
    first = a.way_base[e] + held
    for k in range(a.way[first], a.way[first + 1]):
        s = a.arrival[k]
        if (a.alive[s] <= c or (c == a.counts - 1 and not a.whole)) and value[s, i, c] > best:
            best, found = value[s, i, c], s
    return found


@njit(cache=True, nogil=True, fastmath=True)
def _after_node(a: Layout, w: Tables, i: int, now: Singles, at: Singles, other: Singles) -> None:
    """Fill in what comes after each drive at a node, where all states are known.

    `now` [states, counts] holds their values there, 0 where more tracks are remembered than counted.
    """
    counts, lanes = a.counts, now.shape[1]
    fixed = counts if a.whole else counts - 1  # counts that are numbers
    found = -1
    for e in a.turn:
        size, keys = 1 << a.held[e], 1 << a.common[e]
        for held in range(size):
            first = a.way_base[e] + held
            tracks = a.living[first]
            if found != a.way_base[e]:
                at[held] = 0.0
                for k in range(a.way[first], a.way[first + 1]):
                    state = now[a.arrival[k]]
                    for c in range(lanes):
                        at[held, c] = max(at[held, c], state[c])
            for c in range(lanes):
                other[held, c] = at[held, c]
            for c in range(tracks, fixed):
                v = np.float32(0.0)
                for k in range(c - tracks + 1):
                    v += a.thin[e, c - tracks, k] * at[held, tracks + k]
                other[held, c] = v
        found = a.way_base[e]
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
            for c in range(lanes):
                before[c] = max(before[c], other[held, c])
        for key in range(keys):
            s = a.leg_base[e] + key
            for c in range(lanes):
                w.arriving[s, i, c] = other[key, c]
            if i < a.nodes - 2:
                for c in range(lanes):
                    w.bend[s, i + 1, c] = _kink(w.arriving[s], i, c)


@njit(cache=True, nogil=True, fastmath=True)
def _take_better(values: Singles, which: int, best: Singles, done: Singles) -> None:
    """Replace the best values by those that are better, and say of which action these are."""
    number = np.float32(which)
    for c in range(len(values)):
        better = values[c] > best[c]
        best[c] = values[c] if better else best[c]
        done[c] = number if better else done[c]


@njit(cache=True, nogil=True, fastmath=True)
def _one_fewer(values: Singles, last: int, fewer_tracks: Singles) -> None:
    """Fill in the values that each count has with one track fewer; 0 where there is none.

    `last` is the count that stands for that many or more, -1 where none does.
    """
    fewer_tracks[0] = 0.0
    for c in range(1, len(values)):
        fewer_tracks[c] = values[c - 1]
    if last >= 0:
        fewer_tracks[last] = values[last]


@njit(cache=True, nogil=True, fastmath=True)
def _make(
    hat: Singles,
    bulge: Singles,
    high: int,
    ends: tuple[float, float],
    i: int,
    value: Singles,
    last: Singles,
    found: Singles,
    room: Singles,
) -> None:
    """Fill in the values before an observation from those after it, (nodes, counts), with what it wins.

    `hat` and `bulge` (nodes,) are its masses, the latter empty where nothing bulges, and `ends` what ends
    after the day and what is won. `last` holds the last cell's bulges [counts]; `room` is for what is
    summed, (2, counts).
    """
    nodes, lanes = len(value), len(found)
    rest = nodes - 1 - i
    far, won = np.float32(ends[0]), np.float32(ends[1])
    for c in range(lanes):
        room[0, c] = room[1, c] = 0.0
    for j in range(min(high, rest + 1)):
        for c in range(lanes):
            room[0, c] += hat[j] * value[i + j, c]
    for j in range(1, min(high, rest, len(bulge))):
        for c in range(lanes):
            room[1, c] += bulge[j] * _kink(value, i + j - 1, c)
    for c in range(lanes):
        found[c] = room[0, c] + far * value[nodes - 1, c] + max(room[1, c], last[c]) + won
        last[c] = room[1, c]


@njit(cache=True, nogil=True, fastmath=True)
def backward(
    a: Layout, legs: Drives, made: Masses, gain: Floats, prices: Floats, top: float, w: Tables
) -> None:
    """Fill the tables from the last node to the first.

    `gain` [observations] is the worth of each less its multiplier, of `prices`, and no policy that makes each
    once at most has a value plus penalty above `top`, all in utility.
    """
    lanes, asked = w.value.shape[2], w.choice.shape[1] == a.nodes
    past = np.zeros((len(w.arriving), BLOCK, 2, lanes), np.float32)
    by = np.zeros((len(w.arriving), lanes), np.float32)
    left = np.zeros((len(w.arriving), lanes), np.float32)
    at = np.zeros((1 << a.held.max(), lanes), np.float32)
    other = np.zeros_like(at)
    now = np.zeros((len(w.value), lanes), np.float32)
    here = 0
    for p in range(len(a.bits)):
        here = max(here, a.first_made[p + 1] - a.first_made[p])
    last = np.zeros((len(w.value), here, lanes), np.float32)
    best, done, found = np.zeros(lanes, np.float32), np.zeros(lanes, np.float32), np.zeros(lanes, np.float32)
    made_now = np.zeros_like(best)
    bulging = a.nodes if legs.bulging else 0
    open_end = -1 if a.whole else a.counts - 1
    plain, by_plain, room = np.zeros_like(best), np.zeros_like(best), np.zeros((2, lanes), np.float32)
    count, most = len(a.origin), np.zeros(len(a.bits))
    for p in range(len(a.bits)):
        most[p] = np.maximum(gain[a.first_made[p] : a.first_made[p + 1]], 0.0).sum()
    leads = np.searchsorted(a.base, a.arrival[a.way[a.way_base]], side="right") - 1
    peak = np.full((len(a.bits), lanes), a.penalty, np.float32)
    for i in range(a.nodes - 1, -1, -1):
        rest = a.nodes - 1 - i
        if i == a.nodes - 1 or i % BLOCK == BLOCK - 1:
            past_block(a, legs, w, i // BLOCK * BLOCK, past)
        before_legs(a, legs, w, i, past, by, left)
        quick_arrivals(a, legs, w, i, top, most, leads, peak, by)
        for p in range(len(a.bits)):
            for c in range(lanes):  # legs that keep nothing are the same for all that is remembered
                plain[c], by_plain[c] = a.penalty, -1.0
            for e in range(a.first_leg[p], a.first_leg[p + 1]):
                if not a.common[e]:
                    _take_better(by[a.leg_base[e]], e, plain, by_plain)
            for bits in range((1 << a.bits[p]) - 1, -1, -1):
                s = a.base[p] + bits
                for c in range(lanes):
                    best[c], done[c] = plain[c], by_plain[c]
                for e in range(a.first_leg[p], a.first_leg[p + 1]):
                    if a.common[e]:
                        _take_better(by[a.key[a.key_base[e] + bits]], e, best, done)
                first = a.first_made[p]
                for m in range(first, a.first_made[p + 1]):
                    won = gain[m] - prices[m] * (a.weight[s, m - first] - 1.0)
                    if bits >> a.bit[m] & 1 or i > a.close[m] or won <= 0.0:
                        continue
                    after = w.value[s + (1 << a.bit[m])]
                    within = made.within[m, rest]
                    ends = within - made.summed[m, rest], within * won
                    bulge = made.bulge[m, :bulging]
                    _make(
                        made.hat[m], bulge, made.high[m], ends, i, after, last[s, m - first], made_now, room
                    )
                    if a.counted[m]:
                        _one_fewer(made_now, open_end, found)
                        _take_better(found, count + m, best, done)
                    else:
                        _take_better(made_now, count + m, best, done)
                for k in range(a.tracked.shape[1]):
                    b = a.tracked[p, k]
                    if b < 0:
                        break
                    if not bits >> b & 1:
                        _one_fewer(now[s + (1 << b)], open_end, found)
                        _take_better(found, -3 - b, best, done)
                least = a.alive[s]
                if rest:
                    for c in range(lanes):
                        best[c] = max(best[c], w.value[s, i + 1, c])
                for c in range(least + 1, a.counts):
                    if best[c - 1] > best[c]:
                        best[c], done[c] = best[c - 1], -2
                for c in range(min(least, a.counts if a.whole else a.counts - 1)):
                    best[c] = 0.0  # more tracks are remembered than counted
                for c in range(a.counts, lanes):
                    best[c] = 0.0
                for c in range(lanes):
                    w.value[s, i, c] = best[c]
                    now[s, c] = best[c]
                if asked:
                    for c in range(lanes):
                        w.choice[s, i, c] = np.int16(done[c])
        _after_node(a, w, i, now, at, other)


@njit(cache=True, nogil=True)
def spread(a: Layout, e: int, held: int, c: int, ways: Ints, chances: Floats) -> int:
    """Fill in what is known and counted after a drive, (entries, 2), with chances; return how many."""
    tracks, count = known_tracks(a, e, held), 1
    ways[0, 0], ways[0, 1], chances[0] = held, c, 1.0
    for b in range(a.held[e]):
        lost = a.lasting[e, b]
        if lost > 0.0 and not held >> b & 1:
            for k in range(count):
                ways[count + k, 0], ways[count + k, 1] = ways[k, 0] | 1 << b, fewer(a, ways[k, 1])
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
def known_best(a: Layout, w: Tables, e: int, key: int, c: int, i: int, ways: Ints, p: Floats) -> int:
    """Return what is known of the tracks of the place itself, at its best, where a drive ends at a node.

    `ways` (entries, 2) and `p` (entries,) are room for what `spread` fills in.
    """
    keys, size = 1 << a.common[e], 1 << a.held[e]
    best, chosen = -1.0, -1
    for held in range(key, size, keys):
        if known_tracks(a, e, held) <= c or (c == a.counts - 1 and not a.whole):
            value = 0.0
            for k in range(spread(a, e, held, c, ways, p)):
                s = found_at(a, w.value, e, ways[k, 0], ways[k, 1], i)
                value += p[k] * w.value[s, i, ways[k, 1]]
            if value > best:
                best, chosen = value, held
    return chosen


@njit(cache=True, nogil=True)
def _arrive(a: Layout, w: Tables, arriving: Singles, mass: Floats, i: int, ways: Ints, p: Floats) -> None:
    """Put the chances of what arrives at a node on the states that are found there."""
    for e in range(len(a.origin)):
        for key in range(1 << a.common[e]):
            for c in range(a.counts):
                here = arriving[a.leg_base[e] + key, i, c]
                if here < FAINT:
                    continue
                chosen = known_best(a, w, e, key, c, i, ways, p)
                for k in range(spread(a, e, chosen, c, ways, p)):
                    s = found_at(a, w.value, e, ways[k, 0], ways[k, 1], i)
                    mass[s, i, ways[k, 1]] += here * p[k]


@njit(cache=True, nogil=True, fastmath=True)
def forward(a: Layout, legs: Drives, made: Masses, w: Tables, mass: Singles) -> Floats:
    """Return how often each observation is made [observations], by weight, by the policy of the tables.

    `mass` [states, nodes, counts] holds the chances that the day begins with and is used up. Faint masses are
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
                    here, done = mass[s, i, c], w.choice[s, i, c]
                    if here < FAINT or done == -1:
                        continue
                    if done == -2:
                        mass[s, i, c - 1] += here
                    elif done < 0:
                        mass[s + (1 << (-3 - done)), i, fewer(a, c)] += here
                    elif done >= count:
                        m = done - count
                        d = fewer(a, c) if a.counted[m] else c
                        q = s + (1 << a.bit[m])
                        weight = a.weight[s, m - a.first_made[p]]
                        often[m] += here * made.within[m, a.nodes - 1 - i] * weight
                        for j in range(min(made.high[m], a.nodes - i)):
                            if i + max(j, 1) < a.nodes:
                                mass[q, i + max(j, 1), d] += here * made.hat[m, j]
                    else:
                        q = a.key[a.key_base[done] + bits]
                        for j in range(max(1, legs.low[done]), min(legs.high[done], a.nodes - i)):
                            arriving[q, i + j, c] += here * legs.hat[done, j, c]
    return often
