"""Keep-outs: polygons the rover must not enter."""

from __future__ import annotations

from ground.api.resource_routes import resource_routes
from ground.resources.keep_outs.create_keep_out import create_keep_out
from ground.resources.keep_outs.kind import KEEP_OUT

router = resource_routes(
    KEEP_OUT,
    "keep-outs",
    lists="List the keep-outs of a mission.",
    makes=(create_keep_out, "Draw a keep-out."),
    reads="Read a keep-out.",
    changes="Change a keep-out.",
    deletes="Delete a keep-out.",
)
