"""Rovers by name: what is installed under the entry point group `outcrop.rovers`."""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import entry_points
from typing import Any

from executive.ports import Rover
from rover_iface.errors import RoverError

GROUP = "outcrop.rovers"

BUILT_IN = {
    "abstract": "rover_iface.simulator.abstract_rover:make_rover",
    "subframe": "rover_iface.simulator.subframe_rover:make_rover",
}
"""Rovers that come with the program; an installed entry point of the same name wins."""


def rover_names() -> list[str]:
    """Return the names of all rovers that can be made."""
    return sorted({*BUILT_IN, *(point.name for point in entry_points(group=GROUP))})


def find_rover(name: str) -> Callable[..., Rover]:
    """Return the factory of a rover: `make_rover(world, *, out, seed, faults, progress_s, ...)`.

    Raises
    ------
    RoverError
        If there is none of that name, or it cannot be loaded.
    """
    import importlib

    found = list(entry_points(group=GROUP, name=name))
    if not found and name not in BUILT_IN:
        raise RoverError(f'unknown rover "{name}"; known are {", ".join(rover_names())}')
    try:
        factory: Any
        if found:
            factory = found[0].load()
        else:
            module, _, attribute = BUILT_IN[name].partition(":")
            factory = getattr(importlib.import_module(module), attribute)
    except (ImportError, AttributeError) as err:
        raise RoverError(f'rover "{name}" cannot be loaded: {err}') from err
    if not callable(factory):
        raise RoverError(f'rover "{name}" is {factory!r}; a function that makes a rover is needed')
    made: Callable[..., Rover] = factory
    return made
