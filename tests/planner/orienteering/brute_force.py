"""The optimum by trying every order: the independent truth for small problems."""

from __future__ import annotations

from planner.errors import RoutingError
from planner.orienteering import RoutingProblem, route_value


def optimum(problem: RoutingProblem) -> int | None:
    """Return the largest value of any route, None when no route is feasible.

    Feasible routes need not have feasible beginnings (a must-do comes later, the end may be too far), so
    every ordered subset is looked at; only orders whose experiments already break a rule are cut.
    """
    best: int | None = None

    def extend(route: tuple[int, ...]) -> None:
        nonlocal best
        try:
            value = route_value(problem, route)
        except RoutingError as err:
            if not ("must be done" in str(err) or "the route" in str(err) or "no road" in str(err)):
                return
        else:
            best = value if best is None else max(best, value)
        for index in range(len(problem.experiments)):
            if index not in route and index not in problem.done:
                extend((*route, index))

    extend(())
    return best
