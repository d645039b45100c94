"""Plans on mean values: the deterministic orienteering problem behind seed and branch plans of the 2004
planner.
"""

from __future__ import annotations

import itertools
from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from planner.evaluate.model import Model
from planner.evaluate.propagate import State
from planner.plan_tree import Navigate, Observe, OnFail, Plan, Step, TrackStart
from planner.tally import Step as Work
from planner.tally import spend

MAX_LABELS = 60_000
"""Labels after which the best route so far is taken. By hand."""

MOST_LEFT_OUT = 2
"""Drives of an order that are tried together without a way through other places, beside all. By hand."""


@dataclass(frozen=True, slots=True)
class _Label:
    value: float
    t_s: float
    g_j: float
    order: tuple[int, ...]


def mean_route(model: Model, state: State, t_s: float, g_j: float, *, must: int = 0) -> tuple[int, ...]:
    """Return the observations, in order, that earn most if every action takes its mean time and energy.

    Only targets tracked in `state` can be placed. Routes that hold more of `must` (bits) come before others.
    """
    best = _MeanRoutes(model, state, None, must).best(t_s, g_j)
    return () if best is None else best.order


def mean_seed(model: Model, *, must: int = 0) -> tuple[int, ...]:
    """Return the best route from the start on mean values, each placed target tracked from the start at its
    cost; where the kind of sol is hidden, on means over the kinds.
    """
    model = model.mixed()
    order: tuple[int, ...] = ()
    best_key = (-must.bit_count(), 0.0)
    for count in range(int(np.count_nonzero(model.trackable)) + 1):
        t, g = count * model.track_t_s, count * model.track_e_j
        if t > model.t_max_s or g + model.hotel_w * t > model.e_max_j:
            break
        label = _MeanRoutes(model, State(0, 0, 0), count, must).best(t, g)
        if label is None:
            continue
        held = sum(1 << m for m in label.order)
        key = (-(must & ~held).bit_count(), label.value)
        if key > best_key:
            order, best_key = label.order, key
    return order


@dataclass(frozen=True, slots=True)
class _Move:
    """Observation m next: the drives there as (time, energy), with the tracks carried, and what it earns."""

    m: int
    target: int
    placing: int
    drives: tuple[tuple[float, float], ...]
    worth: float


class _MeanRoutes:
    """Label setting over (set made, last place) with Pareto-optimal (time, drive energy).

    Drives take longer the more tracks they carry, which is why `planner.orienteering` cannot be asked. With
    `count` None the targets tracked in `state` are tracked; else so many are, which ones being what the route
    chooses, and only routes that place on exactly so many are answers.
    """

    def __init__(self, model: Model, state: State, count: int | None, must: int) -> None:
        self.model, self.state, self.count, self.must = model, state, count, must
        self.usable = [
            m
            for m in range(model.m)
            if not (state.done >> m) & 1
            and (not model.is_place[m] or count is not None or (state.tracked >> int(model.obs_place[m])) & 1)
            and model.utility[m] > 0.0
        ]
        self._best: _Label | None = None
        self._key = (0, 0.0)

    def best(self, t_s: float, g_j: float) -> _Label | None:
        """Return the best route begun with so much used; None where none places on `count` targets."""
        first = _Label(0.0, t_s, g_j, ())
        if not self.count:
            self._offer(first, 0)
        layer: dict[tuple[int, int], list[_Label]] = {(0, self.state.place): [first]}
        made = 0
        while layer and made < MAX_LABELS:
            following: dict[tuple[int, int], list[_Label]] = {}
            for (chosen, place), labels in layer.items():
                moves = self._moves(chosen, place)
                for label in labels:
                    for move in moves:
                        new = self._moved(label, move)
                        after = chosen | 1 << move.m
                        spend(Work.LABEL)
                        if new is None or not _kept(following.setdefault((after, move.target), []), new):
                            continue
                        made += 1
                        if self.count is None or move.placing == self.count:
                            self._offer(new, after)
            layer = following
        return self._best

    def _moves(self, chosen: int, place: int) -> list[_Move]:
        """Return what can be made next at or from a place once a set was made, budgets and windows aside."""
        model, before = self.model, chosen | self.state.done
        placed = {int(model.obs_place[m]) for m in self.usable if (chosen >> m) & 1 and model.is_place[m]}
        over = {p for p in range(1, model.n + 1) if not int(model.place_bits[p]) & ~before}
        if self.count is None:
            carried = sum(1 for p in range(1, model.n + 1) if (self.state.tracked >> p) & 1 and p not in over)
        else:
            carried = self.count - len(placed & over)
        overhead_s = carried * model.track_leg_s
        found = []
        for m in self.usable:
            if (chosen >> m) & 1 or int(model.predecessors[m]) & ~before:
                continue
            target = int(model.obs_place[m])
            placing = len(placed) + bool(model.is_place[m] and target not in placed)
            if self.count is not None and placing > max(self.count, len(placed)):
                continue
            hops = model.hops(place, target)
            if (target != place and not hops) or not model.admits(before | 1 << m):
                continue
            legs = [model.leg[a, b] for a, b in pairwise((place, *hops))]
            drives = tuple((float(leg[0] + overhead_s), float(leg[2])) for leg in legs)
            found.append(_Move(m, target, placing, drives, model.expected_utility_of(m, before)))
        return found

    def _moved(self, label: _Label, move: _Move) -> _Label | None:
        """Return the route with one more observation; None where it is too late for it or over a budget."""
        model, m, t, g = self.model, move.m, label.t_s, label.g_j
        for seconds, joules in move.drives:
            t += seconds
            g += joules
        opens, closes = self._windows[m]
        if t > closes:
            return None
        t = max(t, opens) + self._amounts[m][0]
        g += self._amounts[m][1]
        if t > model.t_max_s or g + model.hotel_w * t > model.e_max_j:
            return None
        return _Label(label.value + move.worth, t, g, (*label.order, m))

    @cached_property
    def _windows(self) -> list[list[float]]:
        found: list[list[float]] = self.model.window.tolist()
        return found

    @cached_property
    def _amounts(self) -> list[list[float]]:
        found: list[list[float]] = self.model.obs[:, ::2].tolist()
        return found

    def _offer(self, label: _Label, made: int) -> None:
        """Take a route as the best if it holds more of what must be made, earns more, or uses less."""
        key = (-(self.must & ~(made | self.state.done)).bit_count(), label.value)
        best = self._best
        if best is None or (key, (-label.t_s, -label.g_j)) > (self._key, (-best.t_s, -best.g_j)):
            self._best, self._key = label, key


