"""Rovers by name: those that come with the program, and what packages announce under `outcrop.rovers`."""

from __future__ import annotations

from collections.abc import Callable
from typing import cast

from executive.ports import Rover
from mission.errors import PluginError
from mission.plugins import Registry
from rover_iface.errors import RoverError

ROVERS = Registry(
    "rover",
    "outcrop.rovers",
    {
        "abstract": "rover_iface.simulator.abstract_rover:make_rover",
        "subframe": "rover_iface.simulator.subframe_rover:make_rover",
        "full": "rover_iface.simulator.full_rover:make_rover",
        "mujoco": "rover_iface.mujoco.rover:make_rover",
    },
)


def rover_names() -> list[str]:
    """Return the names of all rovers that can be made."""
    return ROVERS.names()


def simulated_rover_names() -> list[str]:
    """Return the names of the rovers that come with the program, all simulated.

    What a package announces may be a real rover, also under one of these names, which then is not among them.
    """
    return ROVERS.own_names()


def require_simulated(name: str) -> None:
    """Raise unless a rover is one of those that come with the program.

    Raises
    ------
    RoverError
        If it is not; it may drive a real rover.
    """
    known = simulated_rover_names()
    if name not in known:
        raise RoverError(
            f"a training rover is simulated, by one of {', '.join(known)}; {name!r} is none of them"
        )


def find_rover(name: str) -> Callable[..., Rover]:
    """Return the factory of a rover: `make_rover(world, *, out, seed, faults, progress_s, ...)`.

    Raises
    ------
    RoverError
        If there is none of that name, or it cannot be loaded.
    """
    try:
        factory = ROVERS.load(name)
    except PluginError as err:
        raise RoverError(str(err)) from err
    if not callable(factory):
        raise RoverError(f'rover "{name}" is {factory!r}; a function that makes a rover is needed')
    return cast("Callable[..., Rover]", factory)
