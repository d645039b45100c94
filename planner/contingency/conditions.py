"""Where a branch pays: the condition on time, energy and tracks under which another plan wins most.

Given, per state, the mass at a point times what another plan would win there (over the grid), the best
condition is the one that collects most of it. Thresholds are searched exactly over the nodes, one-sided and
two-sided, and then moved to where the two values cross between nodes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import Any

import numpy as np

from planner.evaluate.grid import Grid
from planner.evaluate.model import Floats, Model
from planner.evaluate.propagate import State
from planner.plan_tree import Comparison, Condition, EnergyCondition, TimeCondition, TrackedCondition
from planner.tally import Step, spend

SUMMED, SPANNED = 12, 25
"""Passes over the nodes of all states, and rows of a plan for each set of them, that a search for a condition
takes (`Step`). By hand."""

Gains = dict[State, Any]
"""Per state, mass times (value of the other plan - value of going on) over the grid."""


@dataclass(frozen=True, slots=True)
class Choice:
    """A condition and what it collects."""

    gain: float
    when: tuple[Condition, ...]


@dataclass(frozen=True, slots=True)
class _Span:
    """A run of bins lo..hi (inclusive) and its sum; `lo` 0 or `hi` last means open on that side."""

    lo: int
    hi: int
    gain: float


def _best_span(sums: Floats, two_sided: bool) -> _Span:
    total = np.concatenate([[0.0], np.cumsum(sums)])
    last = len(sums) - 1
    suffix = total[-1] - total[:-1]
    prefix = total[1:]
    k = int(np.argmax(suffix))
    best = _Span(k, last, float(suffix[k]))
    k = int(np.argmax(prefix))
    if prefix[k] > best.gain + 1e-12:
        best = _Span(0, k, float(prefix[k]))
    if two_sided:
        low = np.minimum.accumulate(total[:-1])
        k = int(np.argmax(prefix - low))
        i = int(np.argmin(total[: k + 1]))
        gain = float(prefix[k] - total[i])
        if gain > best.gain * 1.02 + 1e-9:
            best = _Span(i, k, gain)
    return best


def _crossing(edges: Floats, sums: Floats, weights: Floats, k: int) -> float:
    """Return where between bins k - 1 and k the gain per mass changes its sign."""
    if k <= 0 or k >= len(sums) or weights[k - 1] <= 0.0 or weights[k] <= 0.0:
        return float(edges[k])
    a, b = sums[k - 1] / weights[k - 1], sums[k] / weights[k]
    centre_a, centre_b = (edges[k - 1] + edges[k]) / 2.0, (edges[k] + edges[k + 1]) / 2.0
    if a * b >= 0.0:
        return float(edges[k])
    return float(np.clip(centre_a + (centre_b - centre_a) * (-a) / (b - a), edges[k - 1], edges[k + 1]))


class Bins:
    """Time and energy bins of one grid."""

    def __init__(self, grid: Grid):
        self.grid = grid
        self.time_edges: Floats = np.asarray((np.arange(grid.nt + 1) - 0.5) * grid.step_t, np.float64)
        width = max(grid.step_g, grid.model.hotel_w * grid.step_t)
        count = int(np.ceil(grid.model.e_max_j / width)) + 1
        self.energy_edges: Floats = np.asarray((np.arange(count + 1) - 0.5) * width, np.float64)
        self.energy_bin = np.clip(np.floor(grid.energy / width + 0.5).astype(np.int64), 0, count - 1)
        self.energy_count = count

    def by_time(self, values: Any) -> Floats:
        """Return sums over energy of n arrays over the grid, (n, nt, ng) to (n, nt)."""
        return np.asarray(values.sum(axis=2), np.float64)

    def by_energy(self, values: Any) -> Floats:
        """Return sums of n arrays over the grid in each bin of energy, (n, nt, ng) to (n, bins)."""
        n, count = len(values), self.energy_count
        bins = np.arange(n)[:, None] * count + self.energy_bin.ravel()
        sums = np.bincount(bins.ravel(), np.asarray(values, np.float64).ravel(), n * count)
        return np.asarray(sums.reshape(n, count), np.float64)


class _Sums:
    """Gains and masses of n states, (n, nt, ng) each, summed in the bins of time and energy.

    Sums over states are then sums of short rows; masses are summed when a condition is found.
    """

    def __init__(self, bins: Bins, gains: Any, masses: list[Any]) -> None:
        self.bins, self.gains, self._masses = bins, gains, masses
        self._kinds: tuple[tuple[type[TimeCondition] | type[EnergyCondition], Any, Floats], ...] = (
            (TimeCondition, bins.by_time, bins.time_edges),
            (EnergyCondition, bins.by_energy, bins.energy_edges),
        )
        self._gained = [project(gains) for _, project, _ in self._kinds]

    @cached_property
    def masses(self) -> Any:
        return np.array(self._masses)

    @cached_property
    def _met(self) -> list[Floats]:
        return [project(self.masses) for _, project, _ in self._kinds]

    def best(self, states: list[int]) -> Choice:
        """Return the best condition on time or energy for gains summed over some of the states."""
        whole = float(self._gained[0][states].sum())
        best = Choice(whole, ()) if whole > 0.0 else Choice(0.0, ())
        for k, (kind, _, edges) in enumerate(self._kinds):
            sums = self._gained[k][states].sum(axis=0)
            span = _best_span(sums, two_sided=True)
            if span.gain > best.gain * 1.005 + 1e-9:
                weights = self._met[k][states].sum(axis=0)
                best = Choice(span.gain, _span_conditions(span, edges, sums, weights, kind))
        return best

    def refined(self, states: list[int], best: Choice) -> Choice:
        """Return a condition on time or energy with one on the other resource where that wins more."""
        on_time = any(isinstance(c, TimeCondition) for c in best.when)
        if on_time == any(isinstance(c, EnergyCondition) for c in best.when):
            return best
        mask = _mask(self.bins.grid, best.when)
        kind, project, edges = self._kinds[1 if on_time else 0]
        sums = project((self.gains[states].sum(axis=0) * mask)[None])[0]
        span = _best_span(sums, two_sided=False)
        if span.gain <= best.gain * 1.03:
            return best
        weights = project((self.masses[states].sum(axis=0) * mask)[None])[0]
        return Choice(span.gain, (*best.when, *_span_conditions(span, edges, sums, weights, kind)))


def _span_conditions(
    span: _Span,
    edges: Floats,
    sums: Floats,
    weights: Floats,
    kind: type[TimeCondition] | type[EnergyCondition],
) -> tuple[Condition, ...]:
    found: list[Condition] = []
    if span.lo > 0:
        found.append(kind(Comparison.GE, round(_crossing(edges, sums, weights, span.lo), 3)))
    if span.hi < len(sums) - 1:
        found.append(kind(Comparison.LT, round(_crossing(edges, sums, weights, span.hi + 1), 3)))
    return tuple(found)


def _mask(grid: Grid, when: tuple[Condition, ...]) -> Any:
    mask: Any = np.ones(grid.shape)
    for condition in when:
        if isinstance(condition, TimeCondition):
            share: Any = grid.at_least_time(condition.value_s)
        elif isinstance(condition, EnergyCondition):
            share = grid.at_least_energy(condition.value_j)
        else:
            continue
        mask = mask * (share if condition.comparison is Comparison.GE else 1.0 - share)
    return mask


def best_condition(model: Model, bins: Bins, gains: Gains, masses: dict[State, Any]) -> Choice:
    """Return the conjunction of at most two tests on tracks and a range of time, of energy, or of both."""
    if not gains:
        return Choice(0.0, ())
    stacked = np.array(list(gains.values()))
    spend(Step.PASS, SUMMED * stacked.size)
    sums = _Sums(bins, stacked, [masses[s] for s in gains])
    positive = np.maximum(stacked, 0.0).sum(axis=(1, 2))
    tracked = np.array([[(s.tracked >> p) & 1 for s in gains] for p in range(model.n + 1)], np.bool_)
    tested = [p for p in range(1, model.n + 1) if tracked[p].any() and not tracked[p].all()]
    literals = [(p, truth) for p in tested for truth in (False, True)]
    groups: list[tuple[tuple[int, bool], ...]] = [(), *((one,) for one in literals)]
    groups += [pair for pair in combinations(literals, 2) if pair[0][0] != pair[1][0]]
    singles: dict[tuple[tuple[int, bool], ...], int] = {}
    best = Choice(0.0, ())
    chosen: list[int] = []
    for group in groups:
        within = np.ones(len(stacked), np.bool_)
        for p, truth in group:
            within &= tracked[p] == truth
        if float(positive[within].sum()) <= best.gain:
            continue
        count = int(within.sum())
        if len(group) == 2 and count in (singles.get((group[0],)), singles.get((group[1],))):
            continue
        singles[group] = count
        matching = np.flatnonzero(within).tolist()
        spend(Step.ROW, SPANNED)
        choice = sums.best(matching)
        if choice.gain > best.gain * (1.002 if group else 1.0) + 1e-9:
            tests = tuple(TrackedCondition(model.target_ids[p - 1], truth) for p, truth in group)
            best = Choice(choice.gain, (*tests, *choice.when))
            chosen = matching
    return sums.refined(chosen, best) if best.gain > 0.0 else best
