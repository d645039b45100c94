"""Endings that might replace the rest of a list of steps, for plans that no table reaches.

They come from the rest of the plan with stops left out, and from the exact routing engine on mean values,
asked again from the place, time and energy of early, usual and late futures. Where the kind of sol is hidden,
also on the mean values of the kind that is likeliest there.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from planner.contingency.reduction import mean_routing
from planner.contingency.sampled.conditions import Arrivals
from planner.contingency.sampled.futures import Line, Sampler
from planner.contingency.seeding import route_steps
from planner.evaluate.model import Model
from planner.plan_edits import steps_at
from planner.plan_tree import Branch, Navigate, Observe, OnFail, Path, Plan, TrackStart

if TYPE_CHECKING:
    from planner.orienteering import RoutingProblem
    from planner.orienteering.exact import ExactSolver

QUANTILES = (0.15, 0.5, 0.85)
SHARES = (1.0, 0.85)
"""Of the budgets that are left, for routes on mean values."""

ROUTE_LABELS = 20_000
"""Labels for one route of an ending. By hand."""


class Endings:
    """Routes on mean values from anywhere in a plan; one table answers for all of them on one kind of sol."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self.routing = mean_routing(model.problem)
        self.solvers: dict[int | None, tuple[RoutingProblem, ExactSolver | None]] = {}
        self.known: dict[Any, tuple[int, ...]] = {}

    def solver(self, kind: int | None) -> tuple[RoutingProblem, ExactSolver | None]:
        """Return the routing problem of a kind of sol and its table; of the means over all kinds for None."""
        from planner.orienteering.exact import ExactSolver

        if kind not in self.solvers:
            known = self.routing if kind is None else mean_routing(self.model.by_kind[kind][1].problem)
            self.solvers[kind] = known, ExactSolver(known) if ExactSolver.fits(known) else None
        return self.solvers[kind]

    def route(
        self, place: int, t_s: float, e_j: float, without: frozenset[int], kind: int | None = None
    ) -> tuple[int, ...]:
        """Return the best route from a place on; `without` are the observations that it cannot make."""
        p, solver = self.solver(kind)
        time, energy = round(t_s / 60.0) * 60, round(e_j / 2000.0) * 2000
        if solver is None or time >= p.time_budget or energy >= (p.energy_budget or 0):
            return ()
        key = place, time, energy, without, kind
        if key not in self.known:
            start = replace(p, start_site=place, start_time=time, energy_used=energy, done=without)
            self.known[key] = solver.solve(start, iterations=ROUTE_LABELS).route
        return self.known[key]

    def candidates(self, sampler: Sampler, line: Line, path: Path, arrivals: Arrivals) -> list[Plan]:
        """Return endings that might replace the rest of a list."""
        rest = tuple(s for s in steps_at(line.plan, path) if not isinstance(s, Branch))
        made, place = sampler.before(line.plan, path)
        found: dict[Plan, None] = {(): None}
        stops = [k for k, step in enumerate(rest) if isinstance(step, Navigate)]
        for j, k in enumerate(stops):
            found.setdefault(rest[k:])
            end = stops[j + 1] if j + 1 < len(stops) else len(rest)
            found.setdefault((*rest[:k], *rest[end:]))
        for k, step in enumerate(rest):
            if isinstance(step, Observe):
                found.setdefault((*rest[:k], *rest[k + 1 :]))
        started = {self.model.place_of[s.target] for s in line.plan if isinstance(s, TrackStart)}
        for ending in self._routes(arrivals, made, place, started):
            found.setdefault(route_steps(self.model, ending, place, OnFail.SKIP))
        found.pop(rest, None)
        before = sum(1 << m for m in made)
        return [
            steps
            for steps in found
            if self.model.admits(before | sum(1 << m for m in sampler.observations(steps)))
        ]

    def _routes(
        self, arrivals: Arrivals, made: frozenset[int], place: int, started: set[int]
    ) -> Iterator[tuple[int, ...]]:
        model = self.model
        p = self.routing
        for quantile in QUANTILES:
            t = float(np.quantile(arrivals.time_s, quantile))
            e = float(np.quantile(arrivals.energy_j, quantile))
            off = np.abs(arrivals.time_s - t)
            # a quantile may lie between times that are few and far apart
            near = off <= max(float(np.ptp(arrivals.time_s)) * 0.1 + 1.0, float(off.min()))
            lost = {
                m
                for m in range(model.m)
                if model.is_place[m]
                and (
                    int(model.obs_place[m]) not in started
                    or float(arrivals.kept(int(model.obs_place[m]))[near].mean()) < 0.5
                )
            }
            kinds = dict.fromkeys((None, arrivals.likeliest_kind(near)))
            for share in SHARES:
                late = p.time_budget - share * (p.time_budget - t)
                used = (p.energy_budget or 0) - share * ((p.energy_budget or 0) - e)
                for kind in kinds:
                    yield self.route(place, late, used, made | lost, kind)
