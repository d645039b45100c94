"""Open sets: implementations found by name, the product's own and those that installed packages announce."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from functools import lru_cache
from importlib import metadata
from importlib.metadata import EntryPoint, EntryPoints
from typing import Any

from mission.errors import PluginError


@lru_cache(maxsize=64)
def _announced(_path: tuple[str, ...]) -> Any:  # the type differs between versions of Python
    return metadata.entry_points()


def entry_points(group: str) -> EntryPoints:
    """Return what installed packages announce in a group.

    All groups are read once for a search path, from a file of each package: 20 ms of processor time for 200
    of them.
    """
    found: EntryPoints = _announced(tuple(sys.path)).select(group=group)
    return found


class Registry:
    """Implementations by name.

    Parameters
    ----------
    what
        What one of them is, for messages: `tracker`.
    group
        Entry point group under which packages announce theirs: `outcrop.trackers`. One of the name of a
        built-in takes its place.
    built_in
        The product's own, as `module:attribute`; imported when asked for.
    """

    def __init__(self, what: str, group: str, built_in: Mapping[str, str]) -> None:
        self.what, self.group = what, group
        self._built_in = {
            name: EntryPoint(name=name, value=place, group=group) for name, place in built_in.items()
        }

    def _points(self) -> dict[str, EntryPoint]:
        return {**self._built_in, **{point.name: point for point in entry_points(group=self.group)}}

    def names(self) -> list[str]:
        """Return the names of all of them, sorted; none is imported for it."""
        return sorted(self._points())

    def own_names(self) -> list[str]:
        """Return the names of the product's own, sorted, without those whose place a package's took."""
        points = self._points()
        return sorted(name for name, own in self._built_in.items() if points[name].value == own.value)

    def __iter__(self) -> Iterator[str]:
        return iter(self.names())

    def load(self, name: str) -> object:
        """Return the implementation of that name.

        Raises
        ------
        PluginError
            If there is none of that name, or its module cannot be imported or lacks it. The message names
            what is known, and where the failing one was announced.
        """
        points = self._points()
        if name not in points:
            raise PluginError(f'unknown {self.what} "{name}"; known are {", ".join(sorted(points))}')
        point = points[name]
        try:
            return point.load()
        except Exception as err:  # a package's module may fail in any way while it is imported
            owner = f" of the package {point.dist.name}" if point.dist is not None else ""
            others = ", ".join(sorted(set(points) - {name})) or "none"
            raise PluginError(
                f'{self.what} "{name}" ({point.value}{owner}) cannot be loaded: '
                f"{type(err).__name__}: {err}; others are {others}"
            ) from err
