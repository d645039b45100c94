"""Targets as the rover knows them before it has seen any."""

from __future__ import annotations

from dataclasses import dataclass

from rover_iface.frames import Pose


@dataclass(frozen=True, slots=True)
class DesignatedTarget:
    """A target as the ground designated it on its map, and where the rover is to stand for it."""

    id: str
    point: tuple[float, float, float]
    normal: tuple[float, float, float] = (0.0, 0.0, 1.0)
    kind: str = "place"
    observation_point: Pose | None = None