def _kept(rivals: list[_Label], new: _Label) -> bool:
    """Put a label among those that no other is better than; return whether it is one of them."""
    if any(r.t_s <= new.t_s and r.g_j <= new.g_j and r.value >= new.value for r in rivals):
        return False
    rivals[:] = [r for r in rivals if not (new.t_s <= r.t_s and new.g_j <= r.g_j and new.value >= r.value)]
    rivals.append(new)
    return True


def route_plan(
    model: Model, order: tuple[int, ...], on_fail: OnFail = OnFail.SKIP, direct: Collection[int] = ()
) -> Plan:
    """Return the plan that tracks what a route from the start places on, and follows it."""
    return (*track_steps(model, set(order)), *route_steps(model, order, 0, on_fail, direct))


def route_steps(
    model: Model, order: tuple[int, ...], place: int, on_fail: OnFail, direct: Collection[int] = ()
) -> Plan:
    """Return the drives and observations of a route, each drive to a placed target asking for its track.

    A plan that skips comes back for the observations of later stays, so each drive asks for its own stay
    alone; one that stops does not. To the observations at the positions `direct` no drive leads through other
    places: where no leg leads to them from where the rover then is, they are left out.
    """
    steps: list[Step] = []
    at = [int(model.obs_place[m]) for m in order]
    for k, (m, target) in enumerate(zip(order, at, strict=True)):
        tid = model.target_ids[target - 1]
        if target != place:
            rest = range(k, len(order))
            if on_fail is OnFail.SKIP:
                rest = range(k, next((j for j in rest if at[j] != target), len(order)))
            tracked = all(model.is_place[order[j]] for j in rest if at[j] == target)
            if k not in direct:
                steps += round_about(model, place, target)
            steps.append(Navigate(tid, tracked, on_fail))
            place = target
        steps.append(Observe(model.observation_ids[m], tid, on_fail))
    return tuple(steps)


def routes_of(model: Model, order: tuple[int, ...]) -> list[Plan]:
    """Return the plans without branches that follow an order.

    There are several where no leg leads from one observation to the next: the rover goes through other places
    there, or leaves the next out. The latter pays where a drive before may fail, and the budget is short.
    """
    at = [0, *(int(model.obs_place[m]) for m in order)]
    missing = tuple(k for k, (a, b) in enumerate(pairwise(at)) if len(model.hops(a, b)) > 1)
    few = range(1 + min(len(missing), MOST_LEFT_OUT))
    some = itertools.chain.from_iterable(itertools.combinations(missing, count) for count in few)
    return [route_plan(model, order, direct=direct) for direct in dict.fromkeys((*some, missing))]


def round_about(model: Model, place: int, target: int) -> list[Step]:
    """Return the drives through other places that lead to a target where no leg does."""
    hops = model.hops(place, target) if place != target else ()
    return [Navigate(model.target_ids[p - 1], False, OnFail.SKIP) for p in hops[:-1]]


def track_steps(model: Model, observations: set[int]) -> Plan:
    """Return the starts of tracking for the targets of the placed observations among these."""
    targets = sorted({int(model.obs_place[m]) for m in observations if model.is_place[m]})
    return tuple(TrackStart(model.target_ids[p - 1]) for p in targets)
