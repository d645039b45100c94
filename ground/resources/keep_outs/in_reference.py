"""Keep-outs in other references than the site's, in and out."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

from ground.geo.in_reference import from_site
from ground.records.located import OutlineIn, settled, without_at
from ground.resources.keep_outs.bodies import KeepOutCreate
from ground.resources.keep_outs.value import KeepOut
from ground.resources.missions.where import site_of


def keep_out_in_site(session: Any, mission_id: str, given: KeepOutCreate) -> KeepOutCreate:
    """Return a form with its outline in site metres.

    Raises
    ------
    InvalidInputError
        If the mission has no place, or nothing converts the reference.
    """
    if "at" not in given.model_fields_set:
        return given
    corners = [(x, y) for x, y in given.at.polygon]
    outline = settled(corners, given.at.crs, site_of(session, mission_id))
    return without_at(given, {"polygon_m": [list(corner) for corner in outline]})


def keep_outs_located(
    reader: Any, mission_id: str | None, values: Sequence[KeepOut], crs: str
) -> list[KeepOut]:
    """Return keep-outs that tell where they lie in a reference."""
    site = site_of(reader, mission_id or "")
    return [
        dataclasses.replace(value, at=OutlineIn(crs, from_site(value.polygon_m, crs, site)))
        for value in values
    ]
