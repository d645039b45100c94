"""What is said of a plan: why not, what if, which of two."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Relaxation:
    """The smallest change tried that lets a request in: of what, by which factor, and the value then."""

    what: str
    factor: float
    value: float


@dataclass(frozen=True, slots=True)
class WhyNot:
    """Why a request is not in a plan.

    `attempted` says whether a plan was found that attempts it. `change` is the value of the best of those,
    less that of the best without that demand, with its standard error over the same futures; `displaced`
    are the requests of the plan that it would cost.
    """

    request_id: str
    reason: str
    limit: str
    attempted: bool
    change: float
    standard_error: float
    displaced: list[str]
    relaxation: Relaxation | None


@dataclass(frozen=True, slots=True)
class WhatIfAnswer:
    """What changes of the day are worth to a plan, on the same futures for all three values.

    `value_present` is the plan today, `value_kept` the same plan in the changed day (without what was taken
    away), `value_found` the best plan found at once for it: a full planning can only be better. `change` is
    found less present, `replanning` found less kept. `gained` and `lost` are requests against the present
    plan, `reach` the chance of each request to be begun. `per_hour` and `per_100_kj` are what more of a
    budget would win for that plan; `why` says it in sentences.
    """

    plan_id: str
    value_present: float
    value_kept: float
    value_found: float
    change: float
    change_error: float
    replanning: float
    replanning_error: float
    overrun: float
    branches: int
    feasible: bool
    gained: list[str]
    lost: list[str]
    reach: dict[str, float]
    per_hour: float
    per_100_kj: float
    why: list[str]
    changes: str
    time_budget_s: float
    energy_budget_j: float
    elapsed_s: float


@dataclass(frozen=True, slots=True)
class Histogram:
    """Shares of the futures in bins; bin k reaches from `edges[k]` to `edges[k + 1]`, the last inclusive."""

    edges: list[float]
    share: list[float]


@dataclass(frozen=True, slots=True)
class PairHistogram:
    """Two histograms over the same bins."""

    edges: list[float]
    share_a: list[float]
    share_b: list[float]


@dataclass(frozen=True, slots=True)
class PlanComparison:
    """Two plans on the same futures; the worst 5 % are means over the worst twentieth of each.

    `histogram` is of the utility of both, `difference_histogram` of A less B future by future. `begun_a` and
    `begun_b` are the shares of the futures in which each request was begun.
    """

    plan_a: str
    plan_b: str
    value_a: float
    value_b: float
    difference: float
    standard_error: float
    a_beats_b: float
    b_beats_a: float
    worst_a: float
    worst_b: float
    overrun_a: float
    overrun_b: float
    only_in_a: list[str]
    only_in_b: list[str]
    futures: int
    histogram: PairHistogram
    difference_histogram: Histogram
    begun_a: dict[str, float]
    begun_b: dict[str, float]
