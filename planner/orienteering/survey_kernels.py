"""Compiled annealing of one survey tour: take out, put in, shorten, accept.

Length has a penalty in prize: a step takes out strings of neighbouring nodes, puts back what is worth its
detour, and is accepted on prize less penalty times length. The penalty follows the length, so that the tour
stays about as long as the budget and each corner of the map is improved by itself. What is kept is the best
tour within the budget.
"""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np
import numpy.typing as npt

from planner.orienteering.tour_kernels import (
    BACK,
    BEFORE,
    COUNT,
    FOLLOW,
    KINDS,
    MOVED,
    NODE,
    OFFER,
    STEP,
    cheapest,
    kernel,
    part,
    put_in,
    random,
    route_of,
    shorten,
    take_out,
    tour_of,
    undo,
)

Array = npt.NDArray[Any]

# Set by hand on the tuning files that docs/results/orienteering.md names, as are the numbers of `survey`.
_STRING = 6  # longest string taken out: of 4 to 16, the least gap after 1 s
_STRINGS = 3  # most strings taken out in a step
_HOLES = 6  # places of the tour beside a hole whose neighbours are offered
_OFFERED = 5  # neighbours offered there: at eight places eight each, eight files were 0.37 % worse after 1 s
_SMALL, _MANY = 50, 8  # nodes up to which a map has more of both, and how many: steps are cheap there
_OVER = 0.05  # of the budget by which a tour may be longer for a while
_FOLLOW = 20.0  # of the penalty to what the tour is longer than the budget, as a share: 1 % longer, 1.2 times
_DRIFT = 0.02  # of the penalty at each of its updates, for the same
_EVERY = 16  # steps between two updates of penalty and temperature
_DOUBT = 0.2  # random part of the penalty at which one node is put in
_NOISE = 0.4  # most random part of the order in which nodes are put in
_LEAST = 1e-9  # penalty on length, in mean prize over budget: where everything fits, length costs nothing
_TURNS = 4  # times that nodes are put in and the tour is shortened in a step, if both change it
POWERS = np.linspace(0.5, 2.0, 16)
"""Of prize, in the order in which nodes are put in; a step takes one of them."""

WHICH, AFTER, EXTRA = range(3)
"""Columns of what is offered (n, 3): the node, the one behind which it costs least, and its detour there."""
SCORE, APPEAL, MOST = range(3)
"""Columns of its worth (n, 3): appeal against detour, appeal, and the longest detour that it is worth."""


@part
def _let_wait(queue: Array, waits: Array, waiting: int, v: int) -> int:
    """Let a node wait that does not; return how many wait."""
    if not waits[v]:
        waits[v] = True
        queue[waiting] = v
        waiting += 1
    return waiting


