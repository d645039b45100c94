"""Commands about rovers: which there are, and whether one keeps the contract."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

CERT = Annotated[Path | None, typer.Option("--cert", help="mutual TLS: own certificate, PEM")]
KEY = Annotated[Path | None, typer.Option("--key", help="mutual TLS: its key, PEM")]
CA = Annotated[Path | None, typer.Option("--ca", help="mutual TLS: the authority of both ends, PEM")]

rover = typer.Typer(
    name="rover", help="List rovers and check that one keeps the contract.", no_args_is_help=True
)


def register(app: typer.Typer) -> None:
    """Add the group to the program."""
    from ground.cli.flight_group.dictionary import dictionary_from

    rover.command("dictionary-from")(dictionary_from)
    app.add_typer(rover)


@rover.command("list")
def list_rovers() -> None:
    """List the rovers that are installed, and the profiles of the program, of packages and of your own."""
    from rover_iface.errors import ProfileError
    from rover_iface.profile import load_profile, profile_names
    from rover_iface.registry import rover_names

    for name in rover_names():
        typer.echo(f"rover    {name}")
    for name in profile_names():
        try:
            typer.echo(f"profile  {name}: {load_profile(name).doc}")
        except ProfileError as err:
            typer.echo(f"profile  {name}: cannot be used: {err}")


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
def serve(
    name: Annotated[str, typer.Argument(help="name of the rover (entry point group outcrop.rovers)")],
    listen: Annotated[str, typer.Option(help="unix:/path or tcp://host:port")],
    world: Annotated[Path, typer.Option(help="folder of the rover's world")],
    out: Annotated[Path | None, typer.Option(help="folder into which the rover writes its products")] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="seed of a simulated rover")] = None,
    speed: Annotated[float, typer.Option(help="seconds of the rover's clock in a second")] = 1.0,
    linger: Annotated[
        float | None, typer.Option(help="end when no executive has been there for so many seconds")
    ] = None,
    cert: CERT = None,
    key: KEY = None,
    ca: CA = None,
) -> None:
    """Put a rover behind the wire, in this process, until it is interrupted."""
    from executive.runtime.wire import Address, Keys
    from ground.cli.failure import refusals
    from ground.uplink.serve_rover import Serving, serve_rover

    with refusals():
        serving = Serving(
            name, world, Address.parse(listen), Keys.of(cert, key, ca), out, seed, speed, linger
        )
        serve_rover(serving, lambda line: typer.echo(line))


@rover.command()
def ros2(
    mapping: Annotated[Path, typer.Argument(help="mapping to ROS 2, ros2-mapping/1 in YAML")],
    listen: Annotated[str | None, typer.Option(help="unix:/path or tcp://host:port")] = None,
    check: Annotated[bool, typer.Option("--check", help="check the mapping and end; needs no ROS")] = False,
    out: Annotated[Path | None, typer.Option(help="folder into which images are written")] = None,
    ros_args: Annotated[str, typer.Option(help="what follows --ros-args, in one text")] = "",
    cert: CERT = None,
    key: KEY = None,
    ca: CA = None,
) -> None:
    """Put a robot that speaks ROS 2 behind the wire, until it is interrupted."""
    from executive.runtime.wire import Address, Keys
    from ground.cli.failure import fail, refusals
    from ground.uplink.serve_ros2 import Bridging, check_mapping, serve_ros2

    with refusals():
        if check:
            for line in check_mapping(mapping):
                typer.echo(line)
            return
        if listen is None:
            fail("the bridge needs --listen, the address at which it waits for the executive, or --check")
        bridging = Bridging(mapping, Address.parse(listen), Keys.of(cert, key, ca), out, ros_args)
        serve_ros2(bridging, lambda line: typer.echo(line))


@rover.command()
def check(
    name: Annotated[
        str, typer.Argument(help="name of the rover (entry point group outcrop.rovers)")
    ] = "rover",
    world: Annotated[
        Path | None, typer.Option(help="world with targets T1 and T2; a made one if absent")
    ] = None,
    profile: Annotated[str, typer.Option(help="rover profile of the made world: name or TOML file")] = "k9",
    dictionary: Annotated[
        str | None, typer.Option(help="dictionary to hold it to: name or file; that of the profile if absent")
    ] = None,
    hardware: Annotated[
        bool, typer.Option("--hardware", help="on the wall clock, over the wire: needs --connect")
    ] = False,
    connect: Annotated[str | None, typer.Option(help="unix:/path or tcp://host:port")] = None,
    patience: Annotated[
        float, typer.Option(help="seconds that an answer may take: more than the link is ever away")
    ] = 20.0,
    cert: CERT = None,
    key: KEY = None,
    ca: CA = None,
) -> None:
    """Run the contract suite against a rover; exit 1 if a check fails."""
    import tempfile

    if hardware or connect is not None:
        _check_hardware(name, connect, patience, (cert, key, ca))
        return

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


def _check_hardware(
    name: str, connect: str | None, patience_s: float, files: tuple[Path | None, Path | None, Path | None]
) -> None:
    from executive.runtime.wire import Address, Keys
    from executive.runtime.wire.contract import as_lines, check_wire
    from ground.cli.failure import fail, refusals

    if connect is None:
        fail("--hardware needs --connect, the address at which the rover listens")
    with refusals():
        findings = check_wire(Address.parse(connect), keys=Keys.of(*files), patience_s=patience_s)
    for line in as_lines(findings, connect if name == "rover" else name):
        typer.echo(line)
    if not all(finding.passed for finding in findings):
        raise typer.Exit(1)
