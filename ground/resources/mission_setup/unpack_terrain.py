"""Lay out uploaded files as a terrain folder, without trusting them."""

from __future__ import annotations

import shutil
from pathlib import Path

from ground.errors import TerrainFileError
from ground.gdr.archives import extract_zip, is_zip
from ground.gdr.repository import Repository
from ground.records.actor import Actor
from ground.resources.uploads.store_upload import find_upload

TERRAIN_SUFFIXES = {".tif", ".tiff", ".glb", ".gltf", ".obj", ".ply"}
IMAGE_SUFFIXES = {".png", ".jpg", ".jpeg", ".tif", ".tiff"}


def unpack_terrain(
    repo: Repository, actor: Actor, upload_id: str, ortho_upload_id: str | None, work: Path
) -> Path:
    """Return a folder or file in `work` that the terrain readers take."""
    with repo.database.read() as session:
        main = find_upload(session, actor, upload_id, "/terrain/upload_id")
        ortho = None
        if ortho_upload_id is not None:
            ortho = find_upload(session, actor, ortho_upload_id, "/terrain/ortho_upload_id")
    stored = repo.files.path(main.sha256)
    if is_zip(stored):
        folder = work / "unpacked"
        extract_zip(stored, folder, max_bytes=int(repo.settings.max_body_mib * 8 * 2**20))
        inner = [p for p in folder.iterdir() if not p.name.startswith((".", "__"))]
        while len(inner) == 1 and inner[0].is_dir():
            folder = inner[0]
            inner = [p for p in folder.iterdir() if not p.name.startswith((".", "__"))]
        return folder
    suffix = Path(main.file_name).suffix.lower()
    if suffix not in TERRAIN_SUFFIXES:
        raise TerrainFileError(
            f"{main.file_name} is not a terrain: a zip of a terrain folder, a GeoTIFF (.tif), or a mesh "
            f"(.glb, .gltf, .obj, .ply) is needed",
            pointer="/terrain/upload_id",
        )
    if suffix not in {".tif", ".tiff"}:
        mesh = work / f"terrain{suffix}"
        shutil.copyfile(stored, mesh)
        return mesh
    folder = work / Path(main.file_name).stem[:60]
    folder.mkdir()
    shutil.copyfile(stored, folder / "dem.tif")
    if ortho is not None:
        image = Path(ortho.file_name).suffix.lower()
        if image not in IMAGE_SUFFIXES:
            raise TerrainFileError(
                f"{ortho.file_name} is not an image (.png, .jpg, .tif)", pointer="/terrain/ortho_upload_id"
            )
        shutil.copyfile(repo.files.path(ortho.sha256), folder / f"ortho{image}")
    return folder
