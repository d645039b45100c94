"""How many live sets a table needs, counted by compiled code where they are bits and nothing else.

The count decides how a problem is planned before anything is drawn, and it is asked for part after part, so
it has to be quick: with ten targets the sets themselves take a second, their number a hundredth of that.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from planner.contingency.policy import MAX_STATES, Live, LiveSets, TooLargeError
from planner.evaluate.model import Ints
from planner.tally import Step, spend

MOST_BITS = 20
"""Observations up to which a set is a place in an array; a table never has more."""


def count_sets(sets: LiveSets, start: Live, *, once: bool) -> int:
    """Return how many sets `LiveSets.all_from` finds from a start; with `once`, `LiveSets.once_from`.

    Raises
    ------
    TooLargeError
        If there are more than `MAX_STATES`.
    """
    model = sets.model
    if sets.remembered or model.m > MOST_BITS:
        return len(sets.once_from([start])[0] if once else sets.all_from([start]))
    dependents, before = np.array(sets.dependents, np.int64), model.predecessors
    if once:
        given = (dependents, before, model.place_bits, model.target_bits)
        looked, found = _once(start.bits, *given, MAX_STATES)
    else:
        looked, found = _all(start.bits, dependents, before, model.is_place, model.place_bits, MAX_STATES)
    spend(Step.COUNTED, looked)
    if found > MAX_STATES:
        raise TooLargeError(f"more than {MAX_STATES} live sets")
    return int(found)


@njit(cache=True, nogil=True)
def _without(live: int, bits: int, dependents: Ints) -> int:
    left, queue = live & ~bits, live & bits
    while queue:
        fall = 0
        for m in range(len(dependents)):
            if (queue >> m) & 1:
                fall |= dependents[m]
        queue = fall & left
        left &= ~queue
    return left


@njit(cache=True, nogil=True)
def _all(
    start: int,
    dependents: Ints,
    predecessors: Ints,
    is_place: NDArray[np.bool_],
    place_bits: Ints,
    most: int,
) -> tuple[int, int]:
    """Return how many sets were looked at and found, as `LiveSets.all_from` does; stops above `most`."""
    count = len(dependents)
    seen = np.zeros(1 << count, np.bool_)
    queue = np.empty(most + 2, np.int64)
    seen[start], queue[0] = True, start
    looked, found, waiting = 0, 1, 1
    while waiting and found <= most:
        waiting -= 1
        live = queue[waiting]
        looked += 1
        for move in range(3 * count + len(place_bits) - 1):
            if move < count:  # observation made
                m = move
                if not (live >> m) & 1 or predecessors[m] & live:
                    continue
                left = live & ~(1 << m)
            elif move < 2 * count:  # image given up
                m = move - count
                if not (live >> m) & 1 or is_place[m]:
                    continue
                left = _without(live, 1 << m, dependents)
            elif move < 3 * count:  # one of several placed observations of a target given up
                m = move - 2 * count
                if not (live >> m) & 1 or not is_place[m]:
                    continue
                several = False
                for place in range(1, len(place_bits)):
                    placed = place_bits[place] & live
                    several |= bool((placed >> m) & 1) and bool(placed & (placed - 1))
                if not several:
                    continue
                left = _without(live, 1 << m, dependents)
            else:  # track lost
                placed = place_bits[move - 3 * count + 1] & live
                if not placed:
                    continue
                left = _without(live, placed, dependents)
            if not seen[left]:
                seen[left] = True
                queue[waiting] = left
                waiting += 1
                found += 1
                if found > most:
                    break
    return looked, found


@njit(cache=True, nogil=True)
def _once(
    start: int,
    dependents: Ints,
    predecessors: Ints,
    place_bits: Ints,
    target_bits: Ints,
    most: int,
) -> tuple[int, int]:
    """Return how many sets were looked at and found, as `LiveSets.once_from` does; stops above `most`."""
    count, places = len(dependents), len(target_bits)
    seen = np.zeros((1 << count, places), np.bool_)  # by the stay; column 0 is no stay
    during = np.zeros(1 << count, np.bool_)  # met during a stay
    room = 64
    queue = np.empty((room, 2), np.int64)
    seen[start, 0] = True
    queue[0] = start, 0
    looked, found, waiting = 0, 1, 1
    while waiting and found <= most:
        waiting -= 1
        live, stay = queue[waiting]
        looked += 1
        for place in range(1, places):
            here = target_bits[place] & live
            if not here or (stay and place != stay):
                continue
            placed = place_bits[place] & here
            for move in range(-2, count):
                after_stay = 0
                if move == -2:
                    left = _without(live, here, dependents)
                elif move == -1:
                    if not placed or stay:
                        continue
                    left = _without(live, placed, dependents)
                else:
                    if not (here >> move) & 1 or predecessors[move] & live:
                        continue
                    left = live & ~(1 << move)
                    if target_bits[place] & left:
                        after_stay = place
                if seen[left, 0] or seen[left, after_stay]:
                    continue
                seen[left, after_stay] = True
                if after_stay == 0:
                    found += not during[left]
                elif not during[left]:
                    during[left] = True
                    found += 1
                if waiting == room:
                    grown = np.empty((2 * room, 2), np.int64)
                    grown[:room] = queue
                    queue, room = grown, 2 * room
                queue[waiting] = left, after_stay
                waiting += 1
            if found > most:
                break
    return looked, found
