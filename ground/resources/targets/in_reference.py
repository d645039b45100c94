"""Targets in other references than the site's, in and out."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

from ground.geo.in_reference import from_site
from ground.records.located import PointIn, settled, without_at
from ground.resources.missions.where import site_of
from ground.resources.targets.bodies import TargetCreate
from ground.resources.targets.value import Target


def target_in_site(session: Any, mission_id: str, given: TargetCreate) -> TargetCreate:
    """Return a form with its place in site metres.

    Raises
    ------
    InvalidInputError
        If the mission has no place, or nothing converts the reference.
    """
    if "at" not in given.model_fields_set:
        return given
    at = given.at
    ((east, north),) = settled([(at.x, at.y)], at.crs, site_of(session, mission_id))
    return without_at(given, {"east_m": east, "north_m": north})


def targets_located(reader: Any, mission_id: str | None, values: Sequence[Target], crs: str) -> list[Target]:
    """Return targets that tell where they lie in a reference."""
    points = [(value.position.east_m, value.position.north_m) for value in values]
    found = from_site(points, crs, site_of(reader, mission_id or ""))
    return [
        dataclasses.replace(value, at=PointIn(crs, x, y)) for value, (x, y) in zip(values, found, strict=True)
    ]
