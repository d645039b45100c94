"""Endpoints: planning problems."""

from __future__ import annotations

from ground.api.resource_routes import resource_routes
from ground.resources.problems.kind import PROBLEM

router = resource_routes(
    PROBLEM,
    "planning",
    lists="List planning problems.",
    limit=20,
    reads="Read a planning problem; `document` has the form `problem/1` or `problem/2`.",
)
