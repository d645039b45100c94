"""`outcrop target check`: advice on a target before it is asked for, without a server."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from ground.cli.failure import refusals
from ground.cli.resources import group_of


def register(app: typer.Typer) -> None:
    """Add the command to the group of targets."""
    group_of(app, "target").command("check")(check)


def check(
    east: Annotated[float, typer.Argument(help="of the target, metres")],
    north: Annotated[float, typer.Argument(help="of the target, metres; after -- when negative")],
    terrain: Annotated[Path | None, typer.Option(help="terrain folder; generated if absent")] = None,
    seed: Annotated[int, typer.Option(help="of the generated terrain", min=0)] = 1,
    rover: Annotated[str, typer.Option(help="rover profile")] = "k9",
    instrument: Annotated[str, typer.Option(help="its usual contact instrument if absent")] = "",
    start: Annotated[
        tuple[float, float, float],
        typer.Option(help="the rover's stand: east, north, heading (degrees)"),
    ] = (0.0, 0.0, 0.0),
) -> None:
    """Say before a day how far, in sight, known and reachable a target is. Advice only; exit status 0."""
    from ground.day.advice import target_advice
    from ground.demo.mission import target_at
    from mission import Pose
    from rover_iface.profile import load_profile
    from rover_iface.terrain import generate_terrain, load_terrain

    with refusals():
        ground = load_terrain(terrain) if terrain else generate_terrain(seed, ortho=False)
        ground.require_inside(east, north, "target")
        profile = load_profile(rover)
        target = target_at(ground, "T", "T", east, north)
        here = Pose(start[0], start[1], math.radians(start[2]))
        advice = target_advice(ground, profile, here, target, instrument=instrument)
    for line in advice.lines():
        typer.echo(line)
