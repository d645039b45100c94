"""Compiled sweeps over one resource: the value of the Lagrangean relaxation, and what its policy does.

Axes: a leg e, a count of carried tracks c, a vertex v (a place and what is left to do in this stay), a live
set s (bits, and above them the number of tracks that are counted only), a node i of the resource. Kernels
hold the mass that an action moves 0, 1, ... nodes on.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from planner.evaluate.model import Floats, Ints

Singles = NDArray[np.float32]

SWEEPS = 4
"""Rounds over the actions that may end on the node they begin on. By hand: their chance is far below 1 %."""

FAINT = 1e-7
"""Chance of a state below which the policy is not followed further."""


class Layout(NamedTuple):
    """The moves of a Lagrangean relaxation on one resource."""

    origin: Ints  # (legs,)
    to: Ints  # (legs,)
    leg: Singles  # (legs, counts, band) mass by nodes moved
    loss: Floats  # (legs, bits) chance to lose what a bit of the live set stands for
    before: Ints  # (arcs,) vertex where an observation begins
    after: Ints  # (arcs,) vertex where it ends
    made: Ints  # (arcs,) the observation
    place: Ints  # (vertices,)
    head: Ints  # (places,) vertex on arrival
    observation: Singles  # (observations, band)
    close: Ints  # (observations,) last node at which it may begin
    bit: Ints  # (observations,) its bit in the live set, -1 if it has none
    need: Ints  # (observations,) bits that must be gone before
    counted: NDArray[np.bool_]  # (observations,) takes one of the tracks that are counted only
    thin: Floats  # (legs, most + 1, most + 1) chance that so many of so many counted tracks are left
    whole: bool  # the largest count is a number, and not that many or more
    carried: Ints  # (sets,) number of tracks
    tracks: int  # bits that stand for tracked targets
    bits: int
    nodes: int
    penalty: float


class Tables(NamedTuple):
    """Values plus penalty (vertices, sets, nodes), the same before a leg's end, and what is done."""

    value: Singles
    arriving: Singles  # (legs, sets, nodes)
    choice: NDArray[
        np.int32
    ]  # leg, legs + arc, -1 ends the day, -2 - bit gives up a track, -2 - bits a counted one


@njit(cache=True, nogil=True)
def _left(a: Layout, m: int, s: int) -> int:
    """Return the live set after an observation, -1 where it cannot be made."""
    if a.bit[m] >= 0:
        left = s & ~(1 << a.bit[m])
        return left if left != s else -1
    if not a.counted[m]:
        return s
    count = s >> a.bits
    if count == a.thin.shape[1] - 1 and not a.whole:
        return s
    return s - (1 << a.bits) if count > 0 else -1


@njit(cache=True, nogil=True, fastmath=True)
def backward(a: Layout, gain: Floats, stay: float, w: Tables) -> None:
    """Fill the tables from the last node to the first.

    `gain` [observations] is the worth of each observation less its multiplier, in utility; `stay` is the
    largest chance that an action moves no node on.
    """
    legs, arcs, vertices, places = len(a.origin), len(a.made), len(a.place), len(a.head)
    band, short = a.leg.shape[2], a.observation.shape[1]
    by_leg, by_arc = np.empty(legs), np.empty(arcs)
    x, y = np.empty(vertices), np.empty(vertices)
    going, leg_of = np.empty(places), np.empty(places, np.int64)
    one, most = 1 << a.bits, a.thin.shape[1] - 1
    for i in range(a.nodes - 1, -1, -1):
        for s in range((most + 1) << a.bits):
            c = a.carried[s]
            top: float = a.penalty
            for k in range(arcs):
                m = a.made[k]
                by_arc[k] = -1.0
                left = _left(a, m, s)
                if left < 0 or gain[m] <= 0.0 or i > a.close[m] or a.need[m] & s:
                    continue
                v = np.float32(0.0)
                mass = np.float32(0.0)
                for j in range(1, min(short, a.nodes - i)):
                    v += a.observation[m, j] * w.value[a.after[k], left, i + j]
                    mass += a.observation[m, j]
                v += (mass + a.observation[m, 0]) * gain[m]
                if left != s:
                    v += a.observation[m, 0] * w.value[a.after[k], left, i]
                by_arc[k] = v
                top = max(top, float(v))
            for e in range(legs):
                v = np.float32(0.0)
                for j in range(1, min(band, a.nodes - i)):
                    v += a.leg[e, c, j] * w.arriving[e, s, i + j]
                by_leg[e] = v
                top = max(top, float(v))
            for p in range(vertices):
                for b in range(a.bits):
                    if (a.tracks & s) >> b & 1:
                        top = max(top, float(w.value[p, s & ~(1 << b), i]))
                if s >= one:
                    top = max(top, float(w.value[p, s - one, i]))
            x[:] = top / (1.0 - stay)  # above the fixed point, so every round stays above it
            for _ in range(SWEEPS):
                going[:] = a.penalty
                leg_of[:] = -1
                for e in range(legs):
                    v = by_leg[e] + a.leg[e, c, 0] * x[a.head[a.to[e]]]
                    if v > going[a.origin[e]]:
                        going[a.origin[e]] = v
                        leg_of[a.origin[e]] = e
                for p in range(vertices):
                    y[p] = going[a.place[p]]
                    w.choice[p, s, i] = leg_of[a.place[p]]
                    for b in range(a.bits):
                        if (a.tracks & s) >> b & 1 and w.value[p, s & ~(1 << b), i] > y[p]:
                            y[p] = w.value[p, s & ~(1 << b), i]
                            w.choice[p, s, i] = -2 - b
                    if s >= one and w.value[p, s - one, i] > y[p]:
                        y[p] = w.value[p, s - one, i]
                        w.choice[p, s, i] = -2 - a.bits
                for k in range(arcs):
                    if by_arc[k] < 0.0:
                        continue
                    m, p = a.made[k], a.before[k]
                    v = by_arc[k]
                    if _left(a, m, s) == s:
                        v += a.observation[m, 0] * x[a.after[k]]
                    if v > y[p]:
                        y[p] = v
                        w.choice[p, s, i] = legs + k
                x[:] = y
            for p in range(vertices):
                w.value[p, s, i] = x[p]
        for e in range(legs):
            for s in range(len(a.carried)):
                w.arriving[e, s, i] = w.value[a.head[a.to[e]], s, i]
            for b in range(a.bits):
                lost = a.loss[e, b]
                if lost > 0.0:
                    for s in range(len(a.carried)):
                        if (s >> b) & 1:
                            other = w.arriving[e, s & ~(1 << b), i]
                            w.arriving[e, s, i] += lost * (other - w.arriving[e, s, i])
            for k in range(most, 0, -1):
                if a.thin[e, k, k] < 1.0:
                    for s in range(one):
                        v = np.float32(0.0)
                        for j in range(k + 1):
                            v += a.thin[e, k, j] * w.arriving[e, (j << a.bits) | s, i]
                        w.arriving[e, (k << a.bits) | s, i] = v


