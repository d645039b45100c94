"""Sols: one day of work each."""

from __future__ import annotations

from ground.api.resource_routes import resource_routes
from ground.resources.sols.create_sol import create_sol
from ground.resources.sols.kind import SOL

router = resource_routes(
    SOL,
    "sols",
    lists="List the sols of a mission.",
    makes=(create_sol, "Open a sol; what is left out has a default."),
    reads="Read a sol.",
    changes="Change a sol; plans made before become stale.",
    deletes="Delete a sol that has no plans.",
)
