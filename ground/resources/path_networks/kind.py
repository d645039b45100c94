"""How path networks are stored and shown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from sqlalchemy.orm import Session

from ground.gdr.geometry import pose_of
from ground.records.actor import Action
from ground.records.kind import Kind
from ground.records.show import value_of
from ground.resources.path_networks.row import PathNetworkRow
from ground.resources.path_networks.value import NetworkNode, NetworkSegment, PathNetwork, TrackingRegion
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


def show_networks(session: Session, rows: Sequence[PathNetworkRow]) -> list[PathNetwork]:
    now = {i: inputs_digest(session, i) for i in {r.mission_id for r in rows}}
    out = []
    for r in rows:
        geometry = r.geometry or NO_GEOMETRY
        out.append(
            value_of(
                PathNetwork,
                r,
                stale=now[r.mission_id] != r.inputs_sha256,
                nodes=[
                    NetworkNode(n["id"], pose_of(n["pose"]), n["target_id"], n["request_ids"])
                    for n in geometry["nodes"]
                ],
                segments=[NetworkSegment(**s) for s in geometry["segments"]],
                regions=[TrackingRegion(**g) for g in geometry["regions"]],
                hazards_m=geometry["hazards_m"],
                margins_m=geometry["margins_m"],
                unreachable=geometry["unreachable"],
                notes=geometry["notes"],
                computed=r.geometry is not None,
            )
        )
    return out


PATH_NETWORK = Kind(
    "path_network",
    "path network",
    "net",
    "path-networks",
    PathNetworkRow,
    show_networks,
    Action.PLAN,
    related=True,
)
