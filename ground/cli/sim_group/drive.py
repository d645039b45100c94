"""`outcrop sim drive`: the navigator at work."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from ground.cli.failure import refusals


def drive(
    x: Annotated[float, typer.Argument(help="goal, metres east")] = 8.0,
    y: Annotated[float, typer.Argument(help="goal, metres north; after -- when negative")] = 0.0,
    terrain: Annotated[Path | None, typer.Option(help="terrain folder; generated if absent")] = None,
    seed: Annotated[int, typer.Option(help="of the terrain and of all errors")] = 1,
    rover: Annotated[str, typer.Option(help="rover profile")] = "k9",
    rock_cover: Annotated[float, typer.Option(help="share of the generated terrain under rocks")] = 0.07,
    softer: Annotated[float, typer.Option(help="factor on the slip of the soil")] = 1.0,
    out: Annotated[Path | None, typer.Option(help="PNG: hazard map beside the path over the ground")] = None,
) -> None:
    """Drive from the origin to a goal by stereo ranges, with slip and drift."""
    import math

    import numpy as np

    from rover_iface.frames import Pose
    from rover_iface.navigation.navigator import Navigator
    from rover_iface.navigation.sensor import GroundRaster
    from rover_iface.profile import load_profile
    from rover_iface.simulator.chassis import Chassis
    from rover_iface.simulator.traverse import drive as traverse
    from rover_iface.terrain import generate_terrain, load_terrain

    with refusals():
        profile = load_profile(rover)
        ground = load_terrain(terrain) if terrain else generate_terrain(seed, rock_cover=rock_cover)
        ground.require_inside(x, y, "goal")
        raster = GroundRaster.of(ground, max(20.0, abs(x) + 8.0, abs(y) + 8.0))
        start = Pose(0.0, 0.0, 0.0, math.atan2(y, x))
        chassis = Chassis(raster, profile, start, softer=softer, rng=np.random.default_rng(seed))
        navigator = Navigator.fresh(profile, (0.0, 0.0), (x, y))
        went = traverse(chassis, raster, (x, y), navigator=navigator)
    typer.echo(f"{went.reason} after {went.looks} looks and {went.length_m:.1f} m")
    typer.echo(f"time    {went.duration_s / 60:.0f} min, energy {went.energy_j / 1000:.0f} kJ")
    typer.echo(f"error   {went.error_m:.2f} m from the goal, least clearance {100 * went.worst_gap_m:.0f} cm")
    if out is not None:
        _picture(out, ground, navigator, went.track, (x / 2, y / 2), max(12.0, math.hypot(x, y) + 4.0))
        typer.echo(str(out))
    if not went.arrived:
        raise typer.Exit(1)


def _picture(
    out: Path, ground: Any, navigator: Any, track: Any, middle: tuple[float, float], size_m: float
) -> None:
    from PIL import Image, ImageDraw

    pixels = 600
    halves = []
    if ground.orthos:
        fits = [o for o in ground.orthos if o.bounds[2] - o.bounds[0] >= 2 * size_m]
        ortho = (fits or list(ground.orthos))[0] if fits else ground.orthos[-1]
        halves.append(Image.fromarray(ortho.crop(*middle, size_m, pixels)))
    hazards = Image.fromarray(navigator.map.picture(size_m, middle)).resize((pixels, pixels), 0)
    halves.append(hazards)
    for image in halves:
        pen = ImageDraw.Draw(image)
        line = [
            (
                (px - middle[0] + size_m / 2) / size_m * pixels,
                (middle[1] + size_m / 2 - py) / size_m * pixels,
            )
            for px, py in track
        ]
        pen.line(line, fill=(90, 200, 255), width=3)
        sx, sy = line[0]
        pen.ellipse((sx - 5, sy - 5, sx + 5, sy + 5), outline=(255, 255, 255), width=2)
    whole = Image.new("RGB", (pixels * len(halves) + 8 * (len(halves) - 1), pixels), (255, 255, 255))
    for k, image in enumerate(halves):
        whole.paste(image, (k * (pixels + 8), 0))
    out.parent.mkdir(parents=True, exist_ok=True)
    whole.save(out)
