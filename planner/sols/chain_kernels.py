"""Compiled loops of chains: the best way through one sol for rewards of drives, observations and nights.

A state is a place, what is remembered of the observations made, and a node of time or of energy drawn. What
is remembered at a place is a set of observations near it (`Memory`); the others may be made again.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

import numba
import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]
Loop = TypeVar("Loop", bound=Callable[..., Any])


def _compiled(loop: Loop) -> Loop:
    return numba.njit(cache=True, nogil=True, fastmath=True)(loop)


class Memory(NamedTuple):
    """What is remembered at places, as sets of up to g bits.

    `sets` (P,) is how many sets a place has. A drive a -> b keeps what both places remember: `kept`
    (P, P, 2^g) is the number of that set among `classes` (P, P), `there` and `here` (P, P, 2^g) are its
    numbers at b and at a. `own` (P, o) lists the observations of a place, -1 behind the last, `bit` (m,) is 1
    shifted by the place of an observation among what its own place remembers, 0 where it is not remembered.
    """

    sets: Array
    classes: Array
    kept: Array
    there: Array
    here: Array
    own: Array
    bit: Array


class Moves(NamedTuple):
    """What actions take on one grid of nt nodes: chances of drives (P, P, nt) and observations (m, nt) to
    move j nodes on, the first j and the one behind the last (..., 2), the chances that drives move on by
    less than j nodes (P, P, nt + 1), where drives lead (P, P), and drives that may fail (P, P).
    """

    leg: Array
    in_time: Array
    leg_span: Array
    obs: Array
    obs_span: Array
    has_leg: Array
    fails: Array


class Rewards(NamedTuple):
    """What successes earn on one sol: drives (P, P), observations (m,), and less for a node of waiting;
    between which nodes observations may begin (m,), the last -1 where they may not.
    """

    leg: Array
    obs: Array
    wait: float
    opens: Array
    closes: Array


SETTLED = 1e-9
"""Change up to which values at one node of time count as settled, in utility."""

SWEEPS = 60
"""Most sweeps over one node. By hand."""


@_compiled
def _some_stay(moves: Moves) -> bool:
    for a in range(len(moves.leg)):
        for b in range(len(moves.leg)):
            if moves.has_leg[a, b] and moves.leg_span[a, b, 0] == 0:
                return True
    return bool((moves.obs_span[:, 0] == 0).any())


@_compiled
def best_chain(
    moves: Moves, memory: Memory, rewards: Rewards, ends: Array, sure: bool, value: Array, reached: Array,
    act: Array,
) -> bool:  # fmt: skip
    """Write the most that is earned from each state on, `value` and `reached`, and what is done, `act`: 0
    ends the sol, b drives to b, P + m observes m. Return whether values settled where moves stay at a node.

    All arrays are [P, sets, nt]. `ends` is what ending the sol is worth, at the last node where an action is
    over the limit. What an action comes to is the better of what follows its success and of the end there.
    With `sure`, values hold for all amounts between a node and the next: `reached` is the better of both.
    """
    places, _, nt = value.shape
    stays = _some_stay(moves)
    driven = np.zeros((3, places, value.shape[1]))
    for t in range(nt - 1, -1, -1):
        for a in range(places):
            for s in range(memory.sets[a]):
                reached[a, s, t] = reached[a, s, t + 1] if t + 1 < nt else ends[a, s, t]
        change = 0.0
        for _ in range(SWEEPS):
            change = 0.0
            for a in range(places):
                _drives(moves, memory, rewards, a, t, reached, driven)
                for s in range(memory.sets[a] - 1, -1, -1):
                    best, what = _best_drive(moves, memory, rewards, a, s, ends[a, s], t, reached, driven)
                    for m in memory.own[a]:
                        if m >= 0 and t <= rewards.closes[m] and not s & memory.bit[m]:
                            after = reached[a, s | memory.bit[m]]
                            found = _observed(moves, rewards, m, ends[a, s], t, sure, after)
                            if found > best:
                                best, what = found, places + m
                    value[a, s, t], act[a, s, t] = best, what
                    if sure and t + 1 < nt:
                        best = max(best, value[a, s, t + 1])
                    change = max(change, abs(best - reached[a, s, t]))
                    reached[a, s, t] = best
            if not stays or change <= SETTLED:
                break
        if stays and change > SETTLED:
            return False
    return True


@_compiled
def _drives(
    moves: Moves, memory: Memory, rewards: Rewards, a: int, t: int, reached: Array, driven: Array
) -> None:
    """Write what drives from a place come to that end in time: the sum over their chances, the least and the
    largest, (3, P, kept sets).
    """
    nt = reached.shape[2]
    for b in range(1, reached.shape[0]):
        if not moves.has_leg[a, b]:
            continue
        row, reward = moves.leg[a, b], rewards.leg[a, b]
        low, high = moves.leg_span[a, b, 0], min(moves.leg_span[a, b, 1], nt - t)
        for kept in range(memory.classes[a, b]):
            after, back = reached[b, memory.there[a, b, kept]], reached[a, memory.here[a, b, kept]]
            total, least, most = 0.0, np.inf, -np.inf
            for j in range(low, high):
                found = reward + after[t + j]
                if moves.fails[a, b]:
                    found = max(found, back[t + j])
                total += row[j] * found
                least, most = min(least, found), max(most, found)
            driven[0, b, kept], driven[1, b, kept], driven[2, b, kept] = total, least, most


@_compiled
def _best_drive(
    moves: Moves, memory: Memory, rewards: Rewards, a: int, s: int, end: Array, t: int, reached: Array,
    driven: Array,
) -> tuple[float, int]:  # fmt: skip
    """Return the best of ending the sol, worth `end` (nt,), and of all drives, and which it is."""
    nt = reached.shape[2]
    best, what = end[t], 0
    for b in range(1, reached.shape[0]):
        if not moves.has_leg[a, b]:
            continue
        kept = memory.kept[a, b, s]
        if driven[2, b, kept] <= best and end[t] >= end[nt - 1]:
            continue
        low, high = moves.leg_span[a, b, 0], min(moves.leg_span[a, b, 1], nt - t)
        within = moves.in_time[a, b, max(high, low)]
        found = driven[0, b, kept] + (1.0 - within) * end[nt - 1]
        if driven[1, b, kept] < end[t]:
            after, back = reached[b, memory.there[a, b, kept]], reached[a, memory.here[a, b, kept]]
            found = (1.0 - within) * end[nt - 1]
            for j in range(low, high):
                come = rewards.leg[a, b] + after[t + j]
                if moves.fails[a, b]:
                    come = max(come, back[t + j])
                found += moves.leg[a, b, j] * max(come, end[t + j])
        if found > best:
            best, what = found, b
    return best, what


@_compiled
def _observed(moves: Moves, rewards: Rewards, m: int, end: Array, t: int, sure: bool, after: Array) -> float:
    """Return what an observation is worth that is begun at a node, or when its window opens."""
    begin = max(t, rewards.opens[m])
    reward = rewards.obs[m] - rewards.wait * max(begin - t - (1 if sure else 0), 0)
    total, within = 0.0, 0.0
    for j in range(moves.obs_span[m, 0], min(moves.obs_span[m, 1], len(after) - begin)):
        total += moves.obs[m, j] * max(reward + after[begin + j], end[begin + j])
        within += moves.obs[m, j]
    return float(total + (1.0 - within) * end[len(end) - 1])


FAINT = 1e-9
"""Chance of a state up to which it is not followed."""


@_compiled
def followed(
    moves: Moves, memory: Memory, rewards: Rewards, ends: Array, reached: Array, act: Array, chance: Array,
    driven: Array, made: Array, ended: Array,
) -> float:  # fmt: skip
    """Follow the best chain from chances of states, `chance` [P, sets, nt], and return the nodes waited;
    write expected drives [P, P], observations [m] and states in which the sol ends [P, sets, nt].

    A move that stays at its node is taken for one of a node.
    """
    places, _, nt = reached.shape
    waited = 0.0
    for t in range(nt):
        for a in range(places):
            for s in range(memory.sets[a]):
                q = chance[a, s, t]
                if q <= FAINT:
                    continue
                what, begin, there, after = act[a, s, t], t, a, s
                if what == 0:
                    ended[a, s, t] += q
                    continue
                if what < places:
                    there = what
                    after = memory.there[a, what, memory.kept[a, what, s]]
                    row, span, reward = moves.leg[a, what], moves.leg_span[a, what], rewards.leg[a, what]
                else:
                    m = what - places
                    begin, after = max(t, rewards.opens[m]), s | memory.bit[m]
                    row, span = moves.obs[m], moves.obs_span[m]
                    reward = rewards.obs[m] - rewards.wait * (begin - t)
                left = q
                for j in range(span[0], min(span[1], nt - begin)):
                    to, p = min(begin + max(j, 1), nt - 1), q * row[j]
                    left -= p
                    if reward + reached[there, after, to] <= ends[a, s, to]:
                        ended[a, s, to] += p
                        continue
                    if what < places:
                        driven[a, what] += p
                    else:
                        made[what - places] += p
                        waited += p * (begin - t)
                    if to > t:
                        chance[there, after, to] += p
                    else:
                        ended[there, after, to] += p
                ended[a, s, nt - 1] += left
    return waited
