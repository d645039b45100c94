"""How site maps are stored and shown."""

from __future__ import annotations

from ground.records.actor import Action
from ground.records.kind import Kind
from ground.resources.site_maps.bodies import SiteMapChange, SiteMapCreate
from ground.resources.site_maps.row import SiteMapRow
from ground.resources.site_maps.value import SiteMap

SITE_MAP = Kind(
    "site_map",
    "map",
    "site-maps",
    SiteMapRow,
    SiteMap,
    Action.EDIT_MISSION,
    make=SiteMapCreate,
    change=SiteMapChange,
    undoable=True,
    computed={"file_url": lambda row: f"/api/v1/site-maps/{row.id}/file"},
)
