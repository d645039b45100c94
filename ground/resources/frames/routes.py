"""Endpoints: frames of the site chain."""

from __future__ import annotations

from ground.api.resource_routes import resource_routes
from ground.resources.frames.create_frame import create_frame
from ground.resources.frames.kind import FRAME

router = resource_routes(
    FRAME,
    "frames",
    lists="List sites, ends of drives and poses, each with its place by the solutions in use.",
    makes=(
        create_frame,
        "Name a frame by its motion counter; the first site of a mission becomes its anchor.",
    ),
    reads="Read a frame.",
    changes="Change the notes of a frame.",
)