@njit(cache=True, nogil=True, fastmath=True)
def _split(a: Layout, leg: int, s: int, here: float, sets: Ints, weights: Floats) -> int:
    """Fill in the live sets after a drive with their chances; return how many they are."""
    count = 1
    sets[0], weights[0] = s, here
    for b in range(a.bits):
        lost = a.loss[leg, b]
        if (s >> b) & 1 and lost > 0.0:
            for k in range(count):
                sets[count + k], weights[count + k] = sets[k] & ~(1 << b), weights[k] * lost
                weights[k] *= 1.0 - lost
            count *= 2
    tracks, split = s >> a.bits, count
    if a.thin[leg, tracks, tracks] < 1.0:
        for t in range(tracks):
            for k in range(split):
                sets[count] = sets[k] - ((tracks - t) << a.bits)
                weights[count] = weights[k] * a.thin[leg, tracks, t]
                count += 1
        for k in range(split):
            weights[k] *= a.thin[leg, tracks, tracks]
    return count


@njit(cache=True, nogil=True, fastmath=True)
def forward(a: Layout, choice: NDArray[np.int32], mass: Floats) -> Floats:
    """Return how often each observation is made [observations] by the policy in `choice`.

    `choice` and `mass` are [vertices, sets, nodes], as the tables are; `mass` holds the chances that the day
    begins with and is used up. Faint masses are dropped, and what moves no node on is moved one: the result
    steers multipliers, and bounds nothing.
    """
    legs, band, short = len(a.origin), a.leg.shape[2], a.observation.shape[1]
    made = np.zeros(len(a.observation))
    one = 1 << a.bits
    sets, weights = np.empty(len(a.carried), np.int64), np.empty(len(a.carried))
    for i in range(a.nodes):
        for s in range(len(a.carried) - 1, -1, -1):
            for p in range(len(a.place)):
                here = mass[p, s, i]
                done = choice[p, s, i]
                if here < FAINT or done == -1:
                    continue
                if done == -2 - a.bits:
                    mass[p, s - one, i] += here
                elif done < -1:
                    mass[p, s & ~(1 << (-2 - done)), i] += here
                elif done >= legs:
                    m, q = a.made[done - legs], a.after[done - legs]
                    left = _left(a, m, s)
                    for j in range(min(short, a.nodes - i)):
                        made[m] += here * a.observation[m, j]
                        if i + max(j, 1) < a.nodes:
                            mass[q, left, i + max(j, 1)] += here * a.observation[m, j]
                else:
                    count = _split(a, done, s, here, sets, weights)
                    for j in range(min(band, a.nodes - i)):
                        moved = a.leg[done, a.carried[s], j]
                        if moved > 0.0 and i + max(j, 1) < a.nodes:
                            for k in range(count):
                                mass[a.head[a.to[done]], sets[k], i + max(j, 1)] += weights[k] * moved
    return made
