"""`outcrop run import`: what a robot recorded while a plan was driven."""

from __future__ import annotations

from pathlib import Path

import typer

from ground.cli.failure import refusals


def import_(
    recording: Path = typer.Argument(..., help="rosbag2 folder, .db3 or .mcap file"),
    plan: str = typer.Option(..., help="id of the plan that was driven"),
    mapping: Path | None = typer.Option(None, help="TOML: which topics mean what; default by their types"),
    actor: str = typer.Option("Operator", "--as", help="who does it"),
) -> None:
    """Take in a recorded traverse as a run made elsewhere (extra `mcap`). Needs no server.

    What is left out, cut, late or missing is said line by line.
    """
    from ground.cli.repository import actor_or_fail, open_or_fail
    from ground.resources.downlinks.import_recording import import_recording
    from neighbours.robots.recording import Mapping, read_mapping

    with refusals():
        chosen = Mapping() if mapping is None else read_mapping(mapping)
        repo = open_or_fail()
        run, read = import_recording(repo, actor_or_fail(repo, actor), plan, recording, chosen)
    for finding in read.findings:
        typer.echo(f"outcrop: {finding}", err=True)
    whole = "" if read.whole else ", as far as it is whole"
    counts = f"{len(read.poses)} poses, {read.pictures} pictures, {len(read.battery)} battery levels"
    typer.echo(f"run {run.id}: {counts}{whole}")
