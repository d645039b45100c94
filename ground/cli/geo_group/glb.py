"""`outcrop terrain glb`: a terrain as a glTF model for viewers."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ground.cli.failure import fail, refusals

if TYPE_CHECKING:
    from neighbours.geodata.glb import Texture
    from rover_iface.terrain import Terrain
    from rover_iface.terrain.grid import HeightLayer


def glb(
    path: Annotated[Path, typer.Argument(help="terrain folder, GeoTIFF or mesh")],
    out: Annotated[Path, typer.Argument(help="GLB to write")],
    layer: Annotated[int, typer.Option(min=0, help="0 is the finest")] = 0,
    most_triangles: Annotated[int, typer.Option(help="posts are thinned to at most so many")] = 500_000,
    texture_px: Annotated[int, typer.Option(min=16, max=16384, help="longest side of the image")] = 4096,
    place: Annotated[
        str | None, typer.Option(help="the site's place as JSON; else what the terrain tells")
    ] = None,
) -> None:
    """Write a terrain as binary glTF with its ortho image; says how far the model is from the heights."""
    from neighbours.geodata.glb import terrain_glb
    from rover_iface.terrain import load_terrain

    with refusals():
        ground = load_terrain(path)
        if layer >= len(ground.layers):
            fail(f"--layer is {layer}; the terrain has {len(ground.layers)}")
        found = ground.layers[layer]
        made = terrain_glb(
            found.heights,
            found.west,
            found.south,
            found.spacing,
            most_triangles=most_triangles,
            texture=_texture(ground, found, texture_px),
            extras={"outcrop": _about(ground, place)},
        )
        out.write_bytes(made.content)
    typer.echo(
        f"{out}: {len(made.content)} bytes, {made.triangles} triangles, every {made.step}. post; "
        f"heights are off by at most {made.largest_error_m:.3f} m (rms {made.rms_error_m:.3f} m)"
        + (f"; {made.left_out} known posts beside holes are left out" if made.left_out else "")
    )


def _about(ground: Terrain, place: str | None) -> dict[str, object]:
    """Return what the model says of its origin."""
    told: object = dict(ground.origin)
    if place is not None:
        try:
            told = json.loads(place)
        except ValueError as err:
            fail(f"--place is not JSON: {err}")
    return {
        "name": ground.name,
        "credits": ground.credits,
        "sha256": ground.sha256,
        "axes": "x east, y up, z south; metres from the origin of the site",
        "place": told,
    }


def _texture(ground: Terrain, layer: HeightLayer, longest: int) -> Texture | None:
    """Return the finest ortho image that covers the layer, scaled down to `longest` pixels, as PNG."""
    import io

    from PIL import Image

    from neighbours.geodata.glb import Texture

    west, south, east, north = layer.bounds
    slack = layer.spacing
    for ortho in ground.orthos:
        w, s, e, n = ortho.bounds
        if w <= west + slack and s <= south + slack and e >= east - slack and n >= north - slack:
            image = Image.fromarray(ortho.rgb)
            image.thumbnail((longest, longest))
            stream = io.BytesIO()
            image.save(stream, "PNG")
            return Texture(stream.getvalue(), "image/png", ortho.bounds)
    return None
