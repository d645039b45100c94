"""Observation requests: what a scientist asks of a target."""

from __future__ import annotations

from ground.api.resource_routes import resource_routes
from ground.resources.observation_requests.create_request import create_request
from ground.resources.observation_requests.kind import OBSERVATION_REQUEST

router = resource_routes(
    OBSERVATION_REQUEST,
    "observation requests",
    lists="List observation requests, of one target or in one state if wanted.",
    makes=(create_request, "File an observation request; the observation point is found by base placement."),
    reads="Read an observation request.",
    changes="Change an observation request.",
    deletes="Delete an observation request.",
)
