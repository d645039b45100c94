"""Errors planted in a rover: hardware that raises where no program expects it."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, cast

from rover_iface.behaviour.hardware import Hardware
from rover_iface.behaviour.repertoire import MakeRepertoire, Repertoire, Targets


class PlantedError(Exception):
    """What no part of the rover knows of."""


class PlantedHardware:
    """Hardware whose n-th use inside actions raises, for each n given; `uses` counts them."""

    def __init__(self, inner: Hardware, at: Iterable[int]) -> None:
        self._inner, self._at = inner, frozenset(at)
        self._armed = False
        self.uses = 0
        self.raised = 0

    def arm(self) -> None:
        """Count from now on."""
        self._armed = True

    def __getattr__(self, name: str) -> Any:
        if self._armed:
            self.uses += 1
            if self.uses in self._at:
                self.raised += 1
                raise PlantedError(f"use {self.uses} of the hardware, {name}")
        return getattr(self._inner, name)


def planted(make: MakeRepertoire, at: Iterable[int], made: list[PlantedHardware]) -> MakeRepertoire:
    """Return a maker of the same behaviour over planted hardware, which is put into `made`."""

    def plant(hardware: Hardware, targets: Targets, tracker: str = "") -> Repertoire:
        over = PlantedHardware(hardware, at)
        made.append(over)
        own = make(cast("Hardware", over), targets, tracker)
        over.arm()
        return own

    return plant
