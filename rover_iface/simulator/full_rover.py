"""The `full` rover: everything in the loop, from rendered stereo to the tool on the rock.

It drives by a hazard map made of dense stereo of rendered navcam pairs, follows its targets by SIFT features
on full-resolution pairs round them, registers what it sees on arrival with what it saw before, hands the
target to the hazcams by the cascade that tests itself, judges by their cloud whether and where the tool may
touch, moves an arm of five joints there until its sensors report contact, and brings a close-up of the
microscopic imager. The sun moves, and the rover's own shadow is in its pictures. Body, slip, drift, power and
faults are those of the `subframe` rover.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rover_iface.behaviour import repertoire
from rover_iface.behaviour.repertoire import MakeRepertoire
from rover_iface.simulator.faults import Fault
from rover_iface.simulator.subframe_rover import body_of
from rover_iface.simulator.terrain_rover import TerrainRover
from rover_iface.simulator.world import World, load_world
from rover_iface.terrain.terrain import Terrain


def make_rover(
    world: World | Mapping[str, Any] | Path | str,
    *,
    out: Path | None = None,
    seed: int | None = None,
    faults: Sequence[Fault] = (),
    progress_s: float | None = None,
    terrain: Terrain | None = None,
    battery_j: float | None = None,
    make: MakeRepertoire | None = None,
    tracker: str = "",
) -> TerrainRover:
    """Return a full rover; the entry point `full` of the group `outcrop.rovers`.

    Parameters and errors are those of the `subframe` rover's `make_rover`.
    """
    place = load_world(world)
    return TerrainRover(
        body_of(place, terrain, seed, own_shadow=True),
        make or repertoire.full,
        out=out,
        faults=(*place.faults, *faults),
        progress_s=place.progress_s if progress_s is None else progress_s,
        battery_j=battery_j if battery_j is not None else place.battery_j,
        tracker=tracker or place.tracker,
    )
