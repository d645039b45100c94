"""Terrain on disk: the folder form `terrain/1`, folders of rasters by name, single GeoTIFFs, meshes.

`terrain/1` is a folder with `terrain.json`::

    {"format": "terrain/1", "name": ..., "credits": ..., "origin": {...},
     "layers": [{"dem": "dem_32m.tif", "ground": "ground_32m.tif", "ortho": "ortho_32m.png",
                 "mask": "mask_32m.png", "sigma": "sigma_32m.tif"}],
     "rocks": "rocks.json", "panorama": "panorama.json", "surface": {"geology": "gale", ...}}

`surface` is what a geology laid on the ground (`rover_iface.terrain.surface`), null where none did.
`sigma` is the standard deviation of the heights, m; `panorama` the pictures that the heights were made from,
of form `panorama/1`. Every member of a layer but `dem` may be absent; a single layer may be given by the
members `dem`, `ortho` and `mask` of the document itself. An ortho image has the extent of its DEM unless a
world file lies beside it. A folder without `terrain.json` is read by its names: `dem_<size>*.tif` with
`ortho_<size>*` and `*mask_<size>*`.
"""

from __future__ import annotations

import hashlib
import json
import math
import re
from dataclasses import field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated

import numpy as np
from annotated_types import MinLen
from numpy.typing import NDArray

from mission.codec import Codec, Document, read_object
from mission.values import reads_over, value
from rover_iface.errors import TerrainFormatError
from rover_iface.terrain.dem import Dem, crs_text, read_dem
from rover_iface.terrain.georeferenced_image import image_on_dem, mask_on_dem
from rover_iface.terrain.grid import HeightLayer, Ortho
from rover_iface.terrain.mesh import MESHES, load_mesh_terrain
from rover_iface.terrain.outside import inside, opened_image
from rover_iface.terrain.panorama_files import copied_panorama, panorama_files
from rover_iface.terrain.rocks import ROCKS, Rock, rocks_text
from rover_iface.terrain.surface import Surface
from rover_iface.terrain.terrain import Terrain

if TYPE_CHECKING:
    from affine import Affine
    from rasterio.crs import CRS

FAR_M = 20_000.0
"""A DEM that starts farther from its projection's origin than this gets a site frame of its own."""


@reads_over
@value
class LayerFiles:
    """Files of one raster of heights, in the terrain's folder."""

    dem: str
    ground: str | None = None
    ortho: str | None = None
    mask: str | None = None
    sigma: str | None = None


@reads_over
@value
class TerrainFile:
    """What a `terrain/1` document holds; `origin` is where the site frame lies, as its author counts."""

    name: str = ""
    credits: str = ""
    origin: Document = field(default_factory=dict)
    layers: Annotated[tuple[LayerFiles, ...], MinLen(1)] = ()
    rocks: str | None = None
    panorama: str | None = None
    surface: Surface | None = None


TERRAINS = Codec(TerrainFile, "terrain/1", "terrain", error=TerrainFormatError)

_IMAGES = {".png", ".jpg", ".jpeg", ".tif", ".tiff"}


def load_terrain(path: Path | str) -> Terrain:
    """Return the terrain of a folder, a GeoTIFF or a mesh file.

    Raises
    ------
    TerrainFormatError
        If there is no DEM, it has no georeference, counts in feet, or a file is missing or malformed.
    """
    path = Path(path)
    if not path.exists():
        raise TerrainFormatError(f"terrain {path} does not exist")
    if path.is_file():
        if path.name == "terrain.json":
            return load_terrain(path.parent)
        if path.suffix.lower() in MESHES:
            return load_mesh_terrain(path)
        return _assemble(path.stem, path.parent, TerrainFile(layers=(LayerFiles(path.name),)))
    description = path / "terrain.json"
    if description.exists():
        document = read_object(description, TerrainFormatError)
        if "layers" not in document:
            single = {
                name: document.pop(name) for name in ("dem", "ground", "ortho", "mask") if name in document
            }
            document["layers"] = [single] if single else []
        return _assemble(path.name, path, TERRAINS.from_document(document, str(description)))
    entries = _by_names(path)
    if not entries:
        for mesh in sorted(path.iterdir()):
            if mesh.suffix.lower() in MESHES:
                return load_terrain(mesh)
        raise TerrainFormatError(
            f"folder {path} holds no terrain: neither terrain.json nor a DEM (dem_*.tif) nor a mesh"
        )
    credit = path.parent / "CREDITS"
    credits = credit.read_text().strip() if credit.is_file() else ""
    return _assemble(path.name, path, TerrainFile(layers=entries, credits=credits))


