"""Compare the records with the files they name."""

from __future__ import annotations

import shutil
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sqlalchemy import select

from ground.durable import SUMS, damaged_in
from ground.gdr.places import damaged_pieces, remove_folder
from ground.gdr.repository import FOLDERS_KEPT, Folders, Repository
from ground.gdr.store import Store
from ground.resources.campaigns.row import CampaignRow
from ground.resources.missions.row import MissionRow
from ground.resources.packages.row import PackageRow
from ground.resources.plans.draft import stray_drafts
from ground.resources.products.row import ProductRow
from ground.resources.runs.row import RunRow
from ground.resources.site_maps.row import SiteMapRow
from ground.resources.terrains.row import TerrainRow
from ground.resources.traverses.row import Localization, TraverseRow
from ground.resources.uploads.row import UploadRow

FRESH_S = 3600.0
"""A file younger than this may belong to a request still being answered."""


@dataclass(frozen=True, slots=True)
class FileReport:
    """Records whose file is missing, files that no record names, number of files, folders of no record."""

    without_file: list[str]
    unnamed: list[str]
    files: int
    strays: list[str]


_NAMED = (
    ProductRow.sha256,
    RunRow.trace_sha256,
    RunRow.telemetry_sha256,
    UploadRow.sha256,
    PackageRow.sha256,
    SiteMapRow.sha256,
)


def pictures_of(document: Localization | None) -> list[str]:
    """Return the hashes of the pictures of a traverse's stops."""
    return [] if document is None else [stop["picture"]["sha256"] for stop in document["stops"]]


def named_files(repo: Repository) -> dict[str, str]:
    """Return the hashes that records name, each with the id of such a record."""
    with repo.database.read() as session:
        named: dict[str, str] = {}
        for column in _NAMED:
            query = select(column, column.class_.id).where(column.is_not(None))
            named |= {str(sha256): str(owner) for sha256, owner in session.execute(query)}
        documents = select(TraverseRow.id, TraverseRow.document).where(TraverseRow.document.is_not(None))
        for owner, document in session.execute(documents):
            named |= dict.fromkeys(pictures_of(document), str(owner))
        return named


def stray_folders(repo: Repository) -> list[Store]:
    """Return the folders of runs and campaigns that are in no record: left by a downlink that did not come to
    its end, or by a mission that was deleted.
    """
    columns: dict[Folders, Any] = {"runs": RunRow.id, "campaigns": CampaignRow.id}
    found = {}
    for kind in columns:  # before the rows: who is faster is in them
        folder = repo.data_dir / kind
        here = {path.name for path in folder.iterdir()} if folder.is_dir() else set()
        found[kind] = sorted(here.union(repo.folders(kind).names()))
    with repo.database.read() as session:
        known = {kind: set(session.scalars(select(column))) for kind, column in columns.items()}
    return [
        repo.folders(kind).at(name)
        for kind, names in found.items()
        for name in names
        if name not in known[kind]
    ]


def _newest(folder: Store) -> float:
    """Return when a folder, here or in its store, was last changed."""
    here = [folder.root.stat().st_mtime] if folder.root.exists() else []
    return max([*here, *(() if folder.is_local else (when for _, when in folder.pieces()))], default=0.0)


def check_files(repo: Repository) -> FileReport:
    """Return what does not fit together."""
    named = named_files(repo)
    present = set(repo.files.hashes())
    missing = sorted(owner for sha256, owner in named.items() if sha256 not in present)
    strays = [folder.root.name for folder in stray_folders(repo)]
    return FileReport(missing, sorted(present - set(named)), len(present), strays)


def missing_files(repo: Repository) -> list[str]:
    """Return every stored file that a record names and that is not there."""
    named = named_files(repo)
    return [f"files/{sha256}" for sha256 in sorted(named.keys() - set(repo.files.hashes()))]


def damaged_files(repo: Repository) -> list[str]:
    """Return every stored file, and file of a terrain or of a run that came down, that is not what it was.

    Stored files are named by their content; the others were written down when they came. The files of a
    terrain of an older version were not, and its whole is checked against the record.
    """
    unsound = [sha256 for sha256 in sorted(repo.files.hashes()) if not repo.files.is_sound(sha256)]
    found = [f"files/{sha256}" for sha256 in unsound if repo.files.holds(sha256)]  # else just swept
    if not repo.files.store.is_local:
        return found + _damaged_objects(repo)
    for name in ("terrains", "runs"):
        folder = repo.data_dir / name
        for kept in sorted(folder.iterdir()) if folder.is_dir() else ():
            if kept.is_dir() and kept.name[0] != ".":
                odd_files = damaged_in(kept)
                found += [f"{name}/{kept.name}/{odd}" for odd in odd_files if kept.is_dir()]
    with repo.database.read() as session:
        terrains = dict(session.execute(select(TerrainRow.id, TerrainRow.sha256)).all())
    for identifier, sha256 in terrains.items():
        kept = repo.terrain_dir(identifier)
        if not (kept / SUMS).is_file() and _terrain_sha256(kept) != sha256:
            found.append(f"terrains/{identifier}")
    return found


def _damaged_objects(repo: Repository) -> list[str]:
    """Return files of kept folders that are not what was kept in the object store, and terrains it lacks."""
    found = []
    for kind in FOLDERS_KEPT:
        folders = repo.folders(kind)
        for name in folders.names():
            found += [f"{kind}/{name}/{odd}" for odd in damaged_pieces(folders.at(name))]
    with repo.database.read() as session:
        terrains = list(session.scalars(select(TerrainRow.id)))
    there = set(repo.folders("terrains").names())
    return found + [f"terrains/{name}" for name in terrains if name not in there]


def _terrain_sha256(folder: Path) -> str:
    from rover_iface.errors import RoverError
    from rover_iface.terrain import load_terrain

    try:
        return load_terrain(folder).sha256
    except (RoverError, OSError):
        return ""


def sweep_files(repo: Repository) -> list[str]:
    """Remove files and folders that no record names and that are older than an hour; return their names."""
    old = time.time() - FRESH_S
    gone = repo.files.sweep(set(named_files(repo)), old)
    for folder in stray_folders(repo):
        if _newest(folder) < old:
            remove_folder(folder)
            gone.append(folder.root.name)
    with repo.database.read() as session:
        missions = set(session.scalars(select(MissionRow.id)))
    for path in repo.training_dir("any").parent.glob("*"):
        if path.name not in missions and path.stat().st_mtime < old:
            shutil.rmtree(path, ignore_errors=True)
            gone.append(path.name)
    for path in stray_drafts(repo):
        if path.stat().st_mtime < old:
            path.unlink(missing_ok=True)
            gone.append(path.name)
    return gone
