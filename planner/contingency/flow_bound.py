"""An upper bound for every policy on problems that no table holds: expected drives as a flow.

Variables are expectations under a policy: `x[a, b]`, drives a -> b that end within the budgets; `y[m]`, the
chance that observation m ends within them; `s[i]`, that target i is tracked from the start. Every policy
satisfies, whatever it sees on the way:

1. *Budgets.* Let an action X be begun with R left of a resource. Within the day it uses min(X, R), and these
   uses add up to the budget at most. It succeeds with chance P(X <= R) at most, so a success costs at least
   c = inf over R of E[min(X, R)] / P(X <= R) in the mean: sum of c * successes <= budget. For log-normal
   amounts c is the mean, but for a far tail of which `_least_cost` takes account.
2. *Flow.* Drives from a place are not more than drives to it; one at most from the start.
3. *Entries.* For a set S of targets: what is observed in S was driven to from outside, so `y[m]` is not more
   than the drives into S, for each m in S (generalised subtour inequalities, Fischetti, Salazar and Toth
   1998). They are added as they are found violated, by maximum flow.
4. *Tracks.* An observation that needs its track asks for `s`, which costs time and energy at the start and on
   one drive at least. Its chance is not more than that of a track to survive the best way from the start.
5. *Downlink.* The volume of what is observed is within the limit on every way, so also in the mean.

Overruns cost nothing here, windows that are not yet over and precedence are left out: all loosen the bound.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import ndtr, ndtri

from planner.contingency.linear_program import solved
from planner.evaluate.model import Floats, Ints, Model
from planner.tally import Step, spend, tallied

FINE, COARSE, MANY = (64, 129), (8, 33), 2500
"""Cells and nodes for the cost of an energy, the coarse ones with more than `MANY` legs and observations."""

TAIL = 1e-9
"""Chance beyond which the distribution of an energy is not looked at in detail."""

SCALE = 1_000_000
"""Flow units in which cuts are sought: capacities are whole numbers there."""

VIOLATED = 1e-3
"""Least chance by which an inequality must be broken to be added. By hand."""

BINDING = 1e-6
"""Slack up to which an inequality counts as binding, above the solver's tolerance. By hand."""

ROUNDS = 40
"""Rounds of cuts; the bound of any round holds. By hand."""

LP_TOLERANCE = 1e-6
"""Relative allowance for the solver's own tolerance of 1e-7 (HiGHS)."""


def least_time(mean: float, mu: float, sigma: float) -> float:
    """Return inf over R of E[min(X, R)] / P(X <= R) for a log-normal X, rounded down; in the unit of X.

    `mean` is that of X, `mu` and `sigma` are mean and standard deviation of ln X.
    """
    if mean <= 0.0 or sigma <= 0.0:
        return max(mean, 0.0)
    z = np.linspace(-8.0, 8.0, 8001)
    chance = ndtr(z)
    used = mean * ndtr(z - sigma) + np.exp(mu + sigma * z) * ndtr(-z)
    # Between two nodes the use is at least that at the lower one, the chance at most that at the upper one.
    return float(min((used[:-1] / chance[1:]).min(), used[-1]))


