"""`flight-map/1`: what a dictionary of another program does not say and a plan needs.

What commands cost, which of them are instruments, and by which commands the actions are sent that Outcrop
plans itself.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from pathlib import Path
from typing import TypeAlias

from mission.codec import Codec, read_toml
from mission.instrument import Instrument
from mission.values import NotNegative, value
from neighbours.flight.errors import FlightError

Constant: TypeAlias = bool | int | float | str


@value
class Cost:
    """Mean time and energy of a command, without the hotel load.

    The defaults are what a command gets that the map does not name: set by us, no source; the report of an
    import says how many commands have them.
    """

    time_s: NotNegative = 10.0
    energy_j: NotNegative = 200.0


@value
class MappedCommand:
    """One command: what it costs, the parts of the rover that it needs, arguments where a plan says none."""

    time_s: NotNegative | None = None
    energy_j: NotNegative | None = None
    needs: tuple[str, ...] = ()
    arguments: Mapping[str, Constant] = field(default_factory=dict)


@value
class Sent:
    """The command by which an action of Outcrop is sent; an argument `$NAME` takes the action's parameter."""

    command: str
    arguments: Mapping[str, Constant] = field(default_factory=dict)


@value
class FlightMap:
    """What a dictionary of another program does not say and a plan needs.

    `instruments` are added to those of the base profile; each names its command as `action`. `sent` says for
    an action of Outcrop (navigate, trackstart) by which command it is sent.
    """

    default: Cost = Cost()
    commands: Mapping[str, MappedCommand] = field(default_factory=dict)
    instruments: Mapping[str, Instrument] = field(default_factory=dict)
    sent: Mapping[str, Sent] = field(default_factory=dict)


FLIGHT_MAP = Codec(FlightMap, "flight-map/1", "map of a flight dictionary", error=FlightError)


def load_flight_map(path: Path | None) -> FlightMap:
    """Return the map in a TOML file, or the empty one where there is none.

    Raises
    ------
    FlightError
        If it cannot be read, or a member is missing, unknown or out of range.
    """
    if path is None:
        return FlightMap()
    try:
        raw = path.read_bytes()
    except OSError as err:
        raise FlightError(f"{path}: {err.strerror or err}") from err
    return FLIGHT_MAP.from_document(read_toml(raw, str(path), FlightError), str(path))
