"""Rows, one after the other, to what a campaign says of them. Memory grows by three numbers a run."""

from __future__ import annotations

import heapq
import math
from array import array
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from ground.campaigns.causes import Cause, Causes
from ground.campaigns.intervals import (
    Moments,
    mean_interval,
    quantile,
    quantile_interval,
    share_interval,
)
from ground.campaigns.result import BadRun, Bin, FailureMode, Frequency, Interval, Utility
from ground.campaigns.row import Row, word_of

QUANTILES = (0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99)
WORST, EXAMPLES, MODES, BINS = 10, 3, 50, 40
PATTERNS = 1000
"""Different patterns of outcomes that are held before they are folded into counts."""
FIRST_POINT, POINT_RATIO = 10, 1.25
"""The curve of convergence has a point at 10 runs and at each 1.25 times as many."""
OVER = "over budget"


def bounds(interval: tuple[float, float]) -> Interval:
    """Return an interval as it is written; infinite ends are None."""
    low, high = interval
    return Interval(low if math.isfinite(low) else None, high if math.isfinite(high) else None)


@dataclass
class _Mode:
    utility: Moments = field(default_factory=Moments)
    worst: list[tuple[float, int]] = field(default_factory=list)

    def add(self, row: Row) -> None:
        self.utility.add(row.utility)
        _push(self.worst, EXAMPLES, row)


def _push(heap: list[tuple[float, int]], most: int, row: Row) -> None:
    """Keep the runs of lowest utility, of equal ones those of lowest seed."""
    entry = (-row.utility, -row.seed)
    if len(heap) < most:
        heapq.heappush(heap, entry)
    elif entry > heap[0]:
        heapq.heapreplace(heap, entry)


def _seeds(heap: Iterable[tuple[float, int]]) -> list[int]:
    return [-seed for _, seed in sorted(heap, reverse=True)]


