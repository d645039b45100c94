"""A mission's pictures, terrain and list of products as files with PDS4 labels, in one archive."""

from __future__ import annotations

import io
import json
import re
import zipfile
from datetime import datetime, timedelta
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING

from sqlalchemy import select

from ground.gdr.repository import Repository
from ground.gdr.terrain_folders import load_cached
from ground.geo.place import Place
from ground.geo.spice_site import body_of
from ground.records.actor import Action, Actor
from ground.records.get_resource import require_mission
from ground.resources.missions.row import MissionRow
from ground.resources.missions.terrain import terrain_row
from ground.resources.products.row import ProductRow
from ground.resources.stac.planned_sols import aware, planned_sols
from ground.resources.terrains.terrain import layer_names, layer_of
from ground.spreadsheet import inert
from neighbours.geodata.pds4 import About, Kind, Labelled, height_map, image, table

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

PICTURES = {"image/png", "image/jpeg"}
COLUMNS: tuple[tuple[str, Kind], ...] = (
    *((name, "ASCII_String") for name in ("product", "file", "kind", "instrument", "target", "request")),
    *((name, "ASCII_String") for name in ("run", "task", "sha256")),
    ("t_s", "ASCII_Real"),
    ("size_bytes", "ASCII_Integer"),
)
"""Columns of `products.csv`."""
_FORBIDDEN = re.compile(r'["\r\n]')
"""Characters that a cell of a delimited table of PDS4 must not hold."""


def export_pds4(repo: Repository, actor: Actor, mission_id: str, target: Path) -> None:
    """Write a zip with a PDS4 label beside each picture, each layer's heights and the table of all products.

    Pictures go as raw pixels, `PRODUCT.img`. What has no object in PDS4 is named in `not-labelled.json`.
    """
    actor.require(Action.READ, mission_id)
    with repo.database.read() as session:
        require_mission(session, mission_id)
        mission = session.get_one(MissionRow, mission_id)
        terrain = terrain_row(session, mission_id)
        ground = load_cached(repo.terrain_dir(terrain.id))
        rows = list(
            session.scalars(
                select(ProductRow).where(ProductRow.mission_id == mission_id).order_by(ProductRow.id)
            )
        )
        sols = planned_sols(session, mission_id)
        starts = {plan: aware(sol.start_utc) for plan, sol in sols.items() if sol.start_utc is not None}
        body = None if mission.place is None else body_of(Place(**mission.place))
    place = "the site has no place" if mission.place is None else f"place {json.dumps(mission.place)}"
    said = f"heights over the site's zero, row 0 in the north; {place}; {terrain.credits}"
    skipped: dict[str, str] = {}
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in layer_names(ground):
            identifier, title = f"{terrain.id}-{name}", f"Heights of {terrain.name}, {name}"
            about = _about_mission(mission, body, identifier, title, terrain.created_utc, said)
            heights = layer_of(ground, name).heights[::-1]
            _put(archive, height_map(about, f"{identifier}.img", heights))
        for row in rows:
            pixels = _pixels(repo, row)
            if pixels is None:
                skipped[row.id] = f"{row.file_name} ({row.media}) has no object in PDS4 here"
                continue
            _put(archive, image(_about(mission, row, starts, body), f"{row.id}.img", pixels))
        if rows:
            about = _about_mission(mission, body, "products", "Data products", mission.created_utc)
            _put(archive, table(about, "products.csv", COLUMNS, [_cells(row) for row in rows]))
        archive.writestr("not-labelled.json", json.dumps(skipped, indent=1))


def _put(archive: zipfile.ZipFile, made: Labelled) -> None:
    archive.writestr(made.file_name, made.content)
    archive.writestr(made.label_name, made.label)


BYTES = frozenset({"1", "L", "P", "RGB"})
"""Modes of pictures whose values are bytes."""


def _pixels(repo: Repository, row: ProductRow) -> NDArray[np.uint8] | None:
    """Return the pixels [rows, columns] or [rows, columns, 3] of a product that is a picture of bytes."""
    if row.media not in PICTURES:
        return None
    import numpy as np
    from PIL import Image

    try:
        with Image.open(io.BytesIO(repo.files.read(row.sha256))) as opened:
            if opened.mode not in BYTES:
                return None  # 16 bits, say: what cannot be kept as it is is not labelled
            return np.asarray(opened.convert("L" if opened.mode in ("L", "1") else "RGB"))
    except (OSError, ValueError, Image.DecompressionBombError):
        return None


def _about(mission: MissionRow, row: ProductRow, starts: dict[str, datetime], body: str | None) -> About:
    start = starts.get(row.plan_id or "")
    taken = None if start is None else start + timedelta(seconds=row.t_s)
    told = {
        "run": row.run_id,
        "task": row.task_id,
        "request": row.request_id,
        "target": row.target_id,
        "t_s": f"{row.t_s:.3f}",
        "kind": row.kind,
        "file": PurePosixPath(row.file_name).name,
        "sha256 of the file": row.sha256,
    }
    return About(
        row.id,
        mission.id,
        f"{row.kind} of {row.target_id or 'the site'}",
        mission.name,
        mission.rover_profile,
        row.instrument,
        body,
        taken,
        taken,
        aware(row.created_utc),
        "; ".join(f"{name} {value}" for name, value in told.items() if value),
    )


def _about_mission(
    mission: MissionRow, body: str | None, name: str, title: str, made: datetime, comment: str = ""
) -> About:
    """Return what is said of a file that was observed at no one time, by no one instrument."""
    return About(
        name,
        mission.id,
        title,
        mission.name,
        mission.rover_profile,
        "",
        body,
        None,
        None,
        aware(made),
        comment,
    )


def _cells(row: ProductRow) -> list[str]:
    words = (row.id, row.file_name, row.kind, row.instrument, row.target_id, row.request_id, row.run_id)
    texts = (_FORBIDDEN.sub("'", word or "") for word in (*words, row.task_id, row.sha256))
    return [*map(inert, texts), repr(row.t_s), str(row.size_bytes)]
