"""How a command ends when its input is wrong: one line on stderr and a stable exit code."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator
from typing import NoReturn

import typer

BAD_INPUT = 2


def fail(message: str, code: int = BAD_INPUT) -> NoReturn:
    """Print `message` on stderr, headed by the program's name, and exit with `code`."""
    typer.echo(f"outcrop: {message}", err=True)
    raise typer.Exit(code)


@contextlib.contextmanager
def refusals() -> Iterator[None]:
    """End with one line what the ground, the planner, a rover, the executive or the disk refuses."""
    from executive.crl.errors import CrlError
    from executive.errors import ExecutiveError
    from ground.errors import GroundError
    from mission.errors import MissionError
    from neighbours.flight.errors import FlightError
    from neighbours.geodata.errors import GeodataError
    from neighbours.planning.errors import PlanningFormatError
    from neighbours.robots.errors import RobotFormatError
    from planner.errors import PlannerError
    from rover_iface.errors import RoverError

    try:
        yield
    except (
        GroundError,
        PlannerError,
        RoverError,
        ExecutiveError,
        CrlError,
        MissionError,
        FlightError,
        GeodataError,
        PlanningFormatError,
        RobotFormatError,
    ) as err:
        fail(str(err))
    except OSError as err:
        fail(f"{err.filename or 'a file'}: {err.strerror or err}")
    except Exception as err:
        if not _connection_lost(err):
            raise
        fail(
            "the database closed the connection; whether this was kept is not known, so look before you "
            "repeat it"
        )


def _connection_lost(err: Exception) -> bool:
    """Return whether an error says that the connection to the database is gone.

    SQLAlchemy is looked at only where a command has loaded it: most need no database, and it is slow to load.
    """
    library = sys.modules.get("sqlalchemy.exc")
    return library is not None and isinstance(err, library.DBAPIError) and err.connection_invalidated
