"""The deterministic orienteering problem as frozen values, and what an engine answers.

Costs, prizes and budgets are integers: seconds, joules, prize units, or whatever finer unit a reader
scales to. So a proof is a proof and no tolerance is needed anywhere.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from graphlib import CycleError, TopologicalSorter

import numpy as np
import numpy.typing as npt

from planner.errors import RoutingError

IntArray = npt.NDArray[np.int64]

_LARGEST = 2**50


@dataclass(frozen=True, slots=True)
class Experiment:
    """Something worth `prize` that can be done once at `site`.

    Parameters
    ----------
    id
        Name used in routes that people see.
    site
        Index into the travel matrices.
    prize, duration, energy
        Non-negative integers.
    earliest_start
        Beginning before is impossible; arriving early means waiting, which costs time only.
    latest_end
        It must be over by then; `None` leaves the time budget as the only limit.
    must_do
        A route without it is not an answer.
    """

    id: int | str
    site: int
    prize: int
    duration: int = 0
    energy: int = 0
    earliest_start: int = 0
    latest_end: int | None = None
    must_do: bool = False


@dataclass(frozen=True, slots=True)
class SideLimit:
    """At most `capacity` of something over the whole route: a choice group, a kind, a downlink volume.

    `amounts[i]` is what experiment i takes of it.
    """

    name: str
    amounts: tuple[int, ...]
    capacity: int


@dataclass(frozen=True, eq=False)
class RoutingProblem:
    """Sites, roads, experiments and budgets.

    Parameters
    ----------
    travel_time, travel_energy
        Shape (sites, sites), not necessarily symmetric; a negative time means there is no road.
    experiments
        What can be done; several may share a site.
    time_budget, energy_budget
        Time at which all must be over; energy that may be used in all. `None` for energy means no limit.
    start_site, start_time, energy_used
        Where and when the route starts and what has been used by then.
    end_site
        Where the route must end within both budgets; `None` lets it end anywhere.
    precedence
        Pairs (a, b) of experiment indices: b only after a.
    done
        Experiments already done: they cannot be done again and satisfy precedence.
    limits
        Side limits; what `done` has taken of them counts.
    base_prize
        Earned in any case; part of every value and bound.
    """

    travel_time: IntArray
    travel_energy: IntArray
    experiments: tuple[Experiment, ...]
    time_budget: int
    energy_budget: int | None = None
    start_site: int = 0
    start_time: int = 0
    energy_used: int = 0
    end_site: int | None = None
    precedence: tuple[tuple[int, int], ...] = ()
    done: frozenset[int] = frozenset()
    limits: tuple[SideLimit, ...] = ()
    base_prize: int = 0
    name: str = ""

    def __post_init__(self) -> None:
        _check(self)

    @property
    def sites(self) -> int:
        """Number of sites."""
        return int(self.travel_time.shape[0])

    @cached_property
    def arrays(self) -> ProblemArrays:
        """The experiments as columns, for kernels."""
        return ProblemArrays.of(self)


@dataclass(frozen=True, slots=True, eq=False)
class ProblemArrays:
    """Columns over experiments, all int64; `latest_end` is capped by the time budget."""

    site: IntArray
    prize: IntArray
    duration: IntArray
    energy: IntArray
    earliest_start: IntArray
    latest_end: IntArray

    @staticmethod
    def of(problem: RoutingProblem) -> ProblemArrays:
        """Return the columns of a problem."""
        x = problem.experiments

        def column(values: list[int]) -> IntArray:
            return np.array(values, dtype=np.int64)

        return ProblemArrays(
            column([e.site for e in x]),
            column([e.prize for e in x]),
            column([e.duration for e in x]),
            column([e.energy for e in x]),
            column([e.earliest_start for e in x]),
            column(
                [
                    problem.time_budget if e.latest_end is None else min(e.latest_end, problem.time_budget)
                    for e in x
                ]
            ),
        )


@dataclass(frozen=True, slots=True)
class RoutingSolution:
    """What an engine answers.

    Parameters
    ----------
    value
        Prize of the route, base prize included; `None` when no feasible route is known.
    upper
        No route is worth more; `None` when the engine has no bound.
    proven
        Whether the value is the optimum (or, with `value` None, whether it is certain that no route exists).
    route
        Experiment indices in the order in which they are done.
    engine, seed, wall_s, iterations
        What made it, and the effort.
    """

    value: int | None
    upper: int | None
    proven: bool
    route: tuple[int, ...]
    engine: str
    seed: int = 0
    wall_s: float = 0.0
    iterations: int = 0
    notes: tuple[str, ...] = field(default=())


def _check(p: RoutingProblem) -> None:
    """Raise RoutingError unless the problem makes sense."""
    _check_roads(p)
    n = p.travel_time.shape[0]
    for what, site in (("start_site", p.start_site), ("end_site", p.end_site)):
        if site is not None and not 0 <= site < n:
            raise RoutingError(f"{what} is {site}; sites run from 0 to {n - 1}")
    for what in ("time_budget", "start_time", "energy_used", "energy_budget", "base_prize"):
        value = getattr(p, what) or 0
        if not 0 <= value <= _LARGEST:
            raise RoutingError(f"{what} is {value}; it must lie between 0 and {_LARGEST}")
    _check_experiments(p, n)
    m = len(p.experiments)
    for index in p.done:
        if not 0 <= index < m:
            raise RoutingError(f"done holds {index}; experiments run from 0 to {m - 1}")
    for limit in p.limits:
        if len(limit.amounts) != m or min(limit.amounts, default=0) < 0:
            raise RoutingError(f"limit {limit.name} needs {m} amounts >= 0, one an experiment")
        if limit.capacity < 0:
            raise RoutingError(f"limit {limit.name} has capacity {limit.capacity}; it must be >= 0")
    _check_precedence(p)


def _check_roads(p: RoutingProblem) -> None:
    for name in ("travel_time", "travel_energy"):
        matrix = np.asarray(getattr(p, name))
        if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or not matrix.size:
            raise RoutingError(f"{name} has shape {matrix.shape}; a square matrix is needed")
        if not np.issubdtype(matrix.dtype, np.integer):
            raise RoutingError(f"{name} holds {matrix.dtype}; integers are needed")
        if np.abs(matrix).max() > _LARGEST:
            raise RoutingError(f"{name} holds {np.abs(matrix).max()}; the limit is {_LARGEST}")
    if p.travel_time.shape != p.travel_energy.shape:
        raise RoutingError(
            f"travel_time has shape {p.travel_time.shape}, travel_energy {p.travel_energy.shape}; "
            "they must agree"
        )
    if (p.travel_energy[p.travel_time >= 0] < 0).any():
        raise RoutingError("travel_energy holds a negative energy on a road")


def _check_experiments(p: RoutingProblem, sites: int) -> None:
    ids = set()
    for e in p.experiments:
        if e.id in ids:
            raise RoutingError(f"experiment {e.id} is given twice")
        ids.add(e.id)
        if not 0 <= e.site < sites:
            raise RoutingError(f"experiment {e.id} is at site {e.site}; sites run from 0 to {sites - 1}")
        for what in ("prize", "duration", "energy", "earliest_start"):
            if not 0 <= getattr(e, what) <= _LARGEST:
                raise RoutingError(f"experiment {e.id}: {what} is {getattr(e, what)}; it must be >= 0")
    if sum(e.prize for e in p.experiments) + p.base_prize > 2**40:
        raise RoutingError("the prizes add up to more than 2^40")


def _check_precedence(p: RoutingProblem) -> None:
    m = len(p.experiments)
    before: dict[int, list[int]] = {}
    for a, b in p.precedence:
        if not (0 <= a < m and 0 <= b < m) or a == b:
            raise RoutingError(f"precedence ({a}, {b}) does not name two of the {m} experiments")
        before.setdefault(b, []).append(a)
    try:
        TopologicalSorter(before).prepare()
    except CycleError as err:
        circle = " -> ".join(str(p.experiments[k].id) for k in err.args[1])
        raise RoutingError(f"precedence runs in a circle through experiment {circle}") from err
