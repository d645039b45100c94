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
def show(name: Annotated[str, typer.Argument(help="name of the rover profile")]) -> None:
    """Print a rover's instruments, actions, telemetry keys and constraints as JSON."""
    import json
    from dataclasses import asdict

    from ground.errors import GroundError
    from ground.resources.rovers.read_rover import describe

    try:
        typer.echo(json.dumps(asdict(describe(name)), indent=1))
    except GroundError as err:
        typer.echo(f"outcrop: {err.message}", err=True)
        raise typer.Exit(2) from err


@rover.command()
def check(
    name: Annotated[str, typer.Argument(help="name of the rover (entry point group outcrop.rovers)")],
    world: Annotated[
        Path | None, typer.Option(help="world with targets T1 and T2; a made one if absent")
    ] = None,
    profile: Annotated[str, typer.Option(help="rover profile of the made world: name or TOML file")] = "k9",
    dictionary: Annotated[
        str | None, typer.Option(help="dictionary to hold it to: name or file; that of the profile if absent")
    ] = None,
) -> None:
    """Run the contract suite against a rover; exit 1 if a check fails."""
    import tempfile

    from executive.crl.errors import DictionaryError
    from rover_iface.contract import check_rover, write_contract_world
    from rover_iface.errors import RoverError
    from rover_iface.profile import dictionary_file
    from rover_iface.registry import find_rover

    if profile.endswith(".toml"):
        profile = str(Path(profile).resolve())
    try:
        factory = find_rover(name)
        language = None if dictionary is None else dictionary_file(dictionary)
        with tempfile.TemporaryDirectory() as folder:
            place = world if world is not None else write_contract_world(Path(folder), profile)
            findings = check_rover(factory, place, dictionary=language)
    except (RoverError, DictionaryError) as err:
        typer.echo(f"outcrop: {err}", err=True)
        raise typer.Exit(2) from err
    for finding in findings:
        typer.echo(f"{'ok  ' if finding.passed else 'FAIL'}  {finding.name}")
        if not finding.passed:
            typer.echo(f"      {finding.detail}")
    broken = sum(not finding.passed for finding in findings)
    typer.echo(f"{name}: {len(findings) - broken} of {len(findings)} checks passed")
    if broken:
        raise typer.Exit(1)
