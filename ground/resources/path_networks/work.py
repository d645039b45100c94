"""Compute a path network."""

from __future__ import annotations

from typing import Any

from ground.day.convert import Report
from ground.day.payload import network_geometry, observation_points, prepare


def work(payload: dict[str, Any], report: Report, _should_stop: object) -> dict[str, Any]:
    """Return the geometry of the path network of a day."""
    day = prepare(payload, lambda share, what: report(0.9 * share, what))
    report(0.95, "path network")
    return {"geometry": network_geometry(day), "observation_points": observation_points(day)}
