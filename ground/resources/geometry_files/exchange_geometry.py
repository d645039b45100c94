"""Take targets and keep-outs in from a file, and give them out as one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from ground.errors import GroundError, NotFoundError, TooLargeError
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.edit import insert
from ground.records.kind import Kind
from ground.resources.geometry_files.site_geometry import Shape, read_shapes, refuse, to_csv, to_geojson
from ground.resources.geometry_files.value import ImportedGeometry
from ground.resources.keep_outs.create_keep_out import require_polygon
from ground.resources.keep_outs.kind import KEEP_OUT, show_keep_outs
from ground.resources.keep_outs.row import KeepOutRow
from ground.resources.missions.row import MissionRow
from ground.resources.targets.create_target import free_name, target_columns
from ground.resources.targets.kind import TARGET, show_targets
from ground.resources.targets.row import TargetRow
from ground.resources.uploads.store_upload import uploaded_file

EXCHANGED: Mapping[str, Kind] = {kind.name: kind for kind in (TARGET, KEEP_OUT)}
MAX_BYTES = 16 * 2**20


def import_geometry(repo: Repository, actor: Actor, mission_id: str, upload_id: str) -> ImportedGeometry:
    """Return the targets and keep-outs made from an uploaded GeoJSON or CSV file: all of them or none.

    Raises
    ------
    InvalidInputError
        If rows cannot be used: off the terrain, a name taken, a malformed place. It names all of them.
    """
    actor.require(Action.EDIT_SCIENCE, mission_id)
    path = uploaded_file(repo, upload_id)
    if path.stat().st_size > MAX_BYTES:
        raise TooLargeError(f"the file has {path.stat().st_size} bytes; {MAX_BYTES} are allowed")
    shapes = read_shapes(path.read_bytes())
    if any(shape.kind == "keep_out" for shape in shapes):
        actor.require(Action.EDIT_MISSION, mission_id)
    with repo.database.write() as session:
        if session.get(MissionRow, mission_id) is None:
            raise NotFoundError(f"there is no mission {mission_id}")
        group = new_id("imp")
        counted = select(func.count()).where(KeepOutRow.mission_id == mission_id)
        drawn = session.scalar(counted) or 0
        made: dict[str, list[Any]] = {"target": [], "keep_out": []}
        wrong = []
        for shape in shapes:
            try:
                row = _row(repo, session, actor, mission_id, shape, drawn + len(made["keep_out"]))
            except GroundError as err:
                wrong.append((shape.row, err.message))
                continue
            insert(session, actor, EXCHANGED[shape.kind], row, reason="import", group=group)
            made[shape.kind].append(row)
        if wrong:
            raise refuse(wrong, len(shapes))
        return ImportedGeometry(
            show_targets(session, made["target"]), show_keep_outs(session, made["keep_out"])
        )


def _row(
    repo: Repository, session: Session, actor: Actor, mission_id: str, shape: Shape, before: int
) -> TargetRow | KeepOutRow:
    if shape.kind == "target":
        east_m, north_m = shape.corners_m[0]
        return TargetRow(
            id=new_id("tgt"),
            author=actor.name,
            mission_id=mission_id,
            name=free_name(session, mission_id, shape.name),
            notes=shape.notes,
            source_image=shape.source_image,
            **target_columns(repo, session, mission_id, east_m, north_m),
        )
    require_polygon(session, mission_id, shape.corners_m)
    return KeepOutRow(
        id=new_id("kpo"),
        author=actor.name,
        mission_id=mission_id,
        name=shape.name or f"Keep-out {before + 1}",
        notes=shape.notes,
        polygon_m=[list(corner) for corner in shape.corners_m],
        sigma_m=0.0,
    )


def export_geometry(repo: Repository, actor: Actor, mission_id: str, *, form: str) -> bytes:
    """Return all targets and keep-outs of a mission as `geojson` or `csv`."""
    actor.require(Action.READ, mission_id)
    with repo.database.read() as session:
        if session.get(MissionRow, mission_id) is None:
            raise NotFoundError(f"there is no mission {mission_id}")
        t, k = TargetRow, KeepOutRow
        targets = session.scalars(select(t).where(t.mission_id == mission_id).order_by(t.id))
        keep_outs = session.scalars(select(k).where(k.mission_id == mission_id).order_by(k.id))
        found = show_targets(session, list(targets)), show_keep_outs(session, list(keep_outs))
    return to_csv(*found) if form == "csv" else to_geojson(*found)
