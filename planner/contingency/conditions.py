"""Where a branch pays: the condition on time, energy and tracks under which another plan wins most.

Given, per state, the mass at a point times what another plan would win there (over the grid), the best
condition is the one that collects most of it. Thresholds are searched exactly over the nodes, one-sided and
two-sided, and then moved to where the two values cross between nodes.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from planner.evaluate.grid import Grid
from planner.evaluate.model import Floats, Model
from planner.evaluate.propagate import State
from planner.plan_tree import Comparison, Condition, EnergyCondition, TimeCondition, TrackedCondition

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
        return np.asarray(values.sum(axis=1), np.float64)

    def by_energy(self, values: Any) -> Floats:
        flat = np.asarray(values, np.float64).ravel()
        return np.bincount(self.energy_bin.ravel(), flat, self.energy_count).astype(np.float64)


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


def _on_resources(bins: Bins, gains: Any, masses: Any) -> Choice:
    """Return the best condition on time or energy for gains summed over states."""
    whole = float(gains.sum())
    best = Choice(whole, ()) if whole > 0.0 else Choice(0.0, ())
    for kind, project, edges in (
        (TimeCondition, bins.by_time, bins.time_edges),
        (EnergyCondition, bins.by_energy, bins.energy_edges),
    ):
        sums, weights = project(gains), project(masses)
        span = _best_span(sums, two_sided=True)
        if span.gain > best.gain * 1.005 + 1e-9:
            best = Choice(span.gain, _span_conditions(span, edges, sums, weights, kind))
    return best


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
    grid = bins.grid
    tracked_somewhere = [
        p for p in range(1, model.n + 1) if 0 < sum((s.tracked >> p) & 1 for s in gains) < len(gains)
    ]
    literals = [(p, truth) for p in tracked_somewhere for truth in (False, True)]
    groups: list[tuple[tuple[int, bool], ...]] = [(), *((one,) for one in literals)]
    groups += [pair for pair in combinations(literals, 2) if pair[0][0] != pair[1][0]]
    singles: dict[tuple[tuple[int, bool], ...], float] = {}
    zero = np.zeros(grid.shape)
    best = Choice(0.0, ())
    best_sums: tuple[Any, Any] | None = None
    positive = {s: float(np.maximum(g, 0.0).sum()) for s, g in gains.items()}
    for group in groups:
        matching = [s for s in gains if all(bool((s.tracked >> p) & 1) is truth for p, truth in group)]
        if not matching or sum(positive[s] for s in matching) <= best.gain:
            continue
        if len(group) == 2 and len(matching) in (
            singles.get((group[0],), -1.0),
            singles.get((group[1],), -1.0),
        ):
            continue
        singles[group] = len(matching)
        gain = sum((gains[s] for s in matching), zero)
        mass = sum((masses[s] for s in matching), zero)
        choice = _on_resources(bins, gain, mass)
        if choice.gain > best.gain * (1.002 if group else 1.0) + 1e-9:
            tests = tuple(TrackedCondition(model.target_ids[p - 1], truth) for p, truth in group)
            best = Choice(choice.gain, (*tests, *choice.when))
            best_sums = gain, mass
    if best_sums is not None and best.gain > 0.0:
        on_time = any(isinstance(c, TimeCondition) for c in best.when)
        on_energy = any(isinstance(c, EnergyCondition) for c in best.when)
        if on_time != on_energy:
            mask = _mask(grid, best.when)
            kind, project, edges = (
                (EnergyCondition, bins.by_energy, bins.energy_edges)
                if on_time
                else (TimeCondition, bins.by_time, bins.time_edges)
            )
            sums, weights = project(best_sums[0] * mask), project(best_sums[1] * mask)
            span = _best_span(sums, two_sided=False)
            if span.gain > best.gain * 1.03:
                more = _span_conditions(span, edges, sums, weights, kind)
                best = Choice(span.gain, (*best.when, *more))
    return best