def least_energy(leg: Floats, ln: Floats, hotel_w: float, cells: int, nodes: int) -> float:
    """Return inf over R of E[min(E, R)] / P(E <= R), J, for E = G + hotel_w X, rounded down.

    `leg` [4] holds mean and standard deviation of the duration X, s, and of the energy G, J: (mean X, sd X,
    mean G, sd G); `ln` [4] mean and standard deviation of their logarithms, in the same order. The duration
    is cut into `cells` of equal chance: its upper edges give a use that is too small, its lower ones a chance
    that is too large; R is looked at in so many `nodes`, and rounded down between them.
    """
    mean_x, mean_g = float(leg[0]) * hotel_w, float(leg[2])
    if mean_x <= 0.0 or ln[1] <= 0.0:
        return mean_x + least_time(mean_g, ln[2], ln[3])
    if mean_g <= 0.0 or ln[3] <= 0.0:
        return mean_g + least_time(mean_x, math.log(hotel_w) + ln[0], ln[1])
    mu, sigma = math.log(hotel_w) + float(ln[0]), float(ln[1])
    edges = np.exp(mu + sigma * ndtri(np.linspace(0.0, 1.0, cells + 1)))
    low, high = edges[:-1], edges[1:]
    spread = math.hypot(float(leg[1]) * hotel_w, float(leg[3])) / (mean_x + mean_g)
    width = math.sqrt(math.log1p(spread**2)) * -float(ndtri(TAIL))
    limit = (mean_x + mean_g) * np.exp(np.linspace(-width, width, nodes))
    z = (np.log(limit) - mu) / sigma
    used = mean_x * ndtr(z - sigma) + limit * ndtr(-z)  # E[min(hotel_w X, R)]
    rest = np.maximum(limit[:, None] - high, 0.0)
    used += _capped_mean(mean_g, float(ln[2]), float(ln[3]), rest).mean(axis=1)
    left = np.maximum(limit[:, None] - low, 0.0)
    with np.errstate(divide="ignore"):
        chance = ndtr((np.log(left) - ln[2]) / ln[3]).mean(axis=1)
    return float(min((used[:-1] / np.maximum(chance[1:], 1e-300)).min(), used[-1]))


def _capped_mean(mean: float, mu: float, sigma: float, cap: Floats) -> Floats:
    """Return E[min(X, cap)] of a log-normal."""
    with np.errstate(divide="ignore"):
        z = (np.log(cap) - mu) / sigma
    return np.asarray(mean * ndtr(z - sigma) + cap * ndtr(-z))


@dataclass(frozen=True, slots=True, eq=False)
class _Row:
    """Sum of `values` times the columns `at`, at most `limit`."""

    at: Ints
    values: Floats
    limit: float


