"""Terrain on disk: the folder form `terrain/1`, folders of rasters by name, single GeoTIFFs, meshes.

`terrain/1` is a folder with `terrain.json`::

    {"format": "terrain/1", "name": ..., "credits": ..., "origin": {...},
     "layers": [{"dem": "dem_32m.tif", "ground": "ground_32m.tif", "ortho": "ortho_32m.png",
                 "mask": "mask_32m.png"}],
     "rocks": "rocks.json"}

Every member of a layer but `dem` may be absent; a single layer may be given by the members `dem`, `ortho`
and `mask`
of the document itself. An ortho image has the extent of its DEM unless a world file lies beside it. A folder
without `terrain.json` is read by its names: `dem_<size>*.tif` with `ortho_<size>*` and `*mask_<size>*`.
"""

from __future__ import annotations

import hashlib
import json
import math
import re
import warnings
from dataclasses import field
from pathlib import Path
from typing import Annotated

import numpy as np
from annotated_types import MinLen
from numpy.typing import NDArray

from mission.codec import Codec, Document, read_object
from mission.values import reads_over, value
from rover_iface.errors import TerrainFormatError
from rover_iface.terrain.grid import Bounds, HeightLayer, Ortho
from rover_iface.terrain.mesh import MESHES, load_mesh_terrain
from rover_iface.terrain.outside import inside, opened_image, require_size
from rover_iface.terrain.rocks import ROCKS, Rock, RockList
from rover_iface.terrain.terrain import Terrain


@reads_over
@value
class LayerFiles:
    """Files of one raster of heights, in the terrain's folder."""

    dem: str
    ground: str | None = None
    ortho: str | None = None
    mask: str | None = None


@reads_over
@value
class TerrainFile:
    """What a `terrain/1` document holds; `origin` is where the site frame lies, as its author counts."""

    name: str = ""
    credits: str = ""
    origin: Document = field(default_factory=dict)
    layers: Annotated[tuple[LayerFiles, ...], MinLen(1)] = ()
    rocks: str | None = None


TERRAINS = Codec(TerrainFile, "terrain/1", "terrain", error=TerrainFormatError)

_IMAGES = {".png", ".jpg", ".jpeg", ".tif", ".tiff"}


