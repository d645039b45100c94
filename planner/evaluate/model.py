"""A problem as arrays: what the evaluators and the policy search compute with."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planner.amounts_of_sol import mixed, on_kind
from planner.constraints.registry import columns_of
from planner.constraints.rule import MAX_BITS, Chances, Rule
from planner.errors import PlannerError
from planner.plan_tree import Plan, ways
from planner.problem import START, Amount, ObservationId, Problem, TargetId
from planner.sol_kind import all_kinds

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Truths = NDArray[np.bool_]

SURELY = 8.0
"""Standard deviations above the mean within which the sum of what a plan uses stays. By hand: sums of ten
log-normals or more, with deviations up to 0.6 of their means, hardly ever pass it."""


LEAST = 1e-9
"""Seconds or joules below which a budget is none: the cells of its table would leave the range of floats."""


def log_normal(amount: Amount) -> tuple[float, float]:
    """Return (mu, sigma) of the log-normal with this mean and standard deviation; mean 0 gives (-inf, 0)."""
    if amount.mean <= 0.0:
        return -math.inf, 0.0
    variance = math.log1p((amount.sd / amount.mean) ** 2)
    return math.log(amount.mean) - variance / 2.0, math.sqrt(variance)


def _longest_s(problem: Problem) -> float:
    """Return the time budget, or the time after which the hotel load alone has used all energy.

    The day ends at the earlier of the two; an axis of time that went on would be too coarse before it.
    """
    budget = problem.budget
    hotel_w = problem.hotel_w * min((k.energy_factor for k in all_kinds(problem.sol_kinds)), default=1.0)
    if hotel_w <= 0.0:
        return _some(budget.time_s)
    return _some(min(budget.time_s, budget.usable_energy_j / hotel_w))


def _some(budget: float) -> float:
    """Return a budget in s or J, or 0 where no step would fit in it."""
    return budget if budget >= LEAST else 0.0


class Sols(NamedTuple):
    """Kinds of sols of which one is drawn and hidden, (K,): chances, factors on times and energies of drives,
    and on all energies (also those of drives). K is 0 where all sols are as the amounts say.
    """

    chance: Floats
    drive_time: Floats
    drive_energy: Floats
    energy: Floats

    @staticmethod
    def of(problem: Problem) -> Sols:
        """Return a problem's, the ordinary sol last."""
        rows = [
            (k.p, k.drive_time_factor, k.drive_energy_factor, k.energy_factor)
            for k in (all_kinds(problem.sol_kinds) if problem.sol_kinds else ())
        ]
        return Sols(*np.array(rows, float).reshape(len(rows), 4).T.copy())