def _by_names(folder: Path) -> tuple[LayerFiles, ...]:
    """Return layers from the file names of a folder, in no order."""
    files = sorted(p.name for p in folder.iterdir() if p.is_file())
    dems = [f for f in files if re.match(r"dem.*\.tiff?$", f, re.IGNORECASE)]
    if not dems:
        dems = [f for f in files if f.lower().endswith((".tif", ".tiff"))][:1]
    entries = []
    for dem in dems:
        entry = {"dem": dem}
        size = re.search(r"_(\d+(?:\.\d+)?m)(?:_|\.)", dem)
        for kind in ("ortho", "mask"):
            for name in files:
                if kind in name and Path(name).suffix.lower() in _IMAGES and name != dem:
                    same = re.search(r"_(\d+(?:\.\d+)?m)(?:_|\.)", name)
                    if (same and size and same.group(1) == size.group(1)) or (not same and len(dems) == 1):
                        entry[kind] = name
                        break
        entries.append(LayerFiles(**entry))
    return tuple(entries)


def _assemble(name: str, folder: Path, described: TerrainFile) -> Terrain:
    digest = hashlib.sha256()
    read: list[tuple[HeightLayer, LayerFiles, Dem]] = []
    shift: tuple[float, float] | None = None
    origin = dict(described.origin)
    onto: CRS | None = None
    for entry in described.layers:
        dem = read_dem(inside(folder, entry.dem), onto)
        if shift is None:
            onto = dem.crs
            shift = _site_shift(dem)
            origin.update(_place_of(dem, shift))
        ground, sigma = (
            _same_grid(folder, other, entry.dem, dem, onto) if other else None
            for other in (entry.ground, entry.sigma)
        )
        mask = _read_mask(inside(folder, entry.mask), dem) if entry.mask else None
        digest.update(dem.heights.tobytes())
        layer = HeightLayer(
            dem.heights,
            dem.west - shift[0],
            dem.south - shift[1],
            dem.spacing,
            ground,
            mask,
            Path(entry.dem).stem,
            sigma,
        )
        read.append((layer, entry, dem))
    read.sort(key=lambda item: item[0].spacing)
    orthos = []
    for layer, entry, dem in read:
        if entry.ortho:
            image = inside(folder, entry.ortho)
            if not image.is_file():
                raise TerrainFormatError(f"ortho image {image} does not exist")
            orthos.append(_ortho(image, layer, dem, shift or (0.0, 0.0)))
            digest.update(image.read_bytes())
    rocks: tuple[Rock, ...] = ()
    if described.rocks:
        named = inside(folder, described.rocks)
        listing = read_object(named, TerrainFormatError)
        rocks = ROCKS.from_document(listing, str(named)).rocks
        digest.update(json.dumps(listing, sort_keys=True).encode())
    pictures = panorama_files(folder, described.panorama) if described.panorama else ()
    for file in pictures:
        digest.update(file.read_bytes())
    return Terrain(
        described.name or name,
        tuple(layer for layer, _, _ in read),
        tuple(orthos),
        rocks,
        described.credits,
        origin,
        digest.hexdigest(),
        pictures,
        described.surface,
    )


def _same_grid(folder: Path, name: str, of: str, dem: Dem, onto: CRS | None) -> NDArray[np.float32]:
    """Return another raster of a layer, which must have the posts of its DEM `of`."""
    found = read_dem(inside(folder, name), onto)
    if found.heights.shape != dem.heights.shape or not np.allclose(found.place, dem.place):
        raise TerrainFormatError(
            f"{name} has another grid than {of}: {found.heights.shape} posts at {found.place}"
        )
    return found.heights


def _site_shift(dem: Dem) -> tuple[float, float]:
    """Return where the site frame starts in a DEM's projection.

    A map projection counts from far away: the site frame then starts in the middle of the first DEM. A DEM
    in degrees has a projection round its middle.
    """
    if _in_degrees(dem) or max(abs(dem.west), abs(dem.south)) <= FAR_M:
        return 0.0, 0.0
    rows, columns = dem.heights.shape
    return dem.west + (columns - 1) * dem.spacing / 2, dem.south + (rows - 1) * dem.spacing / 2


def _place_of(dem: Dem, shift: tuple[float, float]) -> Document:
    """Return what a terrain's `origin` says of a DEM: its reference, and where the site starts in it."""
    far = {"east_m": shift[0], "north_m": shift[1]} if any(shift) else {}
    if dem.crs is None:
        return far
    crs, (x, y) = dem.crs, shift
    if dem.source is not None and dem.source.crs is not None and _in_degrees(dem):
        crs, (x, y) = dem.source.crs, dem.source.middle()
    return {**far, "crs": crs_text(crs), "x": x, "y": y}


def _in_degrees(dem: Dem) -> bool:
    """Return whether a DEM's file counts in degrees."""
    return dem.source is not None and dem.source.crs is not None and bool(dem.source.crs.is_geographic)


def _read_mask(path: Path, dem: Dem) -> NDArray[np.bool_]:
    with opened_image(path, "mask") as image:
        data = np.asarray(image.convert("L")) > 127
    shape = (dem.heights if dem.source is None else dem.source.heights).shape
    if data.shape != shape:
        raise TerrainFormatError(f"mask {path} has {data.shape} pixels; its DEM has {shape} posts")
    return np.ascontiguousarray(data[::-1]) if dem.source is None else mask_on_dem(data, dem)


