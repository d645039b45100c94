"""A mission's catalogue as files that refer to each other, in one archive; and its documents one by one."""

from __future__ import annotations

import json
import tempfile
import zipfile
from collections.abc import Mapping
from pathlib import Path
from urllib.parse import quote

from ground.errors import NotFoundError
from ground.gdr.archives import name_in_archive
from ground.gdr.repository import Repository
from ground.records.actor import Actor
from ground.resources.stac.read_catalogue import PRODUCTS, TERRAIN, Catalogue, read_catalogue, write_layer
from mission.codec import Document
from neighbours.geodata.stac import (
    Group,
    Item,
    Links,
    catalogue,
    group_document,
    is_collection,
    item_document,
)


def export_catalogue(repo: Repository, actor: Actor, mission_id: str, target: Path) -> None:
    """Write a zip with `catalog.json`, a folder for terrain and products each, and all files.

    Links are relative, so that the folder can lie anywhere.
    """
    found = read_catalogue(repo, actor, mission_id, _beside, _beside)
    with (
        zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive,
        tempfile.TemporaryDirectory(prefix="outcrop-stac-") as drafts,
    ):
        for name, document in static_documents(found).items():
            archive.writestr(name, json.dumps(document, indent=1))
        for item in found.group(TERRAIN).items:
            for kind in item.assets:
                draft = Path(drafts) / f"{kind}.tif"
                write_layer(repo, actor, mission_id, layer_of_item(item.id), kind, draft)
                archive.write(draft, f"{TERRAIN}/{item.id}/{kind}.tif", zipfile.ZIP_STORED)
        for item in found.group(PRODUCTS).items:
            archive.write(
                found.files[item.id], f"{PRODUCTS}/{item.id}/{name_in_archive(item.assets['data'].title)}"
            )


def _beside(_item: str, file: str) -> str:
    """Return the relative address of a file of an item: an href is a URI reference, not a name of a file."""
    return f"./{quote(name_in_archive(file))}"


def layer_of_item(identifier: str) -> str:
    """Return the name of the layer that a terrain item is of."""
    return identifier.rpartition("-")[2]


def static_documents(found: Catalogue) -> dict[str, Mapping[str, object]]:
    """Return the documents of a catalogue of files by their paths."""
    names = {group.id: _file(group) for group in found.groups}
    parts = {group.id: f"./{group.id}/{names[group.id]}" for group in found.groups}
    head = catalogue(
        found.id, found.title, found.description, found.groups, Links("./catalog.json", parts=parts)
    )
    documents: dict[str, Document] = {"catalog.json": head}
    for group in found.groups:
        parts = {item.id: f"./{item.id}/{item.id}.json" for item in group.items}
        links = Links("../catalog.json", "../catalog.json", parts=parts)
        documents[f"{group.id}/{names[group.id]}"] = group_document(group, links)
        for item in group.items:
            above = Links("../../catalog.json", f"../{names[group.id]}")
            collection = group.id if group.id in found.placed else None
            documents[f"{group.id}/{item.id}/{item.id}.json"] = item_document(item, above, collection)
    return documents


def _file(group: Group) -> str:
    return "collection.json" if is_collection(group) else "catalog.json"


def read_document(
    repo: Repository,
    actor: Actor,
    mission_id: str,
    base: str,
    group: str | None = None,
    item: str | None = None,
) -> Mapping[str, object]:
    """Return one document of the catalogue as the service has it; `base` is the address of the service's API.

    Raises
    ------
    NotFoundError
        If there is no such group or item.
    """
    root = f"{base}/missions/{mission_id}/stac"
    found = read_catalogue(
        repo,
        actor,
        mission_id,
        lambda name, file: f"{root}/{TERRAIN}/{name}/{file}",
        lambda name, _file: f"{base}/products/{name}/file",
        None if group is None or item is None else (group, item),
    )
    if group is None:
        parts = {part.id: f"{root}/{part.id}" for part in found.groups}
        links = Links(root, own=root, parts=parts)
        return catalogue(found.id, found.title, found.description, found.groups, links)
    here = found.group(group)
    if item is None:
        parts = {part.id: f"{root}/{group}/{part.id}" for part in here.items}
        return group_document(here, Links(root, root, f"{root}/{group}", parts))
    one: Item = found.item(group, item)
    links = Links(root, f"{root}/{group}", f"{root}/{group}/{item}")
    return item_document(one, links, group if group in found.placed else None)


def write_terrain_asset(
    repo: Repository, actor: Actor, mission_id: str, item: str, file: str, target: Path
) -> None:
    """Write an asset of a terrain item as a COG.

    Raises
    ------
    NotFoundError
        If there is no such item or asset.
    """
    found = read_catalogue(repo, actor, mission_id, _beside, _beside, (TERRAIN, item)).item(TERRAIN, item)
    kind = file.removesuffix(".tif")
    if kind not in found.assets:
        raise NotFoundError(f"{item} has no asset {file!r}; it has {', '.join(found.assets)}")
    write_layer(repo, actor, mission_id, layer_of_item(item), kind, target)
