"""Take targets and keep-outs in from a file, and give them out as one."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.errors import GroundError, InvalidInputError, TooLargeError
from ground.gdr.repository import Repository
from ground.geo.references import SITE
from ground.records.actor import Action, Actor
from ground.records.edit import insert
from ground.records.forms import references
from ground.records.get_resource import mission_of, require_mission
from ground.records.kind import Kind
from ground.resources.features.collections import collection_of
from ground.resources.frames.kind import FRAME
from ground.resources.geometry_files.gis_files import DRIVERS, to_gpx, write_gis
from ground.resources.geometry_files.site_geometry import read_shapes, refuse, to_csv, to_geojson
from ground.resources.geometry_files.value import ImportedGeometry
from ground.resources.keep_outs.bodies import KeepOutCreate
from ground.resources.keep_outs.create_keep_out import keep_out_row
from ground.resources.keep_outs.kind import KEEP_OUT
from ground.resources.keep_outs.row import KeepOutRow
from ground.resources.missions.where import site_of
from ground.resources.targets.bodies import TargetCreate
from ground.resources.targets.create_target import Foreseen, foresee_targets, target_row
from ground.resources.targets.kind import TARGET
from ground.resources.targets.row import TargetRow
from ground.resources.uploads.store_upload import uploaded_file

KINDS: Mapping[str, Kind[Any]] = {kind.name: kind for kind in (TARGET, KEEP_OUT)}
Given = TargetCreate | KeepOutCreate
REFERRED: Mapping[str, Kind[Any]] = {FRAME.name: FRAME}
LINES = ("traverses", "ribbons")
"""Collections of lines that go out beside targets and keep-outs."""
MAX_BYTES = 16 * 2**20


def import_geometry(
    repo: Repository, actor: Actor, mission_id: str, upload_id: str, crs: str | None = None
) -> ImportedGeometry:
    """Return the targets and keep-outs made from an uploaded GeoJSON or CSV file: all of them or none.

    `crs` is the reference of a file that names none.

    Raises
    ------
    InvalidInputError
        If rows cannot be used: off the terrain, a name taken, a malformed place. It names all of them.
    """
    actor.require(Action.EDIT_SCIENCE, mission_id)
    path = uploaded_file(repo, actor, upload_id)
    if path.stat().st_size > MAX_BYTES:
        raise TooLargeError(f"the file has {path.stat().st_size} bytes; {MAX_BYTES} are allowed")
    with repo.database.read() as session:
        site = site_of(session, mission_id)
    shapes = read_shapes(path.read_bytes(), crs=crs, site=site)
    if any(shape.kind == "keep_out" for shape in shapes):
        actor.require(Action.EDIT_MISSION, mission_id)
    points = [shape.given for shape in shapes if isinstance(shape.given, TargetCreate)]
    foreseen = iter(foresee_targets(repo, mission_id, points))
    with repo.database.write() as session:
        require_mission(session, mission_id)
        made: dict[str, list[Any]] = {"target": [], "keep_out": []}
        wrong = []
        for shape in shapes:
            try:
                row = _row(session, actor, mission_id, shape.given, foreseen)
            except GroundError as err:
                wrong.append((shape.row, err.message))
                continue
            insert(session, actor, KINDS[shape.kind], row, reason="import")
            made[shape.kind].append(row)
        if wrong:
            raise refuse(wrong, len(shapes))
        return ImportedGeometry(
            TARGET.show(session, made["target"]), KEEP_OUT.show(session, made["keep_out"])
        )


def _row(
    session: Session, actor: Actor, mission_id: str, given: Given, foreseen: Iterator[Foreseen | GroundError]
) -> TargetRow | KeepOutRow:
    """Return the row of a shape; the terrain was asked of each target before, in their order."""
    given = _without_strangers(session, mission_id, given)
    if isinstance(given, KeepOutCreate):
        return keep_out_row(session, actor, mission_id, given)
    known = next(foreseen)
    if isinstance(known, GroundError):
        raise known
    return target_row(session, actor, mission_id, given, known[1])


def _without_strangers(session: Session, mission_id: str, given: Given) -> Given:
    """Return what was given, with names of things of another mission as lines of the notes."""
    changes: dict[str, object] = {}
    lines = [given.notes] if given.notes else []
    for name, kind in references(type(given)).items():
        identifier = getattr(given, name)
        if identifier is None:
            continue
        row = session.get(REFERRED[kind].row, identifier)
        if row is None or mission_of(row) != mission_id:
            changes[name] = None
            lines.append(f"{name}: {identifier}")
    return given.model_copy(update={**changes, "notes": "\n".join(lines)}) if changes else given


def export_geometry(
    repo: Repository,
    actor: Actor,
    mission_id: str,
    *,
    form: str,
    crs: str | None = None,
    lines: bool = False,
) -> bytes:
    """Return all targets and keep-outs of a mission as `geojson`, `csv`, `gpkg`, `kml` or `gpx`.

    `crs` is the reference of the coordinates: site metres, and for a GeoPackage that of the mission's place,
    unless another one is named. KML and GPX are in longitude and latitude. `lines` adds traverses and the
    ribbons of plans to a GeoPackage, KML or GPX.

    Raises
    ------
    InvalidInputError
        If the mission has no place, there is no transformation, or the form holds no lines.
    """
    actor.require(Action.READ, mission_id)
    if lines and form not in {*DRIVERS, "gpx"}:
        raise InvalidInputError(
            f"{form} holds targets and keep-outs; lines are in gpkg, kml and gpx, and as GeoJSON in "
            f"/missions/{mission_id}/features/collections/ribbons/items",
            pointer="lines",
        )
    with repo.database.read() as session:
        require_mission(session, mission_id)
        found = {}
        for name, kind in KINDS.items():
            rows = select(kind.row).where(kind.row.__table__.c.mission_id == mission_id).order_by(kind.row.id)
            found[name] = kind.show(session, list(session.scalars(rows)))
        site = site_of(session, mission_id)
        drawn = {
            name: list(collection_of(name)[1](repo, session, mission_id, None))
            for name in (LINES if lines else ())
        }
    if form == "gpx":
        return to_gpx(found, site, drawn)
    if form in DRIVERS:
        with tempfile.TemporaryDirectory(prefix="outcrop-gis-") as folder:
            file = Path(folder) / f"{mission_id}.{form}"
            write_gis(found, file, form, crs or (SITE if site is None else site.crs), site, drawn)
            return file.read_bytes()
    write = to_csv if form == "csv" else to_geojson
    return write(found, crs=crs or SITE, site=site)
