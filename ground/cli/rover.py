"""Commands about rovers: which there are, and whether one keeps the contract."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

rover = typer.Typer(
    name="rover", help="List rovers and check that one keeps the contract.", no_args_is_help=True
)


def register(app: typer.Typer) -> None:
    """Add the group to the program."""
    app.add_typer(rover)


@rover.command("list")
def list_rovers() -> None:
    """List the rovers that are installed and the profiles that come with the program."""
    from rover_iface.profile import load_profile, profile_names
    from rover_iface.registry import rover_names

    for name in rover_names():
        typer.echo(f"rover    {name}")
    for name in profile_names():
        typer.echo(f"profile  {name}: {load_profile(name).doc}")


@rover.command()
def check(
    name: Annotated[str, typer.Argument(help="name of the rover (entry point group outcrop.rovers)")],
    world: Annotated[
        Path | None, typer.Option(help="world with targets T1 and T2; a made one if absent")
    ] = None,
) -> None:
    """Run the contract suite against a rover; exit 1 if a check fails."""
    import tempfile

    from rover_iface.contract import check_rover, write_contract_world
    from rover_iface.errors import RoverError
    from rover_iface.registry import find_rover

    try:
        factory = find_rover(name)
    except RoverError as err:
        typer.echo(f"outcrop: {err}", err=True)
        raise typer.Exit(2) from err
    with tempfile.TemporaryDirectory() as folder:
        place = world if world is not None else write_contract_world(Path(folder))
        findings = check_rover(factory, place)
    for finding in findings:
        typer.echo(f"{'ok  ' if finding.passed else 'FAIL'}  {finding.name}")
        if not finding.passed:
            typer.echo(f"      {finding.detail}")
    broken = sum(not finding.passed for finding in findings)
    typer.echo(f"{name}: {len(findings) - broken} of {len(findings)} checks passed")
    if broken:
        raise typer.Exit(1)
