"""Compute a path network."""

from __future__ import annotations

from collections.abc import Mapping

from ground.day.prepare import Report
from ground.resources.path_networks.geometry import network_geometry, observation_points
from ground.resources.path_networks.order import NetworkOrder


def work(order: NetworkOrder, report: Report, _should_stop: object) -> Mapping[str, object]:
    """Return the geometry of the path network of a day."""
    day = order.site.prepare(order.day, lambda share, what: report(0.9 * share, what))
    report(0.95, "path network")
    return {"geometry": network_geometry(day), "observation_points": observation_points(day)}