@dataclass(frozen=True, eq=False)
class Model:
    """Array view of a problem with n targets and m observations.

    Places are 0 (start) and 1..n (observation points, in the order of the targets). Observations are 0..m-1.
    `leg` and `obs` hold (mean T, sd T, mean G, sd G); `leg_ln` and `obs_ln` the log-normal parameters
    (mu T, sigma T, mu G, sigma G). `loss[a, b, i]` is the chance to lose target i (1..n) on the leg a -> b,
    `fail[a, b]` that this drive fails. Where the kind of sol is hidden, all amounts are those of an ordinary
    sol, and `sols` holds the kinds.
    """

    problem: Problem
    n: int
    m: int
    t_max_s: float
    e_max_j: float
    hotel_w: float
    penalty: float
    track_t_s: float
    track_e_j: float
    track_leg_s: float
    leg: Floats  # (n + 1, n + 1, 4)
    leg_ln: Floats
    has_leg: Truths  # (n + 1, n + 1)
    loss: Floats  # (n + 1, n + 1, n + 1)
    fail: Floats  # (n + 1, n + 1)
    obs: Floats  # (m, 4)
    obs_ln: Floats
    obs_place: Ints  # (m,)
    utility: Floats  # (m,)
    p_success: Floats  # (m,)
    is_place: Truths  # (m,) needs its target tracked: instrument placed, or a tracked image
    window: Floats  # (m, 2)
    predecessors: Ints  # (m,) bits of observations that must be done before
    trackable: Truths  # (n + 1,)
    place_bits: Ints  # (n + 1,) bits of the placed observations of a target
    target_bits: Ints  # (n + 1,) bits of all observations of a target
    diminishing: Floats  # (n + 1,)
    must_do: Truths  # (m,)
    data_mbit: Floats  # (m,)
    data_limit_mbit: float  # inf if there is none
    target_ids: tuple[TargetId, ...]
    observation_ids: tuple[ObservationId, ...]
    rules: tuple[Rule, ...]
    sols: Sols

    @classmethod
    def of(cls, problem: Problem) -> Model:
        """Return the arrays of a problem of at most 60 targets and 60 observations."""
        targets, observations = problem.targets, problem.observations
        n, m = len(targets), len(observations)
        place: dict[str, int] = {START: 0, **{t.id: k + 1 for k, t in enumerate(targets)}}
        leg = np.full((n + 1, n + 1, 4), np.nan)
        leg_ln = np.full((n + 1, n + 1, 4), np.nan)
        loss = np.zeros((n + 1, n + 1, n + 1))
        fail = np.zeros((n + 1, n + 1))
        for row in problem.legs:
            a, b = place[row.origin], place[row.to]
            leg[a, b] = row.time_s.mean, row.time_s.sd, row.energy_j.mean, row.energy_j.sd
            leg_ln[a, b] = (*log_normal(row.time_s), *log_normal(row.energy_j))
            fail[a, b] = row.p_fail
            for target, p in row.p_lose.items():
                loss[a, b, place[target]] = p
        obs = np.zeros((m, 4))
        obs_ln = np.zeros((m, 4))
        obs_place = np.zeros(m, np.int64)
        place_bits = np.zeros(n + 1, np.int64)
        target_bits = np.zeros(n + 1, np.int64)
        rules, columns = columns_of(problem)
        for k, o in enumerate(observations):
            obs[k] = o.time_s.mean, o.time_s.sd, o.energy_j.mean, o.energy_j.sd
            obs_ln[k] = (*log_normal(o.time_s), *log_normal(o.energy_j))
            obs_place[k] = place[o.target]
            if m <= MAX_BITS:
                target_bits[obs_place[k]] |= 1 << k
                if columns.is_place[k]:
                    place_bits[obs_place[k]] |= 1 << k
        return cls(
            problem=problem,
            n=n,
            m=m,
            t_max_s=_longest_s(problem),
            e_max_j=_some(problem.budget.usable_energy_j),
            hotel_w=problem.hotel_w,
            penalty=problem.overrun_penalty,
            track_t_s=problem.track_start_time_s,
            track_e_j=problem.track_start_energy_j,
            track_leg_s=problem.track_overhead_s_per_leg,
            leg=leg,
            leg_ln=leg_ln,
            has_leg=~np.isnan(leg[:, :, 0]),
            loss=loss,
            fail=fail,
            obs=obs,
            obs_ln=obs_ln,
            obs_place=obs_place,
            utility=np.array([o.utility for o in observations], float),
            p_success=np.array([o.p_success for o in observations], float),
            is_place=columns.is_place,
            window=columns.window,
            predecessors=columns.predecessors,
            trackable=np.isin(np.arange(n + 1), obs_place[columns.is_place]),
            place_bits=place_bits,
            target_bits=target_bits,
            diminishing=np.array([1.0, *(t.diminishing for t in targets)], float),
            must_do=columns.must_do,
            data_mbit=columns.data_mbit,
            data_limit_mbit=columns.data_limit_mbit,
            target_ids=tuple(t.id for t in targets),
            observation_ids=tuple(o.id for o in observations),
            rules=rules,
            sols=Sols.of(problem),
        )

    @cached_property
    def by_kind(self) -> tuple[tuple[float, Model], ...]:
        """The kinds of sols: the chance of each, and the model of one that is known to be of it."""
        if not len(self.sols.chance):
            return ((1.0, self),)
        kinds = all_kinds(self.problem.sol_kinds)
        return tuple((kind.p, self._with_amounts_of(on_kind(self.problem, kind))) for kind in kinds)

    def mixed(self) -> Model:
        """Return the model with the mean and deviation of each amount over the kinds of sols; itself where
        there is one kind.
        """
        return self._with_amounts_of(mixed(self.problem)) if len(self.sols.chance) else self

    def with_limits_of(self, problem: Problem) -> Model:
        """Return the model of a problem that differs from this one's by its budgets and windows alone."""
        rules, columns = columns_of(problem)
        return replace(
            self,
            problem=problem,
            t_max_s=_longest_s(problem),
            e_max_j=_some(problem.budget.usable_energy_j),
            window=columns.window,
            data_limit_mbit=columns.data_limit_mbit,
            rules=rules,
        )

    def _with_amounts_of(self, problem: Problem) -> Model:
        other = Model.of(problem)
        return replace(
            other,
            utility=self.utility,
            penalty=self.penalty,
            t_max_s=min(self.t_max_s, other.t_max_s),
            e_max_j=min(self.e_max_j, other.e_max_j),
        )

    def require_one_kind(self, what: str) -> None:
        """Raise if the kind of sol is hidden: `what` holds for the amounts of one kind alone.

        Raises
        ------
        PlannerError
            If there are several kinds of sols.
        """
        if len(self.sols.chance):
            raise PlannerError(f"{what} holds one kind of sol; the model has {len(self.sols.chance)}")

    def within_reach(self) -> Model:
        """Return the model with budgets no larger than a plan of all its observations ever uses.

        The nodes of a grid lie evenly over the budgets, so that a plan found and valued with a hundred times
        what it needs was worth less. Ending over these counts as ending over the budget, on the safe side.
        """
        if len(self.sols.chance):
            reached = [model.within_reach() for _, model in self.by_kind]
            return replace(
                self,
                t_max_s=max(model.t_max_s for model in reached),
                e_max_j=max(model.e_max_j for model in reached),
            )
        loaded = np.count_nonzero(self.trackable)
        into = np.where(self.has_leg[:, :, None], self.leg, 0.0).max(axis=0)
        hops = 1 if self.leads_everywhere else 2
        legs = np.repeat(into[self.obs_place], hops, axis=0)
        every = np.concatenate([legs, self.obs])
        opens = self.window[:, 0]
        latest = max(0.0, float(opens[np.isfinite(opens)].max(initial=0.0)))
        spare = SURELY * np.sqrt(np.square(every[:, 1::2]).sum(axis=0))
        seconds, joules = every[:, ::2].sum(axis=0) + spare
        seconds += latest + loaded * (self.track_t_s + len(legs) * self.track_leg_s)
        joules += self.hotel_w * seconds + loaded * self.track_e_j
        # a day without observations, or without a use of energy, has no end of its own
        return replace(
            self,
            t_max_s=min(self.t_max_s, seconds or math.inf),
            e_max_j=min(self.e_max_j, joules or math.inf),
        )

    @cached_property
    def losses_known(self) -> dict[tuple[int, int, int], list[tuple[float, int]]]:
        """What `propagate.loss_outcomes` said of a leg and of what is tracked on it; filled there."""
        return {}

    @cached_property
    def place_of(self) -> dict[str, int]:
        return {START: 0, **{t: k + 1 for k, t in enumerate(self.target_ids)}}

    @cached_property
    def number_of(self) -> dict[str, int]:
        return {o: k for k, o in enumerate(self.observation_ids)}

    @cached_property
    def _routes(self) -> tuple[Floats, Ints]:
        """Mean time of the quickest drives between places, through others where no leg leads there, and the
        first place on the way (-1 where there is none).
        """
        cost = np.where(self.has_leg, self.leg[:, :, 0], math.inf)
        first = np.where(self.has_leg, np.arange(self.n + 1)[None, :], -1)
        for via in range(1, self.n + 1):
            round_about = cost[:, via, None] + cost[None, via, :]
            better = (round_about < cost) & ~self.has_leg
            cost = np.where(better, round_about, cost)
            first = np.where(better, first[:, via, None], first)
        return cost, first

    def hops(self, origin: int, to: int) -> tuple[int, ...]:
        """Return the places to drive to one after the other to come to a place; empty where nothing leads.

        That is the place itself where there is a leg, else the quickest way through others in the mean.
        """
        _, first = self._routes
        way: list[int] = []
        here = origin
        while here != to:
            here = int(first[here, to])
            if here < 0:
                return ()
            way.append(here)
        return tuple(way)

    @cached_property
    def leads_everywhere(self) -> bool:
        """Whether a leg leads from every place to every target."""
        others = ~np.eye(self.n + 1, dtype=bool)
        others[:, 0] = False
        return bool(np.all(self.has_leg[others]))

    @cached_property
    def gates(self) -> tuple[Rule, ...]:
        """The rules that say in which states an observation may begin."""
        return tuple(rule for rule in self.rules if type(rule).feasible is not Rule.feasible)

    @cached_property
    def limits(self) -> tuple[Rule, ...]:
        """The rules that say which observations one path through a plan may hold."""
        return tuple(rule for rule in self.rules if type(rule).admits is not Rule.admits)

    def admits(self, made: int) -> bool:
        """Return whether one path through a plan may make all these observations (bits)."""
        return all(rule.admits(self, made) for rule in self.limits)

    def admits_plan(self, plan: Plan) -> bool:
        """Return whether every path through a plan is admitted, whatever fails."""
        if not self.limits:
            return True
        return all(self.admits(sum(1 << self.number_of[o] for o in way)) for way in ways(plan))

    @cached_property
    def chances(self) -> Chances:
        """What the rules leave of the chances that observations are made, for bounds over every policy."""
        arrival = best_arrival(self)
        survival = best_survival(self) * arrival  # drives fail and lose tracks independently
        chances = Chances(survival[self.obs_place], arrival[self.obs_place])
        for rule in self.rules:
            rule.relax(self, chances)
        return chances

    def expected_utility_of(self, m: int, done: int) -> float:
        """Return what observation `m` is worth in the mean when carried out after those in `done`."""
        place = int(self.obs_place[m])
        before = (done & int(self.target_bits[place])).bit_count()
        return float(self.utility[m] * self.p_success[m] * self.diminishing[place] ** before)


def best_arrival(model: Model) -> Floats:
    """Return, per place, the largest chance to come there, (n + 1,): no drive follows one that failed."""
    fails = np.where(model.has_leg, model.fail, np.inf).min(axis=0)
    return np.where(np.isfinite(fails), 1.0 - fails, 1.0)


def best_survival(model: Model) -> Floats:
    """Return, per place, the chance of its track to survive the best way to it from the start, (n + 1,)."""
    kept = np.ones(model.n + 1)
    for place in range(1, model.n + 1):
        chance = np.where(model.has_leg, 1.0 - model.loss[:, :, place], 0.0)
        reach = np.zeros(model.n + 1)
        reach[0] = 1.0
        for _ in range(model.n):
            further = np.maximum(reach, (reach[:, None] * chance).max(axis=0))
            if np.array_equal(further, reach):
                break
            reach = further
        kept[place] = reach[place]
    return kept
