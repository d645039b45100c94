"""`outcrop crl run`: scenarios against the scripted rover."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ground.cli.crl import dictionary_of
from ground.cli.failure import fail


def register(_app: typer.Typer) -> None:
    """Add the command to the group `crl`."""
    from ground.cli.crl import crl_app

    crl_app.command("run")(run)


def run(
    scenarios: Annotated[list[Path], typer.Argument(help="scenario files (JSON)", metavar="SCENARIO...")],
    trace_dir: Annotated[
        Path | None, typer.Option(help="folder for what came of each scenario, one file of the same name")
    ] = None,
    dictionary: Annotated[
        str | None,
        typer.Option(help="hold plans to a rover's dictionary: its name (outcrop-rover) or file"),
    ] = None,
) -> None:
    """Run scenarios; exit 0 iff every trace agrees with what its file expects."""
    import json

    from executive.errors import ScenarioError
    from executive.runtime.scenario import load_scenario, run_scenario

    disagreeing = broken = 0
    language = None if dictionary is None else dictionary_of(dictionary)
    if trace_dir is not None:
        try:
            trace_dir.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            fail(f"trace folder {trace_dir} cannot be made: {error.strerror}")
    for path in scenarios:
        try:
            result = run_scenario(load_scenario(path), language)
        except ScenarioError as error:
            typer.echo(f"outcrop: {error}", err=True)
            broken += 1
            continue
        if trace_dir is not None:
            target = trace_dir / path.name
            try:
                target.write_text(json.dumps(result.to_json(), indent=1) + "\n", encoding="utf-8")
            except OSError as error:
                fail(f"trace {target} cannot be written: {error.strerror}")
        if result.scenario.expect is None:
            typer.echo(f"{path.name}: ran, expects nothing")
        elif result.agrees:
            typer.echo(f"{path.name}: agrees")
        else:
            disagreeing += 1
            typer.echo(f"{path.name}: differs")
            for difference in result.differences:
                typer.echo(f"  {difference}")
    if broken:
        raise typer.Exit(2)
    if disagreeing:
        raise typer.Exit(1)
