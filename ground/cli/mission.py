"""`outcrop mission ...`: missions from the command line."""

from __future__ import annotations

from pathlib import Path

import typer

from ground.cli.failure import refusals
from ground.cli.mission_group.versions import register_versions
from ground.cli.resources import group_of


def register(app: typer.Typer) -> None:
    group = group_of(app, "mission")
    register_versions(group)

    @group.command("load-demo")
    def load_demo_command(
        terrain: Path | None = typer.Option(None, help="terrain folder instead of the generated one"),
        seed: int = typer.Option(7, min=0, help="seed of terrain and targets"),
        name: str = typer.Option("Demo", help="name of the mission"),
    ) -> None:
        """File the demo mission unless it is there. Needs no server."""
        from ground.cli.repository import open_or_fail
        from ground.records.actor import SYSTEM_ACTOR
        from ground.resources.mission_setup.load_demo import load_demo

        with refusals():
            mission, new = load_demo(open_or_fail(), SYSTEM_ACTOR, name=name, terrain=terrain, seed=seed)
        count = mission.counts
        word = "filed" if new else "is there"
        typer.echo(
            f"mission {mission.id} {mission.name!r} {word}: {count.targets} targets, "
            f"{count.observation_requests} observation requests"
        )

    @group.command("calibrate")
    def calibrate_command(
        mission: str = typer.Argument(...),
        runs: list[Path] = typer.Argument(
            None, help="run folders on the mission's terrain; its own runs when none are given"
        ),
        name: str = typer.Option("", help="name of the calibration"),
        out: Path | None = typer.Option(
            None, help="file to write the calibration to as well (calibration/1)"
        ),
    ) -> None:
        """Learn lost tracks, times and energies of drives from recorded runs. Needs no server."""
        import json

        from ground.cli.repository import open_or_fail
        from ground.records.actor import SYSTEM_ACTOR
        from ground.resources.calibrations.calibrate_from_folders import calibrate_from_folders

        repo = open_or_fail()
        with refusals():
            done = calibrate_from_folders(repo, SYSTEM_ACTOR, mission, runs or (), name=name)
        found = done.calibration or {}
        if out is not None:
            out.write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")
        typer.echo(
            f"{found['name']}: {found['legs']} legs, {found['losses']} of {found['tracks']} tracks lost; "
            f"a leg takes {found['fixed_s']:.0f} s and {found['drive_factor']:.1f} times its driving time"
        )
        for where in ("inside", "outside", "occluded"):
            rate, error = found[f"{where}_per_m"], found[f"{where}_se_per_m"]
            spread = f"+- {error:.4f}" if error else "(not seen in the runs)"
            typer.echo(f"  {where:9s} {rate:.4f} lost tracks per metre {spread}")

    @group.command("export")
    def export_command(
        mission: str = typer.Argument(...), target: Path = typer.Argument(..., help="zip to write")
    ) -> None:
        """Write a whole mission into one archive. Needs no server."""
        from ground.cli.repository import open_or_fail
        from ground.records.actor import SYSTEM_ACTOR
        from ground.resources.mission_archives.mission_archive import export_mission

        with refusals():
            export_mission(open_or_fail(), SYSTEM_ACTOR, mission, target)
        typer.echo(f"{target}: {target.stat().st_size} bytes")

    @group.command("import")
    def import_command(source: Path = typer.Argument(..., help="archive of a mission")) -> None:
        """Take in the archive of a mission. Needs no server."""
        from ground.cli.repository import open_or_fail
        from ground.records.actor import SYSTEM_ACTOR
        from ground.resources.mission_archives.import_mission import import_mission

        with refusals():
            mission = import_mission(open_or_fail(), SYSTEM_ACTOR, source)
        typer.echo(f"{mission.id} {mission.name}")
