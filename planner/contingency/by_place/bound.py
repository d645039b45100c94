"""Upper bounds where no table of all live sets fits: multipliers, and at each place a memory of its own.

Multipliers and memory are searched for on few nodes, where values only lie near the true ones; what is found
there bounds nothing. The bound is what one relaxation on many nodes says, above the true values, at the end.
With many tracks most of the search knows only days that begin with few: that is half of the work.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from planner.contingency.by_place.layout import Memory, Size, Wanted
from planner.contingency.by_place.memories import Credits
from planner.contingency.by_place.multipliers import Multipliers
from planner.contingency.by_place.relaxation import Actions, NgRelaxation
from planner.contingency.priced_relaxation import Weights
from planner.evaluate.model import Model
from planner.tally import now_s

COARSE = 64
"""Nodes on which multipliers and memory are found. By hand."""

FIRST_STEPS, MORE_STEPS, FIRST_AIM = 6, 14, 0.1
"""Points looked at for energy and for time with no memory but a place's own, and more for the closer of them;
how far the first step aims below the bound. By hand."""

STEPS, AIM = 10, 0.02
"""Points looked at with a memory at most, and how far the first step aims: it begins near the best."""

LOOKS, ENOUGH = 3, 2e-3
"""Of so many points in a row the share of the value that must be won, else more memory wins more. By hand: at
15 targets of seed 8231140 few nodes say 77.7 after 15 s, with ten points for each memory 78.3, and with four
77.6; at 30 of 7548764 the bound is 112.6 in 21 s, and with four points 113.7."""

FIRST_SHARE, LARGER, LEAST_LARGER, LARGEST_SHARE = 1 / 1000, 1.5, 1.15, 1 / 12
"""Share of the limit that a question with the first larger memory takes, what each next one may take more and
must take more, and the largest share. Before each the policies so far are followed. By hand, on 15 and 30
targets."""

LAST, USUAL = (384, 320, 256, 192, 160, 128), 160
"""Nodes of the bound itself, from the closest on, of which the first with room for the memory found are
taken; and those that the search leaves room for. By hand, at 15 targets of seed 8231140 with a small memory:
256 lie 0.1 % above 768, 160 0.2 and 128 0.4 %."""

LAST_SHARE, ROOM = 0.3, 0.95
"""Share of the limit for the bound itself, and how much of what is left is used. By hand."""

MOST_COUNTED = 15
"""Tracks counted: with none that is two registers (`kernels.LANES`). By hand."""

FEW, WIDER = 7, 2.0
"""Tracks that days of the search begin with at most where there are more than are counted, and how many times
longer a question takes that knows of all: with none, seven are one register. By hand: at 30 targets of seed
7548764 the bound is 113.6 instead of 114.2 in 21 s; at 15 of 8231140, whose best days begin with 7 to 9, it
would be 78.1 instead of 77.9."""

WIDER_STEPS = 3
"""Points looked at with all tracks at the end of the search. By hand: 5 take a second from the memory."""

LARGEST_MB = 1200.0
"""Largest relaxation, MB. By hand, as `bounds.TABLE_MB`."""

MARGIN = 2e-5
"""Relative allowance for single precision, of all that is summed."""


def ng_bound(model: Model, *, limit_s: float) -> float:
    """Return what no policy earns more than; infinite where the limit allows no relaxation.

    `limit_s` are seconds of a processor as `planner.tally` reckons them.
    """
    until = now_s() + limit_s
    found = searched(model, limit_s=limit_s)
    if found is None:
        return math.inf
    left_s = ROOM * (until - now_s())
    nodes = max(_usual(model, limit_s), _finest(model, found.relaxation.memory, left_s))
    limits = [(nodes, MOST_COUNTED, left_s)]
    memory = found.credits.enlarged(found.relaxation.memory, limits, LARGEST_MB)
    actions = Actions.of(model, found.relaxation.weights, nodes, MOST_COUNTED)
    last = NgRelaxation(model, actions, memory, followed=False)
    value, point = found.asked(last, lambda: now_s() + last.size.seconds > until)
    owed = float(point @ last.wanted.chance)
    return value + MARGIN * (abs(value) + model.penalty + owed) + 1e-9


def searched(model: Model, *, limit_s: float) -> Multipliers | None:
    """Return multipliers with the memory that they were found for, on few nodes; None where the limit allows
    no relaxation. They leave the last share of the limit for the bound itself.
    """
    model.require_one_kind("a bound by places")
    wanted = Wanted.of(model)
    if not len(wanted.number) or not model.has_leg[:, 1:].any():
        return None
    nodes, size = _usual(model, limit_s), Size.of(model, _own(model), MOST_COUNTED, COARSE)
    if not nodes or (2 * FIRST_STEPS + MORE_STEPS) * size.seconds > limit_s or size.table_mb > LARGEST_MB:
        return None
    return _searched(model, _own(model), nodes, limit_s)


def _own(model: Model) -> Memory:
    """Return the memory of each place's own observations."""
    place = Wanted.of(model).place
    return Memory.of((np.nonzero(place == p)[0].tolist() for p in range(model.n + 1)), {})


