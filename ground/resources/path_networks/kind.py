"""How path networks are stored and shown."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from sqlalchemy.orm import Session

from ground.records.actor import Action
from ground.records.kind import Kind
from ground.resources.path_networks.bodies import PathNetworkCreate
from ground.resources.path_networks.row import PathNetworkRow
from ground.resources.path_networks.value import PathNetwork
from ground.resources.problems.inputs_digest import inputs_digest

NO_GEOMETRY: Mapping[str, Any] = {
    "nodes": [],
    "segments": [],
    "regions": [],
    "hazards_m": [],
    "margins_m": [],
    "unreachable": {},
    "notes": [],
}


def _geometry(
    session: Session, rows: Sequence[PathNetworkRow]
) -> Callable[[PathNetworkRow], Mapping[str, object]]:
    now = {i: inputs_digest(session, i) for i in {row.mission_id for row in rows}}
    return lambda row: {
        **(row.geometry or NO_GEOMETRY),
        "stale": now[row.mission_id] != row.inputs_sha256,
        "computed": row.geometry is not None,
    }


PATH_NETWORK = Kind(
    "path_network",
    "net",
    "path-networks",
    PathNetworkRow,
    PathNetwork,
    Action.PLAN,
    make=PathNetworkCreate,
    related=_geometry,
)
