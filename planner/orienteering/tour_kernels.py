"""Compiled moves on one tour: put in, take out, turn, shorten; and the work that they count.

A tour is a chain of nodes with fixed ends: each knows the one before it and the one that follows, so what a
step costs does not grow with the tour. `near` (n, K) lists nodes that may be visited, nearest first, -1 as
filler, and `apart` (n, K) their lengths, more than any road where filler is. Lengths are integers, the same
in both directions. `work` (KINDS,) counts what is done by kind, so that a limit can be reckoned from it.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]

SHORTEN = 10
"""Neighbours looked at by 2-opt and or-opt: more are hardly ever the end of an improving move."""
PLACES = 5
"""Neighbours on the tour beside which a node may be put in."""
_STRING = 3
"""Nodes of the longest string that or-opt moves."""
_SMALL = 10
"""Nodes that a tour has at most for all its places to be looked at."""

KINDS = 6
PLACE, OFFER, NEIGHBOUR, MOVED, PRICED, LABEL = range(KINDS)
"""Kinds of work: places looked at for a node, offered nodes gone through, neighbours looked at while a tour
is shortened, nodes moved or gone past, pairs of nodes looked at for a penalty on length, ways on of a label.
"""

BEFORE, FOLLOW, BACK, STAMP = range(4)
"""Columns of a tour (n, 4): the nodes before and behind each, -1 at the ends and outside, the length of the
road from the one before, and the step in which a node was changed last."""
NODE = 3
"""Column of a journal (n + 1, 4) beside the first three of a tour: the node of which they were.