def _ortho(image: Path, layer: HeightLayer, dem: Dem, shift: tuple[float, float]) -> Ortho:
    """Return the ortho image of a layer; unless it is reprojected, its pixels are read at first use."""
    world = _world_file(image)
    pixels = image_on_dem(image, dem, world)
    if pixels is not None:
        return Ortho(layer.bounds, pixels=pixels)
    with opened_image(image, "ortho image") as opened:
        columns, rows = opened.size
    if world is None:
        return Ortho(layer.bounds, path=image)
    west, north = world.c - shift[0], world.f - shift[1]
    return Ortho((west, north + rows * world.e, west + columns * world.a, north), path=image)


def _world_file(image: Path) -> Affine | None:
    """Return the transform of the world file beside an image, from the outer corner of its first pixel."""
    from affine import Affine

    for suffix in (image.suffix[:2] + image.suffix[-1:] + "w", image.suffix + "w", ".wld"):
        world = image.with_suffix(suffix)
        if world.is_file():
            try:
                a, d, b, e, c, f = (float(v) for v in world.read_text().split())
            except ValueError as err:
                raise TerrainFormatError(f"world file {world}: six numbers are needed") from err
            if b or d or a <= 0 or e >= 0:
                raise TerrainFormatError(f"world file {world}: the image must be north up")
            return Affine(a, 0.0, c - a / 2, 0.0, e, f - e / 2)
    return None


def write_terrain(terrain: Terrain, folder: Path | str) -> Path:
    """Write a terrain as a `terrain/1` folder and return the folder; reading it back gives an equal terrain.

    Heights are rounded to 1 mm. Ortho images are PNG, kept as they are when they come from a file. What was
    in the folder stays as it was if not all can be written (`OSError`, of the folder at least).
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    try:
        with TemporaryDirectory(prefix=".part-", dir=folder) as part:
            _write_files(terrain, Path(part))
            for file in sorted(Path(part).iterdir(), key=lambda one: one.name == "terrain.json"):
                file.replace(folder / file.name)
    except OSError as err:
        if err.filename is not None or err.errno is None:
            raise
        raise OSError(err.errno, err.strerror, str(folder)) from err
    return folder


def _write_files(terrain: Terrain, folder: Path) -> None:
    from affine import Affine
    from PIL import Image
    from rasterio.io import MemoryFile

    entries: list[LayerFiles] = []
    for layer in terrain.layers:
        tag = f"{layer.heights.shape[1] * layer.spacing:g}m"
        west, _, _, north = layer.bounds
        entry: dict[str, str] = {}
        for kind, data in (("dem", layer.heights), ("ground", layer.ground), ("sigma", layer.sigma)):
            if data is None or (kind == "ground" and not terrain.rocks):
                continue
            name = f"{kind}_{tag}.tif"
            # by way of memory: GDAL closes a file that a full disk cut short without a word
            with MemoryFile() as raster:
                with raster.open(
                    driver="GTiff",
                    height=data.shape[0],
                    width=data.shape[1],
                    count=1,
                    dtype="float32",
                    nodata=math.nan,
                    transform=Affine(layer.spacing, 0.0, west, 0.0, -layer.spacing, north),
                    compress="deflate",
                    predictor=3,
                    zlevel=4,
                ) as dataset:
                    dataset.write(np.round(data[::-1].astype(np.float64), 3).astype(np.float32), 1)
                (folder / name).write_bytes(raster.read())
            entry[kind] = name
        ortho = next((o for o in terrain.orthos if np.allclose(o.bounds, layer.bounds, atol=1e-6)), None)
        if ortho is not None:
            if ortho.path is not None:
                entry["ortho"] = f"ortho_{tag}{ortho.path.suffix}"
                (folder / entry["ortho"]).write_bytes(ortho.path.read_bytes())
            else:
                entry["ortho"] = f"ortho_{tag}.png"
                Image.fromarray(ortho.rgb).save(folder / entry["ortho"], compress_level=2)
        if layer.mask is not None:
            entry["mask"] = f"mask_{tag}.png"
            Image.fromarray((layer.mask[::-1] * np.uint8(255)).astype(np.uint8)).convert("1").save(
                folder / entry["mask"]
            )
        entries.append(LayerFiles(**entry))
    described = TerrainFile(
        terrain.name,
        terrain.credits,
        terrain.origin,
        tuple(entries),
        "rocks.json" if terrain.rocks else None,
        copied_panorama(terrain.panorama, folder),
        terrain.surface,
    )
    if terrain.rocks:
        (folder / "rocks.json").write_text(rocks_text(terrain.rocks), encoding="utf-8")
    (folder / "terrain.json").write_text(TERRAINS.write(described, indent=1) + "\n", encoding="utf-8")
