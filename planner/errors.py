"""What can go wrong in the planner.

PlannerError
├── ProblemError      a problem document is not one, or contradicts itself
│   ├── NetworkError  a path network request is wrong
│   └── RoutingError  an orienteering problem or file is wrong
├── ChangeError       a what-if changes what is not there, or contradicts itself
├── PlanTreeError     a plan tree is malformed, or does not fit its problem
└── SolverError       an engine handed back what its independent checker rejects

Expected outcomes (no plan in time, no plan at all) are values of `planner.solve.PlanStatus`, not exceptions.
"""

from __future__ import annotations


class PlannerError(Exception):
    """Base of the planner's errors."""


class ProblemError(PlannerError, ValueError):
    """The problem document is malformed; the message names the member, its value and the limit."""


class NetworkError(ProblemError):
    """A path network request is wrong; the message names the thing, its value and the limit."""


class RoutingError(ProblemError):
    """An orienteering problem or file is wrong; the message names the member, its value and the limit."""


class ChangeError(PlannerError, ValueError):
    """A what-if asks for an impossible change; `member` names the part of the changes that is wrong."""

    def __init__(self, message: str, *, member: str) -> None:
        super().__init__(message)
        self.member = member


class PlanTreeError(PlannerError, ValueError):
    """The plan tree is malformed or names something that its problem does not have."""


class SolverError(PlannerError, RuntimeError):
    """An engine broke its own promise: its answer does not pass the independent checker."""
