"""`outcrop rover dictionary-from`: a rover made of another program's dictionary."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ground.cli.failure import refusals

if TYPE_CHECKING:
    from neighbours.flight.foreign import ForeignDictionary
    from neighbours.flight.import_dictionary import ImportedDictionary, Remark

MOST_SHOWN = 4
"""Places of a remark that the terminal shows; --report holds all."""


def dictionary_from(
    file: Annotated[Path, typer.Argument(help="F Prime's dictionary (.json) or XTCE (.xml)")],
    name: Annotated[str, typer.Option("--name", help="name of the rover that is made")],
    out: Annotated[Path, typer.Option("--out", help="folder for NAME.toml and NAME.dictionary.json")],
    base: Annotated[str, typer.Option(help="rover profile whose body, cameras and activities it has")] = "k9",
    mapping: Annotated[
        Path | None,
        typer.Option("--map", help="flight-map/1 in TOML: costs, instruments, how actions are sent"),
    ] = None,
    report: Annotated[
        Path | None, typer.Option("--report", help="write all that was made, left out or told as JSON")
    ] = None,
) -> None:
    """Make a rover profile and its dictionary of a dictionary of F Prime or an XTCE file.

    All that contradicts itself is named with its value, and then nothing is written. Use the rover with
    `outcrop --profiles OUT COMMAND`. Exit status 0: made, 2: refused.
    """
    from neighbours.flight.flight_map import load_flight_map
    from neighbours.flight.import_dictionary import import_dictionary
    from neighbours.flight.rover_files import write_rover
    from rover_iface.profile import load_profile

    with refusals():
        profile = load_profile(base)
        mapped = load_flight_map(mapping)
        imported = import_dictionary(read_foreign(file), mapped, profile.language, name)
        made = write_rover(name, imported, mapped, profile, out)
        if report is not None:
            report.write_text(_report(imported), encoding="utf-8")
    typer.echo(f"{len(imported.commands)} commands and {len(imported.channels)} telemetry keys")
    if imported.without_cost:
        cost, count = mapped.default, len(imported.without_cost)
        typer.echo(f"default cost of {count} commands: {cost.time_s:g} s and {cost.energy_j:g} J each")
    for line in imported.left_out:
        typer.echo(f"left out: {line}")
    for remark in imported.remarks:
        typer.echo(f"not said: {_told(remark)}")
    for path in made:
        typer.echo(f"wrote {path}")


def read_foreign(path: Path) -> ForeignDictionary:
    """Return the dictionary in a file, whose ending says which program it is of."""
    from neighbours.flight.errors import ForeignDictionaryError
    from neighbours.flight.fprime_dictionary import read_fprime
    from neighbours.flight.xtce_dictionary import read_xtce

    reader = {".json": read_fprime, ".xml": read_xtce, ".xtce": read_xtce}.get(path.suffix.lower())
    if reader is None:
        found = f"ends in {path.suffix!r}; F Prime's dictionary ends in .json, XTCE in .xml or .xtce"
        raise ForeignDictionaryError(str(path), (found,))
    return reader(path)


def _told(remark: Remark) -> str:
    shown = ", ".join(remark.where[:MOST_SHOWN])
    more = len(remark.where) - MOST_SHOWN
    return f"{remark.text} ({len(remark.where)}): {shown}" + (f" and {more} more" if more > 0 else "")


def _report(imported: ImportedDictionary) -> str:
    import json

    return (
        json.dumps(
            {
                "commands": imported.commands,
                "channels": imported.channels,
                "default_cost": imported.without_cost,
                "left_out": imported.left_out,
                "not_said": {remark.text: remark.where for remark in imported.remarks},
            },
            indent=1,
        )
        + "\n"
    )
