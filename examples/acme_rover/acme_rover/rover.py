"""The rover behind the executive's port: here a simulated body with our tracker in it."""

from __future__ import annotations

from typing import Any

from executive.ports import Rover
from rover_iface.simulator import subframe_rover

TRACKER = "acme-cautious"


def make_rover(world: Any, **options: Any) -> Rover:
    """Return the rover: the entry point of `outcrop.rovers`; options as those of `subframe` are taken."""
    return subframe_rover.make_rover(world, **{"tracker": TRACKER, **options})
