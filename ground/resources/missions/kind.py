"""How missions are stored and shown."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields

from sqlalchemy import column, func, select, table
from sqlalchemy.orm import Session

from ground.records.actor import Action
from ground.records.kind import Kind
from ground.resources.missions.bodies import MissionChange
from ground.resources.missions.row import MissionRow
from ground.resources.missions.value import Counts, Mission
from ground.resources.terrains.row import TerrainRow

_COUNTED = tuple(field.name for field in fields(Counts))
"""Tables of what rests on a mission; they stand above it, so they are named and not imported."""


def _counts(session: Session, mission_ids: Sequence[str]) -> dict[str, Counts]:
    found: dict[str, dict[str, int]] = {i: dict.fromkeys(_COUNTED, 0) for i in mission_ids}
    for name in _COUNTED:
        mission = table(name, column("mission_id")).c.mission_id
        query = select(mission, func.count()).where(mission.in_(mission_ids)).group_by(mission)
        for mission_id, count in session.execute(query):
            found[mission_id][name] = count
    return {i: Counts(**c) for i, c in found.items()}


def _of_missions(
    session: Session, rows: Sequence[MissionRow]
) -> Callable[[MissionRow], Mapping[str, object]]:
    counts = _counts(session, [row.id for row in rows])
    terrains = select(TerrainRow.id, TerrainRow.name).where(TerrainRow.id.in_({r.terrain_id for r in rows}))
    names = {terrain.id: terrain.name for terrain in session.execute(terrains)}
    return lambda row: {"terrain_name": names.get(row.terrain_id, ""), "counts": counts[row.id]}


MISSION = Kind(
    "mission",
    "msn",
    "missions",
    MissionRow,
    Mission,
    Action.EDIT_MISSION,
    change=MissionChange,
    undoable=True,
    related=_of_missions,
    delete=Action.ADMINISTER,
    absent="in_making",
    unseen=frozenset({"in_making"}),
)
