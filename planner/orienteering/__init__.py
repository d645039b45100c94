"""Goal selection and seed plans: solvers behind one Protocol.

```python
import numpy as np
from planner.orienteering import Experiment, RoutingProblem, solve

problem = RoutingProblem(
    travel_time=np.array([[0, 300], [280, 0]]),      # seconds, site x site, integers; negative = no road
    travel_energy=np.array([[0, 4000], [3500, 0]]),  # joules
    experiments=(
        Experiment("G1", site=1, prize=46_000, duration=504, energy=15_400),
        Experiment("G2", site=1, prize=12_000, duration=180, energy=3_000, latest_end=3600),
    ),
    time_budget=7200,
    energy_budget=60_000,
    precedence=((0, 1),),
)
solution = solve(problem, time_limit_s=5.0, seed=1)
solution.value, solution.upper, solution.proven, solution.route   # route = indices into experiments
```

`solve(problem, *, time_limit_s=10.0, iterations=None, seed=0, threads=1, engine="auto") -> RoutingSolution`.

For branch problems (other start, time, energy used, experiments done) keep one `ExactSolver`, whose table
serves them all, and hand it variants made with `dataclasses.replace`:

```python
from dataclasses import replace
from planner.orienteering import ExactSolver

solver = ExactSolver(problem)
solver.prepare()
later = replace(problem, start_site=1, start_time=2500, energy_used=21_000, done=frozenset({0}))
branch = solver.solve(later)
```

Prizes, times and energies are non-negative integers; scale utilities (for example by 1000) before.
`route_value(problem, route)` is the independent checker. Heavy modules load when an engine runs.
"""

from typing import TYPE_CHECKING, Any

from planner.orienteering.check import checked, route_value
from planner.orienteering.engines import ENGINES, RoutingEngine, solve, warm_up
from planner.orienteering.files import RoutingFile, read_routing_file, solution_document
from planner.orienteering.problem import Experiment, RoutingProblem, RoutingSolution, SideLimit

if TYPE_CHECKING:
    from planner.orienteering.exact import ExactOptions, ExactSolver

__all__ = [
    "ENGINES",
    "ExactOptions",
    "ExactSolver",
    "Experiment",
    "RoutingEngine",
    "RoutingFile",
    "RoutingProblem",
    "RoutingSolution",
    "SideLimit",
    "checked",
    "read_routing_file",
    "route_value",
    "solution_document",
    "solve",
    "warm_up",
]


def __getattr__(name: str) -> Any:
    if name in ("ExactOptions", "ExactSolver"):
        from planner.orienteering import exact

        return getattr(exact, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