def _usual(model: Model, limit_s: float) -> int:
    """Return the nodes that the search leaves room for; 0 where a limit allows none."""
    return min(USUAL, _finest(model, _own(model), LAST_SHARE * limit_s))


def _finest(model: Model, memory: Memory, limit_s: float) -> int:
    """Return the most nodes of the bound itself that a limit allows with a memory; 0 where it allows none."""
    for nodes in LAST:
        size = Size.of(model, memory, MOST_COUNTED, nodes)
        if size.seconds <= limit_s and size.bound_mb <= LARGEST_MB:
            return nodes
    return 0


def _searched(model: Model, own: Memory, nodes: int, limit_s: float) -> Multipliers:
    """Return multipliers with the memory that they were found for, on few nodes.

    A question of that memory on `nodes` nodes takes no more than its share of the limit.
    """
    until = now_s() + (1.0 - LAST_SHARE) * limit_s
    first, most = [], FEW if int(Wanted.of(model).counted.sum()) > MOST_COUNTED else MOST_COUNTED
    for share in (1.0, 0.0):
        actions = Actions.of(model, Weights.of(model, share), COARSE, most, above=False)
        search = Multipliers(NgRelaxation(model, actions, own, few=most == FEW), Credits(model))
        search.lower(FIRST_STEPS, FIRST_AIM, partial(_is_past, until))
        first.append(search)
    search = min(first, key=lambda one: float(one.least.max()))
    search.lower(MORE_STEPS, FIRST_AIM, partial(_is_past, until))
    each_s = max(FIRST_SHARE * limit_s, LARGER * search.relaxation.size.seconds)
    last_s = ROOM * LAST_SHARE * limit_s
    few = not search.relaxation.knows_all
    reserved = WIDER * WIDER_STEPS if few else 0.0
    while True:
        before = search.relaxation
        room_s = (until - now_s()) / (LOOKS + reserved)
        each_s = min(each_s, LARGEST_SHARE * limit_s, room_s)
        if each_s < LEAST_LARGER * before.size.seconds:
            break
        limits = [(COARSE, before.most, each_s), (nodes, MOST_COUNTED, last_s)]
        memory = search.credits.enlarged(before.memory, limits, LARGEST_MB)
        if memory == before.memory or Size.of(model, memory, MOST_COUNTED, COARSE).table_mb > LARGEST_MB:
            break
        search.relaxation = NgRelaxation(model, before.actions, memory, few=few)
        stop_s = until - reserved * search.relaxation.size.seconds
        search.lower(STEPS, AIM, partial(_is_past, stop_s), enough=(LOOKS, ENOUGH))
        each_s *= LARGER
    if few:
        search = _with_all_tracks(model, search)
        search.lower(WIDER_STEPS - 1, AIM, partial(_is_past, until))
    return search


def _is_past(until_s: float) -> bool:
    return now_s() > until_s


def _with_all_tracks(model: Model, search: Multipliers) -> Multipliers:
    """Return the multipliers found so far for days that begin with any number of tracks."""
    relaxation = search.relaxation
    actions = Actions.of(model, relaxation.weights, COARSE, MOST_COUNTED, above=False)
    return search.with_more_tracks(NgRelaxation(model, actions, relaxation.memory))