class _Program:
    """The linear program: columns are legs, then wanted observations, then tracked targets."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self.wanted = np.nonzero((model.utility > 0.0) & (model.chances.most > 0.0))[0]
        self.place = model.obs_place[self.wanted]
        legs = model.has_leg.copy()
        legs[:, 0] = False
        np.fill_diagonal(legs, False)
        self.origin, self.to = np.nonzero(legs)
        self.tracked = np.unique(self.place[model.is_place[self.wanted]])
        self.seen = len(self.to) + np.arange(len(self.wanted))
        self.track = self.seen.size + len(self.to) + np.arange(len(self.tracked))
        self.count = len(self.to) + len(self.seen) + len(self.track)
        self.rows: list[_Row] = []
        self._budgets()
        self._flows()
        self._tracks()
        self.kept = len(self.rows)
        self.cost = np.zeros(self.count)
        self.cost[self.seen] = -(model.utility * model.p_success)[self.wanted]
        self.upper = np.full(self.count, np.inf)
        self.upper[self.seen] = model.chances.most[self.wanted]
        self.upper[self.track] = 1.0

    def _budgets(self) -> None:
        model = self.model
        amounts = np.concatenate([model.leg[self.origin, self.to], model.obs[self.wanted]])
        ln = np.concatenate([model.leg_ln[self.origin, self.to], model.obs_ln[self.wanted]])
        cells, nodes = FINE if len(amounts) <= MANY else COARSE
        # Drives of equal length are alike, observations with one instrument too: each kind is cut once.
        kinds, kind = np.unique(np.column_stack([amounts, ln]), axis=0, return_inverse=True)
        kind = kind.reshape(-1)
        seconds = np.array([least_time(*row) for row in kinds[:, [0, 4, 5]].tolist()])[kind]
        joules = np.array([least_energy(k[:4], k[4:], model.hotel_w, cells, nodes) for k in kinds])[kind]
        track_s = model.track_t_s + model.track_leg_s
        track_j = model.track_e_j + model.hotel_w * track_s
        every = np.arange(self.count)
        for used, track, limit in ((seconds, track_s, model.t_max_s), (joules, track_j, model.e_max_j)):
            self.rows.append(_Row(every, np.array([*used, *[track] * len(self.track)]), limit))
        for values, limit in model.chances.rows:
            self.rows.append(_Row(self.seen, values[self.wanted], limit))

    def _flows(self) -> None:
        for place in range(self.model.n + 1):
            out, into = np.nonzero(self.origin == place)[0], np.nonzero(self.to == place)[0]
            signs = np.repeat([1.0, -1.0], [len(out), len(into)])
            self.rows.append(_Row(np.concatenate([out, into]), signs, 1.0 if place == 0 else 0.0))
        for k, place in enumerate(self.place.tolist()):
            self.entries({place}, k)

    def _tracks(self) -> None:
        for k, place in enumerate(self.place.tolist()):
            if self.model.is_place[self.wanted[k]]:
                track = self.track[np.searchsorted(self.tracked, place)]
                self.rows.append(_Row(np.array([self.seen[k], track]), np.array([1.0, -1.0]), 0.0))

    def entries(self, inside: set[int], k: int) -> None:
        """Let the k-th wanted observation be made no more often than its set of targets is entered."""
        within = np.zeros(self.model.n + 1, np.bool_)
        within[list(inside)] = True
        into = np.nonzero(within[self.to] & ~within[self.origin])[0]
        self.rows.append(_Row(np.append(into, self.seen[k]), np.append(np.full(len(into), -1.0), 1.0), 0.0))

    def solve(self, limit_s: float) -> Any:
        """Return the answer of the solver within a limit."""
        from scipy import sparse  # 0.1 s that a first plan does not need

        at = np.repeat(np.arange(len(self.rows)), [len(row.at) for row in self.rows])
        values = np.concatenate([row.values for row in self.rows])
        columns = np.concatenate([row.at for row in self.rows])
        return solved(
            self.cost,
            sparse.csr_matrix((values, (at, columns)), shape=(len(self.rows), self.count)),
            np.array([row.limit for row in self.rows]),
            np.stack([np.zeros(self.count), self.upper], axis=1),
            limit_s,
        )

    def cut(self, x: Floats, slack: Floats) -> int:
        """Replace the entries that do not bind by those that a solution violates; return how many."""
        from scipy import sparse
        from scipy.sparse.csgraph import maximum_flow

        binding = slack[self.kept :] < BINDING
        self.rows[self.kept :] = [row for row, b in zip(self.rows[self.kept :], binding, strict=True) if b]
        n1 = self.model.n + 1
        capacity = np.zeros((n1, n1), np.int32)
        capacity[self.origin, self.to] = np.rint(SCALE * x[: len(self.to)])
        graph = sparse.csr_matrix(capacity)
        seen = x[self.seen]
        added = 0
        for place in np.unique(self.place).tolist():
            most = float(seen[self.place == place].max())
            if most < VIOLATED:
                continue
            flow = maximum_flow(graph, 0, place)
            spend(Step.CALL, n1)
            entering = float(flow.flow_value) / SCALE
            if entering >= most - VIOLATED:
                continue
            residual = capacity - flow.flow.toarray()
            outermost, innermost = set(range(n1)) - reached(residual, 0), reached(residual.T, place)
            for inside in (outermost, innermost) if outermost != innermost else (innermost,):
                for k in np.nonzero(seen > entering + VIOLATED)[0].tolist():
                    if int(self.place[k]) in inside:
                        self.entries(inside, k)
                        added += 1
        return added


def reached(residual: Any, start: int) -> set[int]:
    """Return the nodes that a node reaches over positive residual capacities."""
    found, queue = {start}, [start]
    while queue:
        for to in np.nonzero(residual[queue.pop()] > 0)[0].tolist():
            if to not in found:
                found.add(to)
                queue.append(to)
    return found


def flow_bound(model: Model, *, limit_s: float) -> float:
    """Return what no policy earns more than, in utility; infinite if the solver found no answer in its limit.

    `limit_s` are seconds of a processor as `planner.tally` reckons them: a busy machine does not loosen the
    bound.
    """
    model.require_one_kind("a bound by expected drives")
    program = _Program(model)
    if not len(program.wanted) or not len(program.to):
        return 0.0
    best = math.inf
    with tallied() as tally:
        until = tally.seconds + limit_s
        for _ in range(ROUNDS):
            left = until - tally.seconds
            if left <= 0.0 and best < math.inf:
                break
            answer = program.solve(left)
            if answer.status != 0:
                break
            best = min(best, -float(answer.fun) * (1.0 + LP_TOLERANCE) + 1e-9)
            if not program.cut(answer.x, answer.slack):
                break
    return best
