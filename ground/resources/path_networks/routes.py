"""Endpoints: path networks."""

from __future__ import annotations

from ground.api.resource_routes import resource_routes
from ground.resources.path_networks.build_path_network import build_path_network
from ground.resources.path_networks.kind import PATH_NETWORK

router = resource_routes(
    PATH_NETWORK,
    "planning",
    lists="List path networks with their geometry, oldest first.",
    limit=20,
    starts=(build_path_network, "Compute the path network: a job, whose subject is the network."),
    reads="Read a path network: nodes, segments, and the chance to lose each target on each.",
)