class Tally:
    """Takes rows in the order of their seeds."""

    def __init__(self, causes: Causes, node_ids: Sequence[str]) -> None:
        self._causes, self._node_ids = causes, tuple(node_ids)
        self.utilities, self._ends, self._energies = array("d"), array("d"), array("d")
        self.moments = Moments()
        self.outcomes: Counter[str] = Counter()
        self.options: Counter[str] = Counter()
        self._over: Counter[str] = Counter()
        self._over_runs = 0
        self._patterns: Counter[str] = Counter()
        self._nodes: dict[str, Counter[str]] = {name: Counter() for name in self._node_ids}
        self._modes: dict[Cause, _Mode] = {}
        self._worst: list[tuple[float, int]] = []
        self._why: dict[int, str] = {}
        self._points: list[tuple[int, float, float]] = []
        self._next_point = FIRST_POINT

    @property
    def runs(self) -> int:
        return self.moments.runs

    def add(self, row: Row) -> None:
        """Take a row."""
        self.utilities.append(row.utility)
        self._ends.append(row.end_s)
        self._energies.append(row.energy_used_j)
        self.moments.add(row.utility)
        self.outcomes[row.outcome] += 1
        self.options.update(set(row.options))
        self._over.update(row.exceeded)
        self._over_runs += bool(row.exceeded)
        self._patterns[row.nodes] += 1
        if len(self._patterns) > PATTERNS:
            self._fold()
        for cause in self._causes.of_row(row):
            self._modes.setdefault(cause, _Mode()).add(row)
        _push(self._worst, WORST, row)
        if (-row.utility, -row.seed) in self._worst:
            self._why[row.seed] = self._causes.why(row)
            if len(self._why) > 8 * WORST:
                kept = set(_seeds(self._worst))
                self._why = {seed: why for seed, why in self._why.items() if seed in kept}
        if self.runs == self._next_point:
            self._note_point()
            self._next_point = math.ceil(self._next_point * POINT_RATIO)

    def _note_point(self) -> None:
        self._points.append((self.runs, self.moments.mean, self.moments.standard_error))

    def utility(self, predicted: float | None) -> Utility:
        """Return what the utilities say."""
        moments, ordered = self.moments, sorted(self.utilities)
        error = moments.standard_error
        return Utility(
            moments.mean,
            moments.sd,
            error,
            bounds(mean_interval(moments.mean, error, moments.runs)),
            {f"{p:g}": quantile(ordered, p) for p in QUANTILES},
            {f"{p:g}": bounds(quantile_interval(ordered, p)) for p in QUANTILES},
            predicted,
            None if predicted is None or error <= 0 else (moments.mean - predicted) / error,
        )

    def frequencies(self, odds: Mapping[str, float]) -> tuple[Frequency, ...]:
        """Return outcomes, options (also those never taken, where a chance was predicted) and overruns."""
        found = [self._frequency(f"outcome {name}", count) for name, count in sorted(self.outcomes.items())]
        found.append(self._frequency(OVER, self._over_runs))
        found += [self._frequency(f"{OVER} of {name}", count) for name, count in sorted(self._over.items())]
        for name in sorted({*self.options, *odds}):
            found.append(self._frequency(f"option {name}", self.options[name], odds.get(name)))
        return tuple(found)

    def _frequency(self, what: str, count: int, predicted: float | None = None) -> Frequency:
        interval = bounds(share_interval(count, self.runs))
        return Frequency(what, count, count / self.runs, interval, predicted)

    def nodes(self) -> dict[str, tuple[float, float, float, float]]:
        """Return shares of SUCCEEDED, FAILED, ABORTED and SKIPPED by node."""
        self._fold()
        return {
            name: (
                counts["SUCCEEDED"] / self.runs,
                counts["FAILED"] / self.runs,
                counts["ABORTED"] / self.runs,
                counts["SKIPPED"] / self.runs,
            )
            for name, counts in self._nodes.items()
        }

    def _fold(self) -> None:
        """Put the patterns of outcomes that came up into the counts by node."""
        for pattern, count in self._patterns.items():
            for node, letter in zip(self._node_ids, pattern, strict=True):
                self._nodes[node][word_of(letter)] += count
        self._patterns.clear()

    def failures(self) -> tuple[FailureMode, ...]:
        """Return the failure modes, the most frequent first."""
        total = self.moments.mean * self.runs
        found = []
        for cause, mode in self._modes.items():
            runs = mode.utility.runs
            others = self.runs - runs
            found.append(
                FailureMode(
                    cause.task,
                    cause.condition,
                    cause.resource,
                    runs,
                    runs / self.runs,
                    bounds(share_interval(runs, self.runs)),
                    mode.utility.mean,
                    (total - mode.utility.mean * runs) / others if others else None,
                    tuple(_seeds(mode.worst)),
                )
            )
        found.sort(key=lambda mode: (-mode.runs, mode.task, mode.condition))
        return tuple(found[:MODES])

    def worst(self) -> tuple[BadRun, ...]:
        """Return the runs of lowest utility, the worst first."""
        ranked = sorted(self._worst, reverse=True)
        return tuple(BadRun(-seed, -utility, self._why[-seed]) for utility, seed in ranked)

    def histogram(self) -> tuple[Bin, ...]:
        """Return bins of equal width over the utilities; one bin if all are equal."""
        low, high = min(self.utilities), max(self.utilities)
        if low == high:
            return (Bin(low, high, self.runs),)
        width = (high - low) / BINS
        counts = Counter(min(BINS - 1, int((u - low) / width)) for u in self.utilities)
        return tuple(Bin(low + k * width, low + (k + 1) * width, counts[k]) for k in range(BINS))

    def convergence(self) -> tuple[tuple[int, float, float], ...]:
        """Return (runs, mean, standard error) along the campaign."""
        if self._points and self._points[-1][0] == self.runs:
            return tuple(self._points)
        return (*self._points, (self.runs, self.moments.mean, self.moments.standard_error))

    def quantiles(self, what: str) -> dict[str, float]:
        """Return quantiles of `end_s` or `energy_used_j`."""
        ordered = sorted(self._ends if what == "end_s" else self._energies)
        return {f"{p:g}": quantile(ordered, p) for p in QUANTILES}
