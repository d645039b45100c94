"""Targets: points on rocks, and the way from one to all that came of it."""

from __future__ import annotations

from ground.api.resource_routes import resource_routes
from ground.resources.targets.create_target import create_target
from ground.resources.targets.kind import TARGET

router = resource_routes(
    TARGET,
    "targets",
    lists="List the targets of a mission.",
    makes=(
        create_target,
        "Pick a target; height, normal and covariance come from the full-resolution terrain.",
    ),
    reads="Read a target.",
    changes="Change or move a target; its observation points are found anew.",
    deletes="Delete a target with its observation requests.",
)