@kernel
def _take_out(
    d: Array,
    near: Array,
    tour: Array,
    was: Array,
    centre: int,
    size: int,
    state: Array,
    gone: Array,
    offers: Array,
) -> tuple[int, int]:
    """Take strings round a node out of a tour and offer them again; return how many nodes, and the change."""
    width = near.shape[1]
    longest = min(_STRING, max(1, (size - 2) // 2))
    count = 0
    for c in range(1 + int(random(state) * _STRINGS)):
        v = centre
        if c > 0:
            v = near[centre, int(random(state) * width)]
            if v < 0 or tour[v, BEFORE] < 0:
                continue
        run = 1 + int(random(state) * longest)
        for _ in range(int(random(state) * run)):
            if tour[tour[v, BEFORE], BEFORE] >= 0:
                v = tour[v, BEFORE]
        for _ in range(run):
            if not gone[v]:
                gone[v] = True
                offers[count, WHICH] = v
                count += 1
            v = tour[v, FOLLOW]
            if tour[v, FOLLOW] < 0:
                break
    change = 0
    for k in range(count):
        v = offers[k, WHICH]
        gone[v] = False
        change += take_out(tour, was, d, v)
    return count, change


@kernel
def _beside_holes(tour: Array, was: Array, queue: Array, waits: Array) -> int:
    """Let the nodes beside holes wait; return how many."""
    waiting = 0
    for k in range(1, was[0, COUNT] + 1):
        v = was[k, NODE]
        if tour[v, BEFORE] >= 0 or tour[v, FOLLOW] >= 0:
            waiting = _let_wait(queue, waits, waiting, v)
    return waiting


@kernel
def _offer(
    near: Array,
    tour: Array,
    queue: Array,
    waiting: int,
    shown: int,
    marked: Array,
    step: int,
    offers: Array,
    count: int,
) -> int:
    """Offer what is near the first that wait, beside what is offered already; return how many are."""
    for c in range(count):
        marked[offers[c, WHICH]] = step
    for p in range(waiting):
        a = queue[p]
        for q in range(min(near.shape[1], shown)):
            v = near[a, q]
            if v >= 0 and tour[v, BEFORE] < 0 and marked[v] != step:
                marked[v] = step
                offers[count, WHICH] = v
                count += 1
    return count


@kernel
def _rebuild(
    d: Array,
    near: Array,
    apart: Array,
    tour: Array,
    was: Array,
    size: int,
    room: int,
    small: float,
    offers: Array,
    worth: Array,
    count: int,
    queue: Array,
    waits: Array,
    waiting: int,
    work: Array,
) -> tuple[int, int, int]:
    """Put offered nodes in, best appeal against detour first, none at more detour than it is worth.

    `size` is how many nodes the tour has, `room` the length that may be added. Returns how many nodes are
    offered still, before those put in; the length added; and how many nodes wait to be shortened.
    """
    added, looked = 0, count
    best, best_score = -1, 0.0
    for c in range(count):
        after, extra = cheapest(d, near, apart, tour, size, offers[c, WHICH], work)
        score = worth[c, APPEAL] / (max(extra, 0) + small)
        offers[c, AFTER], offers[c, EXTRA], worth[c, SCORE] = after, extra, score
        if score > best_score and extra <= worth[c, MOST] and extra <= room:
            best, best_score = c, score
    while best >= 0:
        v, a = offers[best, WHICH], offers[best, AFTER]
        b = tour[a, FOLLOW]
        av, vb = d[v, a], d[v, b]
        added += offers[best, EXTRA]
        left = room - added
        size += 1
        put_in(tour, was, a, v, av, vb)
        waiting = _let_wait(queue, waits, waiting, a)
        waiting = _let_wait(queue, waits, waiting, v)
        waiting = _let_wait(queue, waits, waiting, b)
        count -= 1
        for k in range(3):
            offers[best, k], offers[count, k] = offers[count, k], offers[best, k]
            worth[best, k], worth[count, k] = worth[count, k], worth[best, k]
        best, best_score = -1, 0.0
        looked += count
        for c in range(count):
            w, extra = offers[c, WHICH], offers[c, EXTRA]
            if offers[c, AFTER] == a:  # its place is gone
                after, extra = cheapest(d, near, apart, tour, size, w, work)
                offers[c, AFTER], offers[c, EXTRA] = after, extra
                worth[c, SCORE] = worth[c, APPEAL] / (max(extra, 0) + small)
            else:
                one, two = d[a, w] + d[v, w] - av, d[v, w] + d[b, w] - vb
                if min(one, two) < extra:
                    after, extra = (a, one) if one <= two else (v, two)
                    offers[c, AFTER], offers[c, EXTRA] = after, extra
                    worth[c, SCORE] = worth[c, APPEAL] / (max(extra, 0) + small)
            if worth[c, SCORE] > best_score and extra <= worth[c, MOST] and extra <= left:
                best, best_score = c, worth[c, SCORE]
    work[OFFER] += looked
    return count, added, waiting


@kernel
def _list_again(tour: Array, was: Array, inner: Array, place: Array, count: int) -> None:
    """Bring the list of inner nodes (n,), of which there were `count`, up to date after a step."""
    for k in range(1, was[0, COUNT] + 1):
        v = was[k, NODE]
        inside = tour[v, BEFORE] >= 0
        if inside == (was[k, BEFORE] >= 0):
            continue
        if inside:
            inner[count], place[v] = v, count
            count += 1
        else:
            count -= 1
            w = inner[count]
            inner[place[v]], place[w] = w, place[v]


@numba.njit(cache=True, nogil=True)
def anneal(
    d: Array,
    near: Array,
    apart: Array,
    prize: Array,
    powers: Array,
    budget: int,
    route: Array,
    heat: Array,
    penalty: Array,
    state: Array,
    steps: int,
    most: float,
    weight: Array,
) -> tuple[Array, int, float]:
    """Return the best tour within the budget, the steps done and what they cost.

    Parameters
    ----------
    d, near, apart
        Lengths in the unit of `budget`, and neighbours, as in `tour_kernels`.
    prize, powers
        Prizes (n,), integers, 0 at both ends; and to each of `POWERS` (16, n).
    route
        Tour (k,) to begin with, nodes by number, within the budget.
    heat
        First and last temperature (2,), in prize units.
    penalty
        Of length (1,), in prize; moved on.
    state
        Of the random numbers (1,); moved on.
    steps, most
        Where it ends: so many steps, or work that costs so much.
    weight
        Cost (KINDS,) of each kind of work.
    """
    n = len(prize)
    work = np.zeros(KINDS, np.int64)
    tour, was = tour_of(d, route)
    size, length, value = len(route), 0, 0
    inner, place = np.empty(n, np.int64), np.empty(n, np.int64)
    for i in range(1, size):
        length += tour[route[i], BACK]
        value += prize[route[i]]
        inner[i - 1], place[route[i]] = route[i], i - 1
    best, best_size, best_value, best_length = np.empty(n, np.int64), size, value, length
    best[:size] = route
    offers, worth = np.empty((n, 3), np.int64), np.empty((n, 3))
    queue, waits = np.empty(4 * n + 8, np.int64), np.zeros(n, np.bool_)
    marked, gone = np.zeros(n, np.int64), np.zeros(n, np.bool_)
    holes, shown = (_HOLES, _OFFERED) if n > _SMALL else (_MANY, _MANY)
    limit = int(budget * (1.0 + _OVER))
    least = _LEAST * heat[0] / max(1, budget)
    cooling = math.log(heat[1] / heat[0])
    now, warm, spent = penalty[0], heat[0], 0.0
    step = 0
    while step < steps:
        if step % _EVERY == 0:
            spent = (work * weight).sum()
            if spent >= most:
                break
            warm = heat[0] * math.exp(cooling * max(step / steps, spent / most))
            over = length / max(1, budget) - 1.0
            penalty[0] = max(least, penalty[0] * math.exp(_DRIFT * over))
            now = penalty[0] * math.exp(_FOLLOW * over)
        step += 1
        was[0, STEP], was[0, COUNT] = step, 0
        grown, earned, count, waiting = 0, 0, 0, 0
        if size > 2:
            centre = inner[int(random(state) * (size - 2))]
            count, grown = _take_out(d, near, tour, was, centre, size, state, gone, offers)
            waiting = _beside_holes(tour, was, queue, waits)
        else:  # a tour of nothing has two ends and no hole
            waiting = _let_wait(queue, waits, _let_wait(queue, waits, 0, 0), n - 1)
        m = size - count
        for c in range(count):
            earned -= prize[offers[c, WHICH]]
        count = _offer(near, tour, queue, min(waiting, holes), shown, marked, step, offers, count)
        offered = count
        of, noise = int(random(state) * len(powers)), _NOISE * random(state)
        small = 0.02 * budget / m + 1e-9
        for c in range(count):
            v = offers[c, WHICH]
            worth[c, APPEAL] = powers[of, v] * (1.0 + noise * (2.0 * random(state) - 1.0))
            worth[c, MOST] = prize[v] / now * (1.0 + _DOUBT * (2.0 * random(state) - 1.0))
        for turn in range(_TURNS):
            before = count
            room = limit - length - grown
            count, added, waiting = _rebuild(
                d, near, apart, tour, was, m, room, small, offers, worth, count, queue, waits, waiting, work
            )
            m += before - count
            grown += added
            if turn > 0 and count == before:
                break
            change = shorten(d, near, apart, tour, was, queue, waits, waiting, work)
            waiting = 0
            grown += change
            if change == 0:
                break
        work[MOVED] += was[0, COUNT]
        for c in range(count, offered):
            earned += prize[offers[c, WHICH]]
        if length + grown <= budget and (
            value + earned > best_value or (value + earned == best_value and length + grown < best_length)
        ):
            best_size, best_value, best_length = route_of(tour, best), value + earned, length + grown
            work[MOVED] += best_size
        delta = earned - now * grown
        if delta >= 0 or random(state) < math.exp(delta / warm):
            _list_again(tour, was, inner, place, size - 2)
            size, value, length = m, value + earned, length + grown
        else:
            undo(tour, was)
    return best[:best_size].copy(), step, (work * weight).sum()
