"""The states in which the steps of the plan of an order may be met, and their chances, budgets aside."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit, uint64

from planner.contingency.why_not.order_run import DRIVE_FOR_TRACK, OBSERVE
from planner.evaluate.hashing import mix
from planner.evaluate.model import Floats, Ints
from planner.evaluate.rollout import Costs, World

PASSES, DRIVES, OBSERVES = 0, 1, 2
"""What a step comes to in a state."""


class Layers(NamedTuple):
    """The states in which each step of a plan may be met, and where they lead.

    States of step k are rows `first[k]` to `first[k + 1]` of `states` [states, 4]: place, what is done of
    what is asked ahead, what is tracked, and where no drive leads. Rows `out[s]` to `out[s + 1]` of `to` and
    `odds` are the states that state s leads to and their chances; those of an observation are the state after
    it, and the state when its window has closed.
    """

    first: Ints
    states: Ints
    what: Ints
    out: Ints
    to: Ints
    odds: Floats


@njit(cache=True, nogil=True)
def _asked_ahead(steps: Ints, world: World, track_leg_s: float) -> Ints:
    """Return, for each step and the end, which observations it or a later one asks for, to which places they
    drive and which tracks matter, as bits; [steps + 1, 3].
    """
    count = steps.shape[0]
    ahead = np.zeros((count + 1, 3), np.int64)
    for k in range(count - 1, -1, -1):
        ahead[k] = ahead[k + 1]
        i = steps[k, 1]
        if steps[k, 0] == OBSERVE:
            place = world.obs_place[i]
            ahead[k, 0] |= (1 << i) | world.predecessors[i]
            if world.diminishing[place] != 1.0:
                ahead[k, 0] |= world.target_bits[place]
            if world.is_place[i]:
                ahead[k, 0] |= world.place_bits[place]
                ahead[k, 2] |= 1 << place
        else:
            ahead[k, 1] |= 1 << i
            if steps[k, 0] == DRIVE_FOR_TRACK:
                ahead[k, 2] |= 1 << i
            if track_leg_s > 0.0:
                ahead[k, 2] = -1
    return ahead


@njit(cache=True, nogil=True)
def _number(
    table: Ints, states: Ints, begin: int, count: int, place: int, done: int, tracked: int, closed: int
) -> int:
    """Return the row of a state among rows `begin` to `count`; `count` where it is new, and put in the table
    of rows [a power of 2] then.
    """
    key = mix(uint64(done) + uint64(0x9E3779B97F4A7C15) * uint64(tracked + 1))
    key = mix(key ^ (uint64(place) + uint64(64) * uint64(closed)))
    mask = np.int64(table.shape[0] - 1)
    slot = np.int64(key & uint64(mask))
    while table[slot] >= begin:
        row = table[slot]
        if (
            states[row, 0] == place
            and states[row, 1] == done
            and states[row, 2] == tracked
            and states[row, 3] == closed
        ):
            return row
        slot = (slot + 1) & mask
    table[slot] = count
    return count


@njit(cache=True, nogil=True)
def wider(old: Any) -> Any:
    """Return an array [2 * rows, ...] that begins with the rows of another."""
    new = np.empty((2 * old.shape[0], *old.shape[1:]), old.dtype)
    new[: old.shape[0]] = old
    return new


@njit(cache=True, nogil=True)
def layers_of(steps: Ints, starts: int, world: World, windows: Floats, costs: Costs) -> Layers:
    """Return the states of the steps [steps, 2] of an order whose tracks `starts` (bits) are started.

    `windows` are [m, 2].
    """
    length, n1 = steps.shape[0], world.n + 1
    ahead = _asked_ahead(steps, world, costs.track_leg)
    first, out = np.zeros(length + 2, np.int64), np.zeros(256, np.int64)
    states, what = np.zeros((256, 4), np.int64), np.zeros(256, np.int64)
    to, odds = np.zeros(1024, np.int64), np.zeros(1024)
    states[0, 2] = starts & ahead[0, 2]
    count, links = 1, 0
    table = np.full(512, -1)
    first[1] = 1
    for k in range(length):
        begin = first[k + 1]
        kind, i = steps[k, 0], steps[k, 1]
        for s in range(first[k], begin):
            place, done, tracked, closed = states[s, 0], states[s, 1], states[s, 2], states[s, 3]
            out[s] = links
            lossy, fails = np.int64(0), 0.0
            what[s] = PASSES
            after = done
            left = tracked
            if kind == OBSERVE:
                target = world.obs_place[i]
                if (
                    place == target
                    and not (done >> i) & 1
                    and (not world.is_place[i] or (tracked >> target) & 1)
                    and not world.predecessors[i] & ~done
                ):
                    what[s] = OBSERVES
                    after = done | (1 << i)
                    if world.is_place[i] and not world.place_bits[target] & ~after:
                        left &= ~(1 << target)
            elif (
                place != i
                and world.has_leg[place, i]
                and not (closed >> i) & 1
                and (kind != DRIVE_FOR_TRACK or (tracked >> i) & 1)
            ):
                what[s] = DRIVES
                fails = world.fails[place, i]
                for p in range(1, n1):
                    if (tracked >> p) & 1 and world.loss[place, i, p] > 0.0:
                        lossy |= 1 << p
            lost = lossy
            while True:  # over all parts of the tracks that may be lost, and the closed window last
                chance = 1.0
                for p in range(1, n1):
                    if (lossy >> p) & 1:
                        loss = world.loss[place, i, p]
                        chance *= loss if (lost >> p) & 1 else 1.0 - loss
                for failed in range(2):
                    odd = chance * (fails if failed else 1.0 - fails) if what[s] == DRIVES else 1.0
                    if failed and (
                        what[s] == PASSES or (what[s] == OBSERVES and windows[i, 1] >= costs.t_max)
                    ):
                        continue
                    if odd <= 0.0:
                        continue
                    if what[s] == DRIVES:
                        there = place if failed else i
                        then_done, then_tracked = done, tracked & ~lost
                        shut = closed | (1 << i) if failed else closed
                    else:
                        there, shut = place, closed
                        then_done, then_tracked = (done, tracked) if failed else (after, left)
                    if count == states.shape[0]:
                        states, what, out = wider(states), wider(what), wider(out)
                    if 2 * (count - begin) + 2 > table.shape[0]:
                        table = np.full(2 * table.shape[0], -1)
                        for row in range(begin, count):
                            _number(
                                table, states, begin, row,
                                states[row, 0], states[row, 1], states[row, 2], states[row, 3],
                            )  # fmt: skip
                    states[count, 0] = there if k + 1 < length else 0
                    states[count, 1] = then_done & ahead[k + 1, 0]
                    states[count, 2] = then_tracked & ahead[k + 1, 2]
                    states[count, 3] = shut & ahead[k + 1, 1]
                    row = _number(
                        table, states, begin, count,
                        states[count, 0], states[count, 1], states[count, 2], states[count, 3],
                    )  # fmt: skip
                    if row == count:
                        count += 1
                    if links == to.shape[0]:
                        to, odds = wider(to), wider(odds)
                    to[links], odds[links] = row, odd
                    links += 1
                if lost == 0:
                    break
                lost = (lost - 1) & lossy
        first[k + 2] = count
    if count == out.shape[0]:
        out = wider(out)
    for s in range(first[length], count):
        out[s] = links
    out[first[length]] = links
    return Layers(first, states, what, out, to, odds)
