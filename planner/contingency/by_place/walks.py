"""The policy of a relaxation in drawn futures: where it makes an observation again that it has forgotten."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from planner.contingency.by_place.kernels import (
    Drives,
    Layout,
    Masses,
    Singles,
    Tables,
    fewer,
    found_at,
    known_best,
    spread,
)
from planner.evaluate.model import Floats, Ints

MOST_LEGS = 96
"""Legs of a walk that are followed. By hand: a day has about ten."""

MOST_EVENTS = 96
"""What is made in a walk, as far as it is recorded. By hand."""


class Walks(NamedTuple):
    """Legs and events of each walk, to be filled in.

    An event says that an observation was made after a number of legs, and after how many it had been made
    before, or its track was seen lost: -1 where neither.
    """

    legs: Ints  # (walks, MOST_LEGS)
    driven: Ints  # (walks,) how many legs
    events: Ints  # (walks, MOST_EVENTS, 3) observation, legs before, legs when it had been made before
    happened: Ints  # (walks,) how many events

    @staticmethod
    def room(count: int) -> Walks:
        """Return room for so many walks."""
        legs = np.zeros((count, MOST_LEGS), np.int64)
        events = np.zeros((count, MOST_EVENTS, 3), np.int64)
        return Walks(legs, np.zeros(count, np.int64), events, np.zeros(count, np.int64))


@njit(cache=True, nogil=True)
def _arrival(
    a: Layout, w: Tables, e: int, q: int, c: int, i: int, ways: Ints, chances: Floats, u: float
) -> tuple[int, int]:
    """Return state and count after a drive: the best that may be assumed, and then what is lost by chance."""
    chosen = known_best(a, w, e, q - a.leg_base[e], c, i, ways, chances)
    count = spread(a, e, chosen, c, ways, chances)
    k = 0
    while k < count - 1 and u >= chances[k]:
        u -= chances[k]
        k += 1
    return found_at(a, w.value, e, ways[k, 0], ways[k, 1], i), ways[k, 1]


@njit(cache=True, nogil=True)
def walk(
    a: Layout,
    legs: Drives,
    made: Masses,
    w: Tables,
    memory: Ints,
    begin: tuple[int, int, int],
    draws: Floats,
    out: Walks,
) -> None:
    """Fill in what the policy of the tables does in futures with these draws (walks, numbers in [0, 1)).

    `memory` [places, bits] holds the observation of each bit, -1 where there is none. A walk ends where the
    day ends, or where its draws are used up.
    """
    count, most = len(a.origin), draws.shape[1] - 3
    room = (1 << a.held.max()) * (a.counts + 1)
    ways, chances = np.zeros((room, 2), np.int64), np.zeros(room)
    before = np.zeros(len(a.bit), np.int64)
    for k in range(len(draws)):
        s, c, i = begin
        p = np.searchsorted(a.base, s, side="right") - 1
        before[:] = -1
        driven, events, at = 0, 0, 0
        while at < most and driven < MOST_LEGS and events < MOST_EVENTS:
            done = w.choice[s, i, c]
            if done == -1:
                break
            if done == -2:
                c -= 1
            elif done < 0:
                b = -3 - done
                s, c = s + (1 << b), fewer(a, c)
                before[memory[p, b]] = driven
            elif done >= count:
                m = done - count
                out.events[k, events] = m, driven, before[m]
                events += 1
                before[m] = driven
                c = fewer(a, c) if a.counted[m] else c
                s += 1 << a.bit[m]
                i += _taken(made.summed[m], made.low[m], draws[k, at])
                at += 1
            else:
                q = a.key[a.key_base[done] + s - a.base[p]]
                i += _taken(legs.summed[done, :, c], legs.low[done], draws[k, at])
                out.legs[k, driven] = done
                driven += 1
                if i < a.nodes:
                    s, c = _arrival(a, w, done, q, c, i, ways, chances, draws[k, at + 1])
                    p = np.searchsorted(a.base, s, side="right") - 1
                    for b in range(a.bits[p]):
                        if (s - a.base[p]) >> b & 1 and before[memory[p, b]] < 0:
                            before[memory[p, b]] = driven
                at += 2
            if i >= a.nodes:
                break
        out.driven[k], out.happened[k] = driven, events


@njit(cache=True, nogil=True)
def _taken(summed: Singles, low: int, u: float) -> int:
    """Return the nodes that an action takes, at least one; all where it takes longer than the day."""
    j = low
    while j < len(summed) and summed[j] <= u:
        j += 1
    return max(j, 1)
