"""Plans on mean values: the deterministic orienteering problem behind seed and branch plans of the 2004
planner.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from planner.evaluate.model import Model
from planner.evaluate.propagate import State
from planner.plan_tree import Navigate, Observe, OnFail, Plan, Step, TrackStart

MAX_LABELS = 60_000


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
    return _best_route(model, state, t_s, g_j, state.tracked, None, must).order


def mean_seed(model: Model, *, must: int = 0) -> tuple[int, ...]:
    """Return the best route from the start on mean values, each placed target tracked from the start at its
    cost.
    """
    best, best_key = _Label(0.0, 0.0, 0.0, ()), (-must.bit_count(), 0.0)
    for count in range(int(np.count_nonzero(model.trackable)) + 1):
        t, g = count * model.track_t_s, count * model.track_e_j
        if t > model.t_max_s or g + model.hotel_w * t > model.e_max_j:
            break
        label = _best_route(model, State(0, 0, 0), t, g, 0, count, must)
        held = sum(1 << m for m in label.order)
        key = (-(must & ~held).bit_count(), label.value)
        if key > best_key:
            best, best_key = label, key
    return best.order


def _best_route(
    model: Model, state: State, t_s: float, g_j: float, tracked: int, count: int | None, must: int
) -> _Label:
    """Return the best route by label setting over (set, last place) with Pareto-optimal (time, drive energy).

    `count` None: the targets in `tracked` are tracked. Else so many targets are tracked, which ones being
    what the route chooses, and only routes that place on exactly so many are answers.
    """
    usable = [
        m
        for m in range(model.m)
        if not (state.done >> m) & 1
        and (not model.is_place[m] or count is not None or (tracked >> int(model.obs_place[m])) & 1)
        and model.utility[m] > 0.0
    ]
    worth = {m: model.expected_utility_of(m, state.done) for m in usable}
    fading = bool(np.any(model.diminishing != 1.0))
    limited = model.data_limit_mbit < math.inf
    best = _Label(0.0, t_s, g_j, ())
    best_key = (-(must & ~state.done).bit_count(), 0.0) if count in (None, 0) else (-model.m - 1, 0.0)
    layer: dict[tuple[int, int], list[_Label]] = {(0, state.place): [best]}
    made = 0
    while layer and made < MAX_LABELS:
        following: dict[tuple[int, int], list[_Label]] = {}
        for (chosen, place), labels in layer.items():
            over = [p for p in range(1, model.n + 1) if not int(model.place_bits[p]) & ~(chosen | state.done)]
            placed = {int(model.obs_place[m]) for m in usable if (chosen >> m) & 1 and model.is_place[m]}
            if count is None:
                carried = sum(1 for p in range(1, model.n + 1) if (tracked >> p) & 1 and p not in over)
            else:
                carried = count - sum(1 for p in placed if p in over)
            for label in labels:
                for m in usable:
                    if (chosen >> m) & 1 or int(model.predecessors[m]) & ~(chosen | state.done):
                        continue
                    if limited and not model.fits_downlink(chosen | state.done | 1 << m):
                        continue
                    target = int(model.obs_place[m])
                    fresh = model.is_place[m] and target not in placed
                    if count is not None and fresh and len(placed) >= count:
                        continue
                    t, g = label.t_s, label.g_j
                    hops = model.hops(place, target)
                    if target != place and not hops:
                        continue
                    for a, b in pairwise((place, *hops)):
                        t += model.leg[a, b, 0] + carried * model.track_leg_s
                        g += model.leg[a, b, 2]
                    if t > model.window[m, 1]:
                        continue
                    t = max(t, float(model.window[m, 0])) + model.obs[m, 0]
                    g += model.obs[m, 2]
                    if t > model.t_max_s or g + model.hotel_w * t > model.e_max_j:
                        continue
                    value = label.value + (
                        model.expected_utility_of(m, chosen | state.done) if fading else worth[m]
                    )
                    rivals = following.setdefault((chosen | 1 << m, target), [])
                    if any(r.t_s <= t and r.g_j <= g and r.value >= value for r in rivals):
                        continue
                    new = _Label(value, t, g, (*label.order, m))
                    rivals[:] = [r for r in rivals if not (t <= r.t_s and g <= r.g_j and value >= r.value)]
                    rivals.append(new)
                    made += 1
                    if count is not None and len(placed) + fresh != count:
                        continue
                    key = (-(must & ~(chosen | 1 << m | state.done)).bit_count(), value)
                    if key > best_key or (key == best_key and (t, g) < (best.t_s, best.g_j)):
                        best, best_key = new, key
        layer = following
    if best_key[0] == -model.m - 1:
        return _Label(-1.0, t_s, g_j, ())
    return best


def route_steps(model: Model, order: tuple[int, ...], place: int, on_fail: OnFail) -> Plan:
    """Return the drives and observations of a route, each drive to a placed target asking for its track."""
    steps: list[Step] = []
    for k, m in enumerate(order):
        target = int(model.obs_place[m])
        tid = model.target_ids[target - 1]
        if target != place:
            later = [x for x in order[k:] if int(model.obs_place[x]) == target]
            tracked = all(model.is_place[x] for x in later)
            steps += round_about(model, place, target)
            steps.append(Navigate(tid, tracked, on_fail))
            place = target
        steps.append(Observe(model.observation_ids[m], tid, on_fail))
    return tuple(steps)


def round_about(model: Model, place: int, target: int) -> list[Step]:
    """Return the drives through other places that lead to a target where no leg does."""
    hops = model.hops(place, target) if place != target else ()
    return [Navigate(model.target_ids[p - 1], False, OnFail.SKIP) for p in hops[:-1]]


def track_steps(model: Model, observations: set[int]) -> Plan:
    """Return the starts of tracking for the targets of the placed observations among these."""
    targets = sorted({int(model.obs_place[m]) for m in observations if model.is_place[m]})
    return tuple(TrackStart(model.target_ids[p - 1]) for p in targets)
