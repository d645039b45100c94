"""How site maps are stored and shown."""

from __future__ import annotations

from collections.abc import Sequence

from ground.records.actor import Action
from ground.records.kind import Kind
from ground.records.show import value_of
from ground.resources.site_maps.bodies import SiteMapChange, SiteMapCreate
from ground.resources.site_maps.row import SiteMapRow
from ground.resources.site_maps.value import SiteMap


def show_site_maps(_session: object, rows: Sequence[SiteMapRow]) -> list[SiteMap]:
    return [value_of(SiteMap, r, file_url=f"/api/v1/site-maps/{r.id}/file") for r in rows]


SITE_MAP = Kind(
    "site_map",
    "site map",
    "map",
    "site-maps",
    SiteMapRow,
    show_site_maps,
    Action.EDIT_MISSION,
    make=SiteMapCreate,
    change=SiteMapChange,
    undoable=True,
)
