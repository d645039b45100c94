"""Commands about terrain: generate, import, look at, ask."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ground.cli.failure import fail, refusals
from ground.cli.geo_group.from_images import from_images
from ground.cli.geo_group.glb import glb
from ground.cli.geo_group.new_terrain import Replace, refuse_over

terrain = typer.Typer(name="terrain", help="Make, import and look at terrain.", no_args_is_help=True)


def register(app: typer.Typer) -> None:
    """Add the group to the program."""
    app.add_typer(terrain)
    terrain.command()(glb)
    terrain.command("from-images")(from_images)


@terrain.command()
def generate(
    out: Annotated[Path, typer.Option(help="folder to write (form terrain/1)")],
    seed: Annotated[int, typer.Option(help="same seed, same terrain")] = 1,
    size: Annotated[float, typer.Option(help="width in metres")] = 128.0,
    rock_cover: Annotated[float, typer.Option(help="share of ground under rocks")] = 0.05,
    crater: Annotated[bool, typer.Option(help="with a crater")] = True,
    outcrop: Annotated[bool, typer.Option(help="with an outcrop of slabs")] = True,
    ripples: Annotated[bool, typer.Option(help="with sand ripples")] = True,
    tracks: Annotated[bool, typer.Option(help="with the tracks of an earlier drive to the start")] = False,
    geology: Annotated[
        str | None, typer.Option(help="rocks, bedrock and sand of gusev, meridiani, gale or jezero")
    ] = None,
    replace: Replace = False,
) -> None:
    """Generate a terrain from a seed."""
    from rover_iface.terrain import Recipe, generate_terrain, geology_named, write_terrain

    refuse_over(out, replace)
    with refusals():
        made = generate_terrain(
            recipe=Recipe(
                seed=seed,
                size_m=size,
                inner_m=min(32.0, size),
                rock_cover=rock_cover,
                crater=crater,
                outcrop=outcrop,
                ripples=ripples,
                tracks=tracks,
                geology=None if geology is None else geology_named(geology),
            )
        )
        write_terrain(made, out)
    typer.echo(f"{out}: {size:g} m, {len(made.rocks)} rocks, sha256 {made.sha256[:16]}")


@terrain.command("import")
def import_mesh(
    mesh: Annotated[Path, typer.Argument(help="GLB, glTF, OBJ or PLY")],
    out: Annotated[Path, typer.Option(help="folder to write (form terrain/1)")],
    axes: Annotated[str | None, typer.Option(help="mesh axes pointing east, north, up, e.g. x-zy")] = None,
    scale: Annotated[float, typer.Option(help="metres per mesh unit")] = 1.0,
    spacing: Annotated[float | None, typer.Option(help="metres between posts")] = None,
    radius: Annotated[float | None, typer.Option(help="half width to keep, metres")] = None,
    skip: Annotated[list[str] | None, typer.Option(help="node to leave out")] = None,
    allow_holes: Annotated[bool, typer.Option(help="take a mesh with holes")] = False,
    replace: Replace = False,
) -> None:
    """Make a terrain folder from a mesh."""
    from rover_iface.terrain import write_terrain
    from rover_iface.terrain.mesh import load_mesh_terrain

    refuse_over(out, replace)
    with refusals():
        made = load_mesh_terrain(
            mesh,
            axes=axes,
            scale=scale,
            spacing_m=spacing,
            skip=tuple(skip or ()),
            radius_m=radius,
            allow_holes=allow_holes,
        )
        write_terrain(made, out)
    layer = made.layers[0]
    typer.echo(f"{out}: {layer.heights.shape[1]} x {layer.heights.shape[0]} posts of {layer.spacing:g} m")


@terrain.command()
def info(path: Annotated[Path, typer.Argument(help="terrain folder, GeoTIFF or mesh")]) -> None:
    """Say what a terrain is."""
    import numpy as np

    from rover_iface.terrain import load_terrain

    with refusals():
        ground = load_terrain(path)
    west, south, east, north = ground.bounds
    typer.echo(f"name     {ground.name}")
    typer.echo(f"extent   ({west:g}, {south:g}) to ({east:g}, {north:g}) m, east and north of the origin")
    for layer in ground.layers:
        rows, columns = layer.heights.shape
        low, high = float(np.nanmin(layer.heights)), float(np.nanmax(layer.heights))
        seen = "" if layer.mask is None else f", {100 * float(layer.mask.mean()):.0f} % seen in colour"
        typer.echo(
            f"layer    {columns} x {rows} posts of {layer.spacing:g} m, "
            f"heights {low:.2f} to {high:.2f} m{seen}"
        )
    for ortho in ground.orthos:
        rows, columns = ortho.rgb.shape[:2]
        typer.echo(f"ortho    {columns} x {rows} pixels of {100 * ortho.spacing:.2g} cm")
    x = np.linspace(max(west, -16), min(east, 16), 60)
    grid = np.meshgrid(x, np.linspace(max(south, -16), min(north, 16), 60))
    slope = np.degrees(ground.slope(*grid))
    typer.echo(
        f"slope    median {np.nanmedian(slope):.1f}, 95 % below {np.nanpercentile(slope, 95):.1f} degrees "
        "(over 1 m, middle 32 m)"
    )
    typer.echo(f"rocks    {len(ground.rocks)} with known shape")
    typer.echo(f"sha256   {ground.sha256}")
    if ground.credits:
        typer.echo(f"credits  {ground.credits}")


@terrain.command()
def query(
    path: Annotated[Path, typer.Argument(help="terrain folder, GeoTIFF or mesh")],
    east: Annotated[float, typer.Argument(help="metres east")],
    north: Annotated[float, typer.Argument(help="metres north; after -- when negative")],
) -> None:
    """Tell height, slope and roughness of a place."""
    import math

    from rover_iface.terrain import load_terrain

    with refusals():
        ground = load_terrain(path)
        height = ground.height_at(east, north)
    normal = ground.normal(east, north)
    sigma = float(ground.sigma(east, north))
    known = "" if math.isnan(sigma) else f", known to {100 * sigma:.1f} cm"
    typer.echo(f"height     {height:.3f} m{known}")
    typer.echo(f"normal     {normal[0]:.3f} {normal[1]:.3f} {normal[2]:.3f}")
    typer.echo(f"slope      {math.degrees(float(ground.slope(east, north))):.1f} degrees over 1 m")
    typer.echo(f"roughness  {100 * float(ground.roughness(east, north)):.1f} cm over 1 m")
    nearest = ground.nearest_rock(east, north)
    if nearest is not None:
        rock, distance = nearest
        typer.echo(f"rock       {rock.id}, {rock.diameter:.2f} m wide, {distance:.2f} m away")


@terrain.command()
def picture(
    path: Annotated[Path, typer.Argument(help="terrain folder, GeoTIFF or mesh")],
    out: Annotated[Path, typer.Option(help="PNG to write")],
    pixels: Annotated[int, typer.Option(help="width of the picture")] = 1024,
    east: Annotated[float, typer.Option(help="middle, metres east")] = 0.0,
    north: Annotated[float, typer.Option(help="middle, metres north")] = 0.0,
    size: Annotated[float, typer.Option(help="width of the area, metres")] = 32.0,
) -> None:
    """Write the ortho image of an area as PNG."""
    from PIL import Image

    from rover_iface.errors import TerrainError
    from rover_iface.terrain import load_terrain

    try:
        ground = load_terrain(path)
        ground.require_inside(east, north)
        if not ground.orthos:
            raise TerrainError(f'terrain "{ground.name}" has no ortho image')
        half = size / 2
        fits = [
            o
            for o in ground.orthos
            if o.bounds[0] <= east - half + 1e-9
            and o.bounds[1] <= north - half + 1e-9
            and o.bounds[2] >= east + half - 1e-9
            and o.bounds[3] >= north + half - 1e-9
        ]
        ortho = fits[0] if fits else ground.orthos[-1]
        Image.fromarray(ortho.crop(east, north, size, pixels)).save(out)
    except (TerrainError, OSError, ValueError) as err:
        fail(str(err))
    typer.echo(str(out))