Its first row is the step and how many nodes it changed (STEP, COUNT); each further row is what one of them
was before, so that a step can be undone."""
STEP, COUNT = 0, 1

kernel = numba.njit(cache=True, nogil=True, _nrt=False)
"""Compiles a function that makes no array. Without counting who holds the arrays that it is given: counts are
kept in step between cores, and that took half of the time of a step."""
part = numba.njit(cache=True, nogil=True, _nrt=False, forceinline=True)
"""The same, as part of whoever calls it: to hand over the arrays takes longer than these functions do."""


@numba.njit(cache=True, nogil=True)
def tour_of(d: Array, route: Array) -> tuple[Array, Array]:
    """Return tour and journal of a route (k,)."""
    tour = np.full((len(d), 4), -1, np.int64)
    for i in range(1, len(route)):
        a, v = route[i - 1], route[i]
        tour[a, FOLLOW], tour[v, BEFORE], tour[v, BACK] = v, a, d[a, v]
    was = np.zeros((len(d) + 1, 4), np.int64)
    was[0, STEP] = -1
    return tour, was


@kernel
def route_of(tour: Array, route: Array) -> int:
    """Fill in the nodes of a tour in their order (n,); return how many."""
    v, size = 0, 0
    while v >= 0:
        route[size] = v
        size += 1
        v = tour[v, FOLLOW]
    return size


@kernel
def undo(tour: Array, was: Array) -> None:
    """Put a tour (n, 4) back as its journal `was` (n + 1, 4) says, to where the step began."""
    for k in range(1, was[0, COUNT] + 1):
        v = was[k, NODE]
        tour[v, BEFORE], tour[v, FOLLOW], tour[v, BACK] = was[k, BEFORE], was[k, FOLLOW], was[k, BACK]


@part
def random(state: Array) -> float:
    """Return a uniform number in [0, 1) of a state (1,), which moves on: splitmix64."""
    state[0] += np.uint64(0x9E3779B97F4A7C15)
    z = state[0]
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z ^= z >> np.uint64(31)
    return float(z >> np.uint64(11)) / 9007199254740992.0


@part
def _save(tour: Array, was: Array, v: int) -> None:
    """Enter what a node is into the journal, once a step."""
    if tour[v, STAMP] != was[0, STEP]:
        tour[v, STAMP] = was[0, STEP]
        k = was[0, COUNT] + 1
        was[k, BEFORE], was[k, FOLLOW], was[k, BACK] = tour[v, BEFORE], tour[v, FOLLOW], tour[v, BACK]
        was[k, NODE] = v
        was[0, COUNT] = k


@part
def _join(tour: Array, a: int, b: int, length: int) -> None:
    """Let b follow a; both are saved."""
    tour[a, FOLLOW], tour[b, BEFORE], tour[b, BACK] = b, a, length


@part
def put_in(tour: Array, was: Array, a: int, v: int, to: int, on: int) -> None:
    """Put v in behind a, so far from it and the next one; tour (n, 4), journal `was` (n + 1, 4)."""
    b = tour[a, FOLLOW]
    _save(tour, was, a)
    _save(tour, was, v)
    _save(tour, was, b)
    _join(tour, a, v, to)
    _join(tour, v, b, on)


@part
def take_out(tour: Array, was: Array, d: Array, v: int) -> int:
    """Take an inner node out of a tour (n, 4) with a journal `was` (n + 1, 4); return the change of length.

    Lengths are `d` (n, n).
    """
    a, b = tour[v, BEFORE], tour[v, FOLLOW]
    _save(tour, was, a)
    _save(tour, was, v)
    _save(tour, was, b)
    change = d[a, b] - tour[v, BACK] - tour[b, BACK]
    _join(tour, a, b, d[a, b])
    tour[v, BEFORE] = tour[v, FOLLOW] = -1
    return change


@part
def _leads(tour: Array, v: int, to: int, w: int, on: int, work: Array) -> bool:
    """Return whether the tour leads from v onwards to one node, rather than from w to another."""
    count, found = 0, False
    while True:
        count += 1
        if v == to:
            found = True
            break
        if w == on:
            break
        v, w = tour[v, FOLLOW], tour[w, FOLLOW]
        if v < 0:
            break
        if w < 0:
            found = True
            break
    work[MOVED] += count
    return found


@part
def _turn(tour: Array, was: Array, first: int, last: int, enter: int, leave: int, work: Array) -> None:
    """Turn the string from first to last round; the roads into it and out of it have these lengths then."""
    a, b = tour[first, BEFORE], tour[last, FOLLOW]
    _save(tour, was, a)
    _save(tour, was, b)
    v, previous, step, count = last, a, enter, 0
    while v != a:
        _save(tour, was, v)
        onward, road = tour[v, BEFORE], tour[v, BACK]
        tour[v, BEFORE], tour[v, FOLLOW], tour[v, BACK] = previous, onward, step
        v, previous, step = onward, v, road
        count += 1
    tour[a, FOLLOW] = last
    _join(tour, first, b, leave)
    work[MOVED] += count


@part
def _crossed(
    d: Array, near: Array, apart: Array, tour: Array, was: Array, a: int, ends: Array, work: Array
) -> int:
    """Apply the first improving 2-opt move at node a; return the change, nodes touched in ends."""
    width, count = min(SHORTEN, near.shape[1]), 0
    for side in range(2):
        b = tour[a, FOLLOW] if side == 0 else tour[a, BEFORE]
        if b < 0:
            continue
        ab = tour[b, BACK] if side == 0 else tour[a, BACK]
        for q in range(width):
            ac = apart[a, q]
            count += 1
            if ac >= ab:
                break
            c = near[a, q]
            e = tour[c, FOLLOW] if side == 0 else tour[c, BEFORE]
            if e < 0:
                continue
            be = d[b, e]
            delta = ac + be - ab - (tour[e, BACK] if side == 0 else tour[c, BACK])
            if delta < 0:
                if side == 0:
                    if _leads(tour, b, c, e, a, work):
                        _turn(tour, was, b, c, ac, be, work)
                    else:
                        _turn(tour, was, e, a, ac, be, work)
                elif _leads(tour, c, b, a, e, work):
                    _turn(tour, was, c, b, be, ac, work)
                else:
                    _turn(tour, was, a, e, be, ac, work)
                ends[0], ends[1], ends[2], ends[3] = a, b, c, e
                work[NEIGHBOUR] += count
                return delta
    work[NEIGHBOUR] += count
    return 0


@part
def _carry(tour: Array, was: Array, first: int, last: int, p: int, gap: int, to: int, on: int) -> None:
    """Put the string from first to last behind p; lengths over the hole it leaves, into it and out of it."""
    x, y = tour[first, BEFORE], tour[last, FOLLOW]
    for v in (first, last, x, y, p):
        _save(tour, was, v)
    _join(tour, x, y, gap)
    q = tour[p, FOLLOW]
    _save(tour, was, q)
    _join(tour, p, first, to)
    _join(tour, last, q, on)


@part
def _better_place(
    d: Array,
    near: Array,
    apart: Array,
    tour: Array,
    was: Array,
    a: int,
    other: int,
    inner: int,
    forward: bool,
    ends: Array,
    work: Array,
) -> int:
    """Move the string with ends a and other to where a is next to a neighbour, if that is shorter.

    `forward` if a is its first node; `inner` is its node between the two, if any. Returns the change.
    """
    first, last = (a, other) if forward else (other, a)
    x, y = tour[first, BEFORE], tour[last, FOLLOW]
    gap = d[x, y]
    out = tour[first, BACK] + tour[y, BACK] - gap
    count, delta = 0, 0
    for q in range(min(SHORTEN, near.shape[1]) if out > 0 else 0):
        ac = apart[a, q]
        count += 1
        if ac >= out:
            break
        c = near[a, q]
        if tour[c, FOLLOW] < 0 or c in (other, inner):
            continue
        for behind in (True, False):  # c, a, .., other, e or e, other, .., a, c
            e = tour[c, FOLLOW] if behind else tour[c, BEFORE]
            if (e == first) if behind else (e == last):
                continue
            oe = d[other, e]
            delta = ac + oe - (tour[e, BACK] if behind else tour[c, BACK]) - out
            if delta < 0:
                if forward != behind and first != last:
                    _turn(tour, was, first, last, 0, 0, work)
                    first, last = last, first
                if behind:
                    _carry(tour, was, first, last, c, gap, ac, oe)
                else:
                    _carry(tour, was, first, last, e, gap, oe, ac)
                ends[0], ends[1], ends[2], ends[3] = x, y, c, e
                work[NEIGHBOUR] += count
                return delta
    work[NEIGHBOUR] += count
    return 0


@part
def _better_at(
    d: Array, near: Array, apart: Array, tour: Array, was: Array, a: int, ends: Array, work: Array
) -> int:
    """Apply the first improving 2-opt or or-opt move at node a; return the change, nodes touched in ends."""
    delta = _crossed(d, near, apart, tour, was, a, ends, work)
    if delta < 0 or tour[a, BEFORE] < 0:
        return delta
    for forward in (True, False):
        other, inner = a, -1
        for size in range(_STRING):
            if tour[other, FOLLOW] < 0 or tour[other, BEFORE] < 0:
                break
            if forward or size > 0:
                delta = _better_place(d, near, apart, tour, was, a, other, inner, forward, ends, work)
                if delta < 0:
                    return delta
            other, inner = (tour[other, FOLLOW] if forward else tour[other, BEFORE]), other
    return 0


@numba.njit(cache=True, nogil=True)
def shorten(
    d: Array,
    near: Array,
    apart: Array,
    tour: Array,
    was: Array,
    queue: Array,
    waits: Array,
    count: int,
    work: Array,
) -> int:
    """Shorten a tour by 2-opt and or-opt from some nodes on; return the change of length.

    `queue` (q,) is a ring whose first `count` nodes wait, `waits` (n,) tells whether a node waits; both are
    empty afterwards.
    """
    ends = np.empty(4, np.int64)
    room = len(queue)
    head, change = 0, 0
    while count > 0:
        a = queue[head]
        head = head + 1 if head + 1 < room else 0
        count -= 1
        waits[a] = False
        if tour[a, BEFORE] < 0 and tour[a, FOLLOW] < 0:
            continue
        while True:
            delta = _better_at(d, near, apart, tour, was, a, ends, work)
            if delta == 0:
                break
            change += delta
            for v in ends:
                if v != a and not waits[v]:
                    waits[v] = True
                    tail = head + count
                    queue[tail if tail < room else tail - room] = v
                    count += 1
    return change


@kernel
def _anywhere(d: Array, tour: Array, v: int) -> tuple[int, int]:
    """Return the node behind which v is put in at least cost, and the cost; looks at all places."""
    place, extra, w = -1, 0, 0
    while tour[w, FOLLOW] >= 0:
        b = tour[w, FOLLOW]
        e = d[v, w] + d[v, b] - tour[b, BACK]
        if place < 0 or e < extra:
            place, extra = w, e
        w = b
    return place, extra


@part
def cheapest(
    d: Array, near: Array, apart: Array, tour: Array, size: int, v: int, work: Array
) -> tuple[int, int]:
    """Return the node behind which v is put in at least cost, and the cost.

    Looks beside v's neighbours and at the ends, in a tour of few nodes (`size`) everywhere. Lengths `d`
    (n, n), `near` and `apart` (n, K), `tour` (n, 4) and `work` (KINDS,) are as in the module.
    """
    if size <= _SMALL + 2:
        work[PLACE] += size
        return _anywhere(d, tour, v)
    last = len(d) - 1
    place, b, count, seen = 0, tour[0, FOLLOW], 0, 0
    extra = d[v, 0] + d[v, b] - tour[b, BACK]
    b = tour[last, BEFORE]
    e = d[v, b] + d[v, last] - tour[last, BACK]
    if e < extra:
        place, extra = b, e
    for q in range(near.shape[1]):
        w = near[v, q]
        count += 1
        if w < 0:
            break
        b, c = tour[w, BEFORE], tour[w, FOLLOW]
        if b < 0:
            continue
        to = apart[v, q]
        e = d[v, b] + to - tour[w, BACK]
        if e < extra:
            place, extra = b, e
        e = d[v, c] + to - tour[c, BACK]
        if e < extra:
            place, extra = w, e
        seen += 1
        if seen >= PLACES:
            break
    work[PLACE] += count
    return place, extra
