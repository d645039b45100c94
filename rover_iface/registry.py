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
    },
)


def rover_names() -> list[str]:
    """Return the names of all rovers that can be made."""
    return ROVERS.names()


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
