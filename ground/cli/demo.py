"""`outcrop demo`: a whole day without a server."""

from __future__ import annotations

from pathlib import Path

import typer

from ground.cli.failure import fail


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("demo")(demo)


def demo(
    terrain: Path | None = typer.Option(None, help="Folder of a terrain; one is generated when absent."),
    seed: int = typer.Option(1, min=0, help="Chooses terrain, targets and what the rover meets."),
    out: Path = typer.Option(Path("outcrop-demo"), help="Folder for the artefacts."),
    rover: str = typer.Option("abstract", help="Simulated rover that flies the plan, or one of your own."),
    tracker: str = typer.Option(
        "", help="Tracker of that rover, when not its own: klt, ncc, ncc-narrow, sift, ..."
    ),
    time_limit: float = typer.Option(30.0, min=0.1, help="Seconds the planner may take."),
) -> None:
    """Run a whole day: terrain, targets, plan, dry run with a lost track, products. Needs no server."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn

    from executive.errors import ExecutiveError
    from ground.demo.day import run_day, summary_lines
    from ground.errors import GroundError
    from planner.errors import PlannerError
    from rover_iface.errors import RoverError

    console = Console()
    columns = (TextColumn("{task.description:<34}"), BarColumn(), TimeElapsedColumn())
    try:
        with Progress(*columns, console=console, transient=False) as bars:
            tasks: dict[str, TaskID] = {}

            def report(stage: str, share: float) -> None:
                if stage not in tasks:
                    tasks[stage] = bars.add_task(stage, total=1.0)
                bars.update(tasks[stage], completed=share)

            day = run_day(
                terrain,
                seed=seed,
                out=out,
                time_limit_s=time_limit,
                rover=rover,
                tracker=tracker,
                report=report,
            )
    except (GroundError, PlannerError, RoverError, ExecutiveError) as err:
        fail(str(err))
    except OSError as err:
        fail(f"{err.filename or out}: {err.strerror or err}")
    for line in summary_lines(day):
        typer.echo(line)
