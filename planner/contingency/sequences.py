"""Good unbranched plans from a distribution of states: beam search guided by the optimal policy's value.

A plan without branches is a sequence of observations, each step skipped when its target is lost or its window
closed. From a distribution over (state, time, energy) the search follows the mass forward; what has been
earned plus the optimal policy's value of the rest bounds every continuation and orders the beam.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from planner.contingency.policy import Policy
from planner.contingency.seeding import round_about
from planner.evaluate.model import Model
from planner.evaluate.propagate import State, after_done, can_drive, can_observe, drive_outcomes
from planner.plan_tree import Navigate, Observe, OnFail, Plan, TrackStop
from planner.plan_tree import Step as PlanStep
from planner.tally import Step, spend

Masses = dict[State, Any]

SMALL = 2e-3
"""Share of the mass below which a state is credited with the optimal value and followed no further."""


PROMISED = 3
"""Rows of a plan (`Step.ROW`) that what a state promises takes beside its grids. By hand."""


@dataclass(frozen=True, eq=False)
class Sequence:
    """Observations in order, the expected utility from the given masses, and the bound when it was left."""

    order: tuple[int, ...]
    value: float


@dataclass(eq=False)
class _Node:
    order: tuple[int, ...]
    masses: Masses
    earned: float
    bound: float


def total(masses: Masses) -> float:
    """Return the probability in a distribution."""
    return float(sum(mass.sum() for mass in masses.values()))


def optimal_value(policy: Policy, masses: Masses) -> float:
    """Return what the optimal policy earns from a distribution."""
    return float(sum(np.vdot(mass, policy.value(state)) for state, mass in masses.items()))


def _add(masses: Masses, state: State, mass: Any) -> None:
    masses[state] = masses[state] + mass if state in masses else mass


def advance(policy: Policy, masses: Masses, m: int) -> tuple[Masses, float]:
    """Return the distribution after driving to observation m and making it, and what that earned (less
    penalties).

    States in which it cannot be made stay where the attempt leaves them, as with `on_fail: skip`.
    """
    grid, model = policy.grid, policy.model
    spend(Step.ROW, 4 * len(masses))
    target = int(model.obs_place[m])
    after: Masses = {}
    ready: Masses = {}
    earned = 0.0
    for state, mass in masses.items():
        if state.place == target:
            _add(ready, state, mass)
        elif (
            (state.done >> m) & 1
            or (model.is_place[m] and not (state.tracked >> target) & 1)
            or not model.hops(state.place, target)
        ):
            _add(after, state, mass)
        else:
            going: Masses = {state: mass}
            for hop in model.hops(state.place, target):
                coming: Masses = {}
                for on_way, part in going.items():
                    if not can_drive(model, on_way, hop):
                        _add(after, on_way, part)
                        continue
                    arrived = grid.after_leg(on_way.place, hop, on_way.tracked.bit_count(), part)
                    earned -= model.penalty * float(part.sum() - arrived.sum())
                    outcomes = drive_outcomes(model, on_way, hop)
                    grid.count_ways(len(outcomes))
                    for p, then in outcomes:
                        _add(coming if then.place == hop else after, then, p * arrived)
                going = coming
            for there, part in going.items():
                _add(ready, there, part)
    for state, mass in ready.items():
        if not can_observe(model, state, m):
            _add(after, state, mass)
            continue
        closes = float(model.window[m, 1])
        if closes < model.t_max_s:
            share = grid.open_until(closes)
            _add(after, state, (1.0 - share) * mass)
            mass = share * mass
        made = grid.after_observation(m, mass)
        alive = float(made.sum())
        earned += model.expected_utility_of(m, state.done) * alive
        earned -= model.penalty * (float(mass.sum()) - alive)
        _add(after, after_done(model, state, m), made)
    return after, earned


def _promises(policy: Policy, masses: Masses) -> Any:
    """Return, per observation, a bound on the value of going for it next; -inf where it can do nothing."""
    model = policy.model
    spend(Step.ROW, PROMISED * len(masses))
    spend(Step.PASS, len(masses) * (model.m + 1) * policy.grid.nt * policy.grid.ng / 2)
    bounds = np.zeros(model.m)
    possible = np.zeros(model.m, np.bool_)
    for state, mass in masses.items():
        s = policy.index_of(state)
        if s is None:
            continue
        names, values = policy.actions(state.place, s)
        flat = mass.ravel()
        other = float(np.dot(flat, policy.table[state.place, s].ravel()))
        part = np.full(model.m, other)
        if names:
            chosen = list(names)
            part[chosen] = values @ flat
            possible[chosen] = True
        bounds += part
    bounds[~possible] = -np.inf
    return bounds


def _fits(model: Model, before: int, order: tuple[int, ...], m: int) -> bool:
    """Return whether one more observation leaves the downlink volume unexceeded."""
    if not model.limits:
        return True
    return model.admits(before | sum(1 << k for k in order) | (1 << m))


def best_sequences(
    policy: Policy,
    masses: Masses,
    *,
    width: int,
    keep: int = 1,
    before: int = 0,
    tried: int = 0,
) -> list[Sequence]:
    """Return the best unbranched plans found from a distribution, best first; the empty one is always among
    them.

    `before` are observations (bits) that may have been made already: together with them no plan exceeds the
    downlink volume, whatever fails. Those in `tried` (bits) are not gone for: in the cell of a grid where a
    window ends, each further attempt would find it open in a share of the days again.
    """
    model = policy.model
    root = _Node((), masses, 0.0, optimal_value(policy, masses))
    found: dict[tuple[int, ...], float] = {(): 0.0}
    floor = 0.0
    weight = total(masses)
    layer = [root]
    seen: set[tuple[int, ...]] = set()
    while layer:
        offers: list[tuple[float, int, int]] = []
        for k, node in enumerate(layer):
            bounds = node.earned + _promises(policy, node.masses)
            offers += (
                (float(bounds[m]), k, m)
                for m in range(model.m)
                if bounds[m] > floor
                and m not in node.order
                and not (tried >> m) & 1
                and _fits(model, before, node.order, m)
            )
        offers.sort(key=lambda offer: (-offer[0], offer[1], offer[2]))
        following: list[_Node] = []
        for bound, k, m in offers:
            if len(following) >= width:
                break
            node = layer[k]
            order = (*node.order, m)
            if order in seen:
                continue
            seen.add(order)
            after, gained = advance(policy, node.masses, m)
            earned = node.earned + gained
            credit = 0.0
            kept: Masses = {}
            for state, mass in after.items():
                if float(mass.sum()) < SMALL * weight:
                    credit += float(np.vdot(mass, policy.value(state)))
                else:
                    kept[state] = mass
            child = _Node(order, kept, earned + credit, bound)
            spend(Step.ROW, 2 * len(after))
            following.append(child)
            found[order] = earned
            floor = max(floor, earned)
        layer = following
    ranked = sorted(found.items(), key=lambda item: (-item[1], len(item[0]), item[0]))
    return [Sequence(order, value) for order, value in ranked[:keep]]


def likely_path(policy: Policy, masses: Masses) -> tuple[int, ...]:
    """Return the observations that the optimal policy goes for most, in order, as long as going on has
    value.
    """
    order: tuple[int, ...] = ()
    while True:
        bounds = _promises(policy, masses)
        offers = [
            (float(bounds[m]), -m)
            for m in range(policy.model.m)
            if m not in order and _fits(policy.model, 0, order, m)
        ]
        if not offers or max(offers)[0] <= 1e-3 * max(1.0, total(masses)):
            return order
        m = -max(offers)[1]
        masses, _ = advance(policy, masses, m)
        masses = {s: mass for s, mass in masses.items() if float(mass.sum()) > SMALL}
        order = (*order, m)


def sequence_steps(policy: Policy, order: tuple[int, ...], masses: Masses) -> Plan:
    """Return the steps of a sequence begun from a distribution; tracks that it does not use are stopped
    first.
    """
    model = policy.model
    used = {int(model.obs_place[m]) for m in order if model.is_place[m]}
    tracked = 0
    for state in masses:
        tracked |= state.tracked
    steps: list[PlanStep] = [
        TrackStop(model.target_ids[p - 1])
        for p in range(1, model.n + 1)
        if (tracked >> p) & 1 and p not in used and order
    ]
    places = {state.place for state in masses}
    nominal = max(masses, key=lambda state: (float(np.sum(masses[state])), state)).place
    for k, m in enumerate(order):
        target = int(model.obs_place[m])
        tid = model.target_ids[target - 1]
        if places != {target}:
            here = []
            for x in order[k:]:
                if int(model.obs_place[x]) != target:
                    break
                here.append(x)
            steps += round_about(model, nominal, target)
            steps.append(Navigate(tid, all(bool(model.is_place[x]) for x in here), OnFail.SKIP))
            places = {target} if not all(bool(model.is_place[x]) for x in here) else places | {target}
        steps.append(Observe(model.observation_ids[m], tid, OnFail.SKIP))
        nominal = target
    return tuple(steps)