def load_terrain(path: Path | str) -> Terrain:
    """Return the terrain of a folder, a GeoTIFF or a mesh file.

    Raises
    ------
    TerrainFormatError
        If there is no DEM, it has no georeference, is not in metres, or a file is missing or malformed.
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
    read: list[tuple[HeightLayer, LayerFiles]] = []
    shift: tuple[float, float] | None = None
    origin = dict(described.origin)
    for entry in described.layers:
        heights, west, south, spacing = read_dem(inside(folder, entry.dem))
        if shift is None:
            # A map projection counts from far away: the site frame then starts in the middle of the first
            # DEM.
            far = max(abs(west), abs(south)) > 20_000
            middle = (
                west + heights.shape[1] * spacing / 2 - spacing / 2,
                south + heights.shape[0] * spacing / 2 - spacing / 2,
            )
            shift = middle if far else (0.0, 0.0)
            if far:
                origin.update({"east_m": middle[0], "north_m": middle[1]})
        ground = None
        if entry.ground:
            ground, *place = read_dem(inside(folder, entry.ground))
            if ground.shape != heights.shape or not np.allclose(place, (west, south, spacing)):
                raise TerrainFormatError(
                    f"{entry.ground} has another grid than {entry.dem}: {ground.shape} posts at {place}"
                )
        mask = _read_mask(inside(folder, entry.mask), heights.shape) if entry.mask else None
        digest.update(heights.tobytes())
        layer = HeightLayer(
            heights, west - shift[0], south - shift[1], spacing, ground, mask, Path(entry.dem).stem
        )
        read.append((layer, entry))
    read.sort(key=lambda item: item[0].spacing)
    orthos = []
    for layer, entry in read:
        if entry.ortho:
            image = inside(folder, entry.ortho)
            if not image.is_file():
                raise TerrainFormatError(f"ortho image {image} does not exist")
            with opened_image(image, "ortho image"):
                pass  # its pixels are read when somebody looks at them
            orthos.append(Ortho(_ortho_bounds(image, layer, shift or (0.0, 0.0)), path=image))
            digest.update(image.read_bytes())
    rocks: tuple[Rock, ...] = ()
    if described.rocks:
        named = inside(folder, described.rocks)
        listing = read_object(named, TerrainFormatError)
        rocks = ROCKS.from_document(listing, str(named)).rocks
        digest.update(json.dumps(listing, sort_keys=True).encode())
    return Terrain(
        described.name or name,
        tuple(layer for layer, _ in read),
        tuple(orthos),
        rocks,
        described.credits,
        origin,
        digest.hexdigest(),
    )


def read_dem(path: Path) -> tuple[NDArray[np.float32], float, float, float]:
    """Return heights [rows, columns] (row 0 south, NaN = unknown), west and south of the first post, spacing.

    Raises
    ------
    TerrainFormatError
        If the file is no raster, has no geotransform, is rotated, has oblong posts, degrees for metres or no
        known height.
    """
    import rasterio
    from rasterio.errors import NotGeoreferencedWarning, RasterioError

    if not path.is_file():
        raise TerrainFormatError(f"DEM {path} does not exist")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        try:
            with rasterio.open(path, driver="GTiff") as dataset:  # others may name files elsewhere
                require_size(f"DEM {path}", dataset.width, dataset.height)
                transform = dataset.transform
                crs = dataset.crs
                band = dataset.read(1, masked=True)
                unit = (dataset.units[0] or "").lower() if dataset.units else ""
        except (RasterioError, ValueError) as err:
            raise TerrainFormatError(f"DEM {path}: {err}") from err
    if transform.is_identity:
        raise TerrainFormatError(
            f"DEM {path} has no georeference: a geotransform (GeoTIFF tags or world file) in metres is needed"
        )
    if abs(transform.b) > 1e-9 or abs(transform.d) > 1e-9:
        raise TerrainFormatError(
            f"DEM {path} is rotated (b {transform.b:g}, d {transform.d:g}); north must be up"
        )
    step_x, step_y = transform.a, -transform.e
    if not step_x > 0 or abs(step_x - abs(step_y)) > 1e-6 * step_x:
        raise TerrainFormatError(f"DEM {path} has posts of {step_x:g} by {step_y:g}; they must be square")
    if crs is not None and crs.is_geographic:
        raise TerrainFormatError(
            f"DEM {path} counts in degrees ({step_x:g} a post), not in metres; project it first"
        )
    if crs is not None and crs.is_projected:
        factor = float(crs.linear_units_factor[1])
        if abs(factor - 1) > 1e-6:
            raise TerrainFormatError(f"DEM {path} counts in {crs.linear_units}, not in metres")
    if unit in {"ft", "feet", "foot", "us survey foot", "km", "kilometre", "kilometer"}:
        raise TerrainFormatError(f'DEM {path} gives heights in "{unit}", not in metres')
    heights = np.ma.filled(band.astype(np.float32), np.nan)
    if step_y > 0:
        heights = heights[::-1]
        south = transform.f - (heights.shape[0] - 0.5) * step_x
    else:
        south = transform.f + 0.5 * step_x
    if not np.isfinite(heights).any():
        raise TerrainFormatError(f"DEM {path} holds no known height")
    return np.ascontiguousarray(heights), float(transform.c + 0.5 * step_x), float(south), float(step_x)


def _read_mask(path: Path, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    with opened_image(path, "mask") as image:
        data = np.asarray(image.convert("L")) > 127
    if data.shape != shape:
        raise TerrainFormatError(f"mask {path} has {data.shape} pixels; its DEM has {shape} posts")
    return np.ascontiguousarray(data[::-1])


def _ortho_bounds(image: Path, layer: HeightLayer, shift: tuple[float, float]) -> Bounds:
    for suffix in (image.suffix[:2] + image.suffix[-1:] + "w", image.suffix + "w", ".wld"):
        world = image.with_suffix(suffix)
        if world.is_file():
            try:
                a, d, b, e, c, f = (float(v) for v in world.read_text().split())
            except ValueError as err:
                raise TerrainFormatError(f"world file {world}: six numbers are needed") from err
            if b or d or a <= 0 or e >= 0:
                raise TerrainFormatError(f"world file {world}: the image must be north up")
            with opened_image(image, "ortho image") as opened:
                columns, rows = opened.size
            west, north = c - a / 2 - shift[0], f - e / 2 - shift[1]
            return west, north + rows * e, west + columns * a, north
    return layer.bounds


def write_terrain(terrain: Terrain, folder: Path | str) -> Path:
    """Write a terrain as a `terrain/1` folder and return the folder; reading it back gives an equal terrain.

    Heights are rounded to 1 mm. Ortho images are PNG, kept as they are when they come from a file.
    """
    import rasterio
    from affine import Affine
    from PIL import Image

    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    entries: list[LayerFiles] = []
    for layer in terrain.layers:
        tag = f"{layer.heights.shape[1] * layer.spacing:g}m"
        west, _, _, north = layer.bounds
        entry: dict[str, str] = {}
        for kind, data in (("dem", layer.heights), ("ground", layer.ground)):
            if data is None or (kind == "ground" and not terrain.rocks):
                continue
            name = f"{kind}_{tag}.tif"
            with rasterio.open(
                folder / name,
                "w",
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
        terrain.name, terrain.credits, terrain.origin, tuple(entries), "rocks.json" if terrain.rocks else None
    )
    if terrain.rocks:
        listing = ROCKS.document(RockList(terrain.rocks))
        (folder / "rocks.json").write_text(
            json.dumps(listing, separators=(",", ":")) + "\n", encoding="utf-8"
        )
    (folder / "terrain.json").write_text(TERRAINS.write(described, indent=1) + "\n", encoding="utf-8")
    return folder
