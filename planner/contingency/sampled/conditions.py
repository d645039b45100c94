"""The condition under which another plan wins most, from what it wins in each of a number of futures.

The counterpart of `conditions` where no grid holds the states: futures that come to a point stand in order of
time or energy, and the best run of them is found exactly; at most one test on a track goes before.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from planner.contingency.conditions import Choice
from planner.evaluate.model import Floats, Ints, Model, Truths
from planner.plan_tree import Comparison, Condition, EnergyCondition, TimeCondition, TrackedCondition
from planner.tally import Step, spend

SEARCHED = 0.2
"""What the search for a run of futures takes beside them, in `Step.CALL`. By hand, on 15 targets."""

SIMPLER = 1.02
"""An additional test must win by this factor."""

ONE_KIND = np.zeros(0, np.int64)


class Arrivals:
    """Futures that come to a point: time, s, energy, J, and tracks there, each of shape (count,).

    `kind` is that of each sol, which no plan knows; empty where all are of one.
    """

    def __init__(self, time_s: Floats, energy_j: Floats, tracked: Ints, kind: Ints = ONE_KIND) -> None:
        self.time_s, self.energy_j, self.tracked, self.kind = time_s, energy_j, tracked, kind
        self.by_time = np.argsort(time_s, kind="stable")
        self.by_energy = np.argsort(energy_j, kind="stable")

    def kept(self, place: int) -> Truths:
        """Return which futures still track the target at a place."""
        return np.asarray((self.tracked >> place) & 1 == 1)

    def likeliest_kind(self, near: Truths) -> int | None:
        """Return the kind of sol that most of some of the futures have: of largest odds given their progress.

        None where all sols are of one kind.
        """
        return int(np.bincount(self.kind[near]).argmax()) if len(self.kind) else None


def fitted_condition(model: Model, arrivals: Arrivals, gains: Floats, tracks: list[int]) -> Choice:
    """Return the condition that collects most of `gains` (count,), in utility, and how much that is in sum.

    `tracks` are the places whose track may be tested.
    """
    best = _on_resources(arrivals, gains, None)
    for place in tracks:
        kept = arrivals.kept(place)
        if kept.all() or not kept.any():
            continue
        for truth in (False, True):
            within = kept if truth else ~kept
            if float(np.maximum(gains[within], 0.0).sum()) <= best.gain * SIMPLER:
                continue
            choice = _on_resources(arrivals, gains, within)
            if choice.gain > best.gain * SIMPLER:
                test = TrackedCondition(model.target_ids[place - 1], truth)
                best = Choice(choice.gain, (test, *choice.when))
    return best


def _on_resources(arrivals: Arrivals, gains: Floats, within: Truths | None) -> Choice:
    """Return the best test on time or energy among the futures within a part."""
    inside = np.ones(len(gains), np.bool_) if within is None else within
    best = Choice(max(float(gains[inside].sum()), 0.0), ())
    for order, values, kind in (
        (arrivals.by_time, arrivals.time_s, TimeCondition),
        (arrivals.by_energy, arrivals.energy_j, EnergyCondition),
    ):
        spend(Step.CALL, SEARCHED)
        spend(Step.ELEMENT, len(gains))
        runs = _runs(gains, order, inside)
        low, high, gain = _best_run(runs)
        if runs.length < 2 or gain <= best.gain * SIMPLER + 1e-9:
            continue
        line = values[order[inside[order]]]
        when: list[Condition] = []
        if low > 0:
            when.append(kind(Comparison.GE, _between(line, low)))
        if high < len(line):
            when.append(kind(Comparison.LT, _between(line, high)))
        best = Choice(gain, tuple(when))
    return best


class _Runs(NamedTuple):
    """Of numbers in order: how many, and the runs of largest sum of those that end last, of those that begin
    first, and of all: bounds low..high-1 and sums. The first of equals.
    """

    length: int
    last: int  # low
    last_gain: float
    first: int  # high
    first_gain: float
    low: int
    high: int
    gain: float


@njit(cache=True, nogil=True)
def _runs(gains: Floats, order: Ints, inside: Truths) -> _Runs:
    """Return the runs of `gains` in an order, of those inside a part, (count,) each."""
    count, total = 0, 0.0
    least, at_least, most, at_most = 0.0, 0, 0.0, 0
    low, high, rise = 0, 0, 0.0
    for k in order:
        if not inside[k]:
            continue
        total += gains[k]
        count += 1
        if total < least:
            least, at_least = total, count
        if total > most:
            most, at_most = total, count
        if total - least > rise:
            low, high, rise = at_least, count, total - least
    return _Runs(count, at_least, total - least, at_most, most, low, high, rise)


def _best_run(runs: _Runs) -> tuple[int, int, float]:
    """Return the run low..high-1 of largest sum; one with an open end when that is nearly as good."""
    best = runs.last, runs.length, runs.last_gain
    if runs.first_gain > best[2]:
        best = 0, runs.first, runs.first_gain
    if runs.gain > best[2] * SIMPLER:
        best = runs.low, runs.high, runs.gain
    return best


def _between(line: Floats, k: int) -> float:
    return round(float(line[k - 1] + line[k]) / 2.0, 3)
