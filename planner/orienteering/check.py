"""The independent checker: a route in, its value out. It shares no code with any engine."""

from __future__ import annotations

from collections.abc import Sequence

from planner.errors import RoutingError, SolverError
from planner.orienteering.problem import RoutingProblem, RoutingSolution


def route_value(problem: RoutingProblem, route: Sequence[int]) -> int:
    """Return the prize of a route, base prize included.

    Parameters
    ----------
    route
        Experiment indices in the order in which they are done.

    Raises
    ------
    RoutingError
        If the route breaks a rule of the problem; the message names the experiment and the rule.
    """
    time, energy, site = problem.start_time, problem.energy_used, problem.start_site
    finished = set(problem.done)
    before: dict[int, list[int]] = {}
    for a, b in problem.precedence:
        before.setdefault(b, []).append(a)
    taken = [sum(limit.amounts[i] for i in finished) for limit in problem.limits]
    value = problem.base_prize
    for index in route:
        if not 0 <= index < len(problem.experiments):
            raise RoutingError(f"route holds {index}; there are {len(problem.experiments)} experiments")
        e = problem.experiments[index]
        if index in finished:
            raise RoutingError(f"experiment {e.id} is done twice")
        if any(a not in finished for a in before.get(index, ())):
            raise RoutingError(f"experiment {e.id} is done before one that it waits for")
        time, energy = _drive(problem, site, e.site, time, energy)
        time = max(time, e.earliest_start) + e.duration
        energy += e.energy
        latest = problem.time_budget if e.latest_end is None else min(e.latest_end, problem.time_budget)
        if time > latest:
            raise RoutingError(f"experiment {e.id} ends at {time}, its latest end is {latest}")
        if problem.energy_budget is not None and energy > problem.energy_budget:
            raise RoutingError(f"experiment {e.id} brings energy to {energy}, budget {problem.energy_budget}")
        for k, limit in enumerate(problem.limits):
            taken[k] += limit.amounts[index]
            if taken[k] > limit.capacity:
                raise RoutingError(
                    f"experiment {e.id} brings {limit.name} to {taken[k]}, limit {limit.capacity}"
                )
        site = e.site
        finished.add(index)
        value += e.prize
    if problem.end_site is not None:
        time, energy = _drive(problem, site, problem.end_site, time, energy)
    if time > problem.time_budget:
        raise RoutingError(f"the route ends at {time}, time budget {problem.time_budget}")
    if problem.energy_budget is not None and energy > problem.energy_budget:
        raise RoutingError(f"the route uses energy {energy}, budget {problem.energy_budget}")
    missed = [e.id for i, e in enumerate(problem.experiments) if e.must_do and i not in finished]
    if missed:
        raise RoutingError(f"experiment {missed[0]} must be done and is not")
    return value


def _drive(problem: RoutingProblem, a: int, b: int, time: int, energy: int) -> tuple[int, int]:
    if a == b:
        return time, energy
    duration = int(problem.travel_time[a, b])
    if duration < 0:
        raise RoutingError(f"there is no road from site {a} to site {b}")
    return time + duration, energy + int(problem.travel_energy[a, b])


def checked(problem: RoutingProblem, solution: RoutingSolution) -> RoutingSolution:
    """Return the solution unchanged if the checker agrees with its claims.

    Raises
    ------
    SolverError
        If the route is infeasible, worth something else, or above the engine's own bound.
    """
    if solution.value is None:
        return solution
    try:
        value = route_value(problem, solution.route)
    except RoutingError as err:
        raise SolverError(f"engine {solution.engine} gave an infeasible route: {err}") from err
    if value != solution.value:
        raise SolverError(f"engine {solution.engine} claims {solution.value}, its route is worth {value}")
    if solution.upper is not None and value > solution.upper:
        raise SolverError(
            f"engine {solution.engine} claims the bound {solution.upper} below its value {value}"
        )
    return solution
