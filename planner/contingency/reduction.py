"""Problems too large for a table of the optimal policy: a part of them that matters most."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from planner.amounts_of_sol import mixed
from planner.constraints.registry import columns_of
from planner.constraints.rule import MAX_BITS
from planner.contingency.live_set_count import count_sets
from planner.contingency.policy import LiveSets, Moves, TooLargeError
from planner.contingency.selection import Selection, makeable, nearest_by_worth, places_through
from planner.evaluate.model import Model
from planner.plan_tree import Navigate, Plan, planned_observations, walk
from planner.problem import ObservationId, Problem, TargetId

if TYPE_CHECKING:
    from planner.orienteering import RoutingProblem
    from planner.orienteering.problem import IntArray

MAX_LIVE_SETS = 13_000
"""Live sets up to which a table for the search is made. By hand: ten places take 740 MB in single precision
on 49 x 29 nodes."""

MAX_RETURNING_SETS = 3_000
"""Live sets up to which a search may come back to places: their drives are three times as many. By hand."""

MAX_TRACKED = 11
"""Targets tracked at once up to which a table is made: each doubles the sets to begin with. By hand."""

KEPT_TARGETS = 9
"""Targets of a problem that was reduced to fit its table. By hand, as the next."""

KEPT_OBSERVATIONS = 10
"""Observations of it."""

TRACKED_IN_MEAN = 2
"""Targets tracked during a drive, for mean times; the engines leave tracking out."""

ROUTE_LIMIT_S = 10.0
"""Far more than so many labels take: the labels are the limit, so a route does not depend on the machine."""

ROUTE_ITERATIONS = 20_000
"""Labels for one route on mean values. By hand."""


@dataclass(frozen=True, eq=False)
class Reduction:
    """The problem to be planned for: the original, or a part of its targets. `notes` say what was
    left out.
    """

    original: Problem
    problem: Problem
    live_sets: int
    notes: tuple[str, ...] = ()
    hurried: bool = False
    """Whether a table would hold the whole problem, had the limit time for it."""

    @property
    def exact(self) -> bool:
        return self.problem is self.original

    def whole(self) -> Model:
        return Model.of(self.original)


def part_of(problem: Problem, kept: set[TargetId]) -> Problem:
    """Return the problem with these targets only."""
    targets = tuple(t for t in problem.targets if t.id in kept)
    names = {o.id for t in targets for o in t.observations}
    legs = tuple(
        replace(leg, p_lose={k: p for k, p in leg.p_lose.items() if k in kept})
        for leg in problem.legs
        if leg.to in kept and (leg.origin == "start" or leg.origin in kept)
    )
    return replace(
        problem,
        targets=targets,
        legs=legs,
        precedence=tuple(pair for pair in problem.precedence if pair[0] in names and pair[1] in names),
    )


def live_sets_of(problem: Problem) -> int | None:
    """Return how many live sets a table of the problem needs; None if more than a table may hold."""
    if len(problem.observations) > 20 or len(problem.targets) > 20:
        return None
    model = Model.of(problem)
    tracked = [p for p in range(1, model.n + 1) if model.trackable[p]]
    if len(tracked) > MAX_TRACKED:
        return None
    count = _live_sets(model, once=False)
    if several(model) and (count is None or count > MAX_RETURNING_SETS):
        count = _live_sets(model, once=True)
    return count if count is not None and count <= MAX_LIVE_SETS else None


def _live_sets(model: Model, *, once: bool) -> int | None:
    sets = LiveSets(model, (1 << model.m) - 1)
    start = sets.initial(sum(1 << p for p in range(1, model.n + 1) if model.trackable[p]))
    try:
        return count_sets(sets, start, once=once)
    except TooLargeError:
        return None


def moves_of(model: Model, *, quick: bool = False) -> Moves:
    """Return which policies a table for the search is made of: all, where coming back or going round pays.

    For a `quick` search only where the rover has to go round.
    """
    if model.leads_everywhere and (quick or not several(model)):
        return Moves.ONE_STAY if several(model) else Moves.TO_WORK
    count = _live_sets(model, once=False)
    if count is not None and count <= MAX_RETURNING_SETS:
        return Moves.ALL
    return Moves.ONE_STAY if several(model) else Moves.TO_WORK


def several(model: Model) -> bool:
    """Return whether some target has several observations."""
    return any(int(bits).bit_count() > 1 for bits in model.target_bits)


def reduce_problem(
    problem: Problem,
    *,
    most_live_sets: float = math.inf,
    should_stop: Callable[[], bool] = lambda: False,
) -> Reduction:
    """Return the problem itself if a table of so many live sets can hold it, else its best targets.

    The targets kept are those of good routes on mean values, found by the orienteering engines for several
    budgets, with what must be done before all others. None is kept without what must be made before it. Those
    nearest by worth fill the rest where a table would hold all but for the limit, or no route makes any.
    """
    useful = _makeable_part(problem)
    whole = (len(useful.targets), len(useful.observations)) == (
        len(problem.targets),
        len(problem.observations),
    )
    count = live_sets_of(useful)
    if count is not None and (count <= most_live_sets or len(useful.observations) <= KEPT_OBSERVATIONS):
        return Reduction(problem, problem if whole else useful, count)
    selection = Selection(useful, most=KEPT_OBSERVATIONS, most_targets=KEPT_TARGETS)
    selection.demand(o.id for o in useful.observations if o.must_do)
    for share in (1.0, 0.75, 1.3):
        # The first route is always made: without one there is nothing to plan with.
        if (share != 1.0 and should_stop()) or selection.full:
            break
        selection.offer(mean_route_of(useful, share))
    if count is not None or not selection.names:
        # What no route on mean values makes may still be worth trying: drives can be quicker.
        selection.offer(nearest_by_worth(useful))
    part = only(useful, selection.names)
    left = len(problem.observations) - len(part.observations)
    return Reduction(
        problem,
        part,
        live_sets_of(part) or 0,
        (
            f"planned with {len(part.observations)} of {len(problem.observations)} observations: {left} "
            "that no good route on mean values makes were left out"
            + ("; a table of all takes longer than the limit allows" if count is not None else ""),
        ),
        hurried=count is not None,
    )


def _makeable_part(problem: Problem) -> Problem:
    """Return the problem with the targets that some way leads to, and what can be made there at all."""
    reachable = reachable_targets(problem)
    at_all = makeable(problem, {o.id for o in problem.observations if o.target in reachable})
    targets = tuple(
        replace(t, observations=tuple(o for o in t.observations if o.id in at_all)) for t in problem.targets
    )
    return part_of(replace(problem, targets=targets), {t.id for t in targets if t.id in reachable})


def only(problem: Problem, names: set[ObservationId]) -> Problem:
    """Return the problem with these observations only, and the places that the rover drives through."""
    targets = tuple(
        replace(t, observations=tuple(o for o in t.observations if o.id in names)) for t in problem.targets
    )
    kept = {t.id for t in targets if t.observations}
    return part_of(replace(problem, targets=targets), kept | places_through(problem, kept))


def held_by(problem: Problem, plan: Plan) -> Problem:
    """Return a part of a problem that a model holds, with all that a plan drives to and observes."""
    if len(problem.observations) <= MAX_BITS and len(problem.targets) <= MAX_BITS:
        return problem
    places = {step.to for _, step in walk(plan) if isinstance(step, Navigate)}
    names = planned_observations(plan)
    targets = tuple(
        replace(t, observations=tuple(o for o in t.observations if o.id in names)) for t in problem.targets
    )
    kept = {t.id for t in targets if t.observations} | places
    return part_of(replace(problem, targets=targets), kept)


def mean_route_of(problem: Problem, share: float, *, seed: int = 1) -> tuple[ObservationId, ...]:
    """Return a good route on mean values with a share of the budgets, in order of visiting."""
    from planner.orienteering import solve

    routing = mean_routing(problem, share)
    solution = solve(routing, time_limit_s=ROUTE_LIMIT_S, iterations=ROUTE_ITERATIONS, seed=seed)
    return tuple(problem.observations[k].id for k in solution.route)


def mean_routing(problem: Problem, share: float = 1.0) -> RoutingProblem:
    """Return the routing problem on mean values with a share of the budgets.

    Site 0 is the start, site k the k-th target; experiments are the observations in their order, with prizes
    in thousandths, seconds and joules. Where the kind of sol is hidden, means are over the kinds.
    """
    from planner.orienteering import Experiment, RoutingProblem, SideLimit

    problem = mixed(problem)
    places: dict[str, int] = {"start": 0, **{t.id: k + 1 for k, t in enumerate(problem.targets)}}
    count = len(places)
    hotel = problem.hotel_w
    carried = TRACKED_IN_MEAN * problem.track_overhead_s_per_leg
    time_s = np.full((count, count), -1, np.int64)
    energy = np.zeros((count, count), np.int64)
    np.fill_diagonal(time_s, 0)
    kept: dict[str, float] = {}
    for leg in problem.legs:
        a, b = places[leg.origin], places[leg.to]
        seconds = leg.time_s.mean + carried
        time_s[a, b] = math.ceil(seconds)
        energy[a, b] = math.ceil(leg.energy_j.mean + hotel * seconds)
        if leg.origin == "start":
            kept[leg.to] = 1.0 - leg.p_lose.get(leg.to, 0.0)
    _go_round(time_s, energy)
    experiments = []
    observations = problem.observations
    rules, columns = columns_of(problem)
    for m, o in enumerate(observations):
        sure = kept.get(o.target, 0.8) if columns.is_place[m] else 1.0
        opens, closes = map(float, columns.window[m])
        duration = math.ceil(o.time_s.mean)
        experiments.append(
            Experiment(
                o.id,
                places[o.target],
                round(1000.0 * o.utility * o.p_success * max(sure, 0.05)),
                duration,
                math.ceil(o.energy_j.mean + hotel * o.time_s.mean),
                0 if opens <= 0.0 else math.ceil(opens),
                None if closes == math.inf else math.floor(max(-1.0, closes)) + duration,
            )
        )
    found = (rule.side_limit() for rule in rules)
    limits = tuple(SideLimit(*limit) for limit in found if limit is not None)
    number = {o.id: k for k, o in enumerate(observations)}
    pairs = dict.fromkeys((number[a], number[b]) for a, b in problem.precedence)
    pairs |= dict.fromkeys(
        (first, second)
        for second, before in enumerate(columns.predecessors.tolist())
        for first in range(before.bit_length())
        if (before >> first) & 1
    )
    return RoutingProblem(
        time_s,
        energy,
        tuple(experiments),
        time_budget=math.floor(share * problem.budget.time_s),
        energy_budget=math.floor(share * problem.budget.usable_energy_j),
        precedence=tuple(pairs),
        limits=limits,
    )


def _go_round(time_s: IntArray, energy: IntArray) -> None:
    """Fill in drives through other places where no leg leads (time -1)."""
    missing = time_s < 0
    for via in range(1, len(time_s)):
        known = (time_s[:, via, None] >= 0) & (time_s[None, via, :] >= 0)
        total = time_s[:, via, None] + time_s[None, via, :]
        better = missing & known & ((time_s < 0) | (total < time_s))
        energy[better] = (energy[:, via, None] + energy[None, via, :])[better]
        time_s[better] = total[better]


def reachable_targets(problem: Problem) -> set[TargetId]:
    """Return the targets that some way leads to from the start."""
    ways: dict[str, list[TargetId]] = {}
    for leg in problem.legs:
        ways.setdefault(leg.origin, []).append(leg.to)
    found: set[TargetId] = set()
    queue: list[str] = ["start"]
    while queue:
        for to in ways.get(queue.pop(), ()):
            if to not in found:
                found.add(to)
                queue.append(to)
    return found
