"""The `subframe` rover: a body on true ground, with eyes that are rendered.

It drives by the navigator on cast ranges with the noise of stereo, tracks targets by correlation on rendered
161 x 161 subframes as flown on Opportunity, slips, drifts, uses power and loses its way a little. Its world
may differ from the map the planner had: rocks that are not on the map, softer soil. A tracked target corrects
what matters: the goal of an approach is laid out from where the target is now believed to be, not from where
the map had it.

Another rover on terrain is made like this one: `body_of` reads the world, a `MakeRepertoire` puts behaviour
together over hardware, and `TerrainRover` joins them.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rover_iface.behaviour import repertoire
from rover_iface.behaviour.repertoire import MakeRepertoire
from rover_iface.errors import WorldError
from rover_iface.extras import VISION, require_packages
from rover_iface.simulator.body import Body
from rover_iface.simulator.faults import Fault
from rover_iface.simulator.terrain_rover import TerrainRover
from rover_iface.simulator.world import World, WorldSource, load_world
from rover_iface.terrain.terrain import Terrain


def make_rover(
    world: WorldSource,
    *,
    out: Path | None = None,
    seed: int | None = None,
    faults: Sequence[Fault] = (),
    progress_s: float | None = None,
    terrain: Terrain | None = None,
    battery_j: float | None = None,
    make: MakeRepertoire = repertoire.subframe,
    tracker: str = "",
    own_shadow: bool = False,
) -> TerrainRover:
    """Return a subframe rover; the entry point `subframe` of the group `outcrop.rovers`.

    Parameters
    ----------
    world
        A world, a `world/1` document, its file or its folder. It must have a terrain, here or as `terrain`.
    out
        Folder of the run, into which products are written.
    seed
        Of everything that is drawn: errors, noise, unmapped rocks; the seed of the world when absent.
    faults
        Faults on demand, besides those of the world.
    progress_s
        Report the pose so often during a drive; 0 = at the end of each way.
    make
        Another behaviour over the same hardware.
    tracker
        Name of another tracker than that of the world, or of the rover; see `rover_iface.vision.trackers`.

    own_shadow
        Whether the rover's shadow is in its pictures.

    Raises
    ------
    WorldError
        If the world is malformed or has no terrain.
    MissingExtraError
        If a package of the extra `vision` is not installed.
    """
    require_packages("a rover that sees", "vision", VISION)
    place = load_world(world)
    return TerrainRover(
        body_of(place, terrain, seed, own_shadow=own_shadow),
        make,
        out=out,
        faults=(*place.faults, *faults),
        progress_s=place.progress_s if progress_s is None else progress_s,
        battery_j=battery_j if battery_j is not None else place.battery_j,
        tracker=tracker or place.tracker,
    )


def body_of(
    world: World, terrain: Terrain | None = None, seed: int | None = None, *, own_shadow: bool = False
) -> Body:
    """Return the body of a rover in a world, on its terrain or a given one, with or without its own shadow.

    Raises
    ------
    WorldError
        If there is no terrain, or the rover cannot stand at its start.
    """
    ground = terrain if terrain is not None else world.load_terrain()
    if ground is None:
        raise WorldError(f'world "{world.name}" has no terrain; a rover on terrain needs one')
    return Body(world, ground, seed=world.seed if seed is None else seed, own_shadow=own_shadow)
