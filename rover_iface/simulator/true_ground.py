"""What truly is where a rover drives: the targets of its world, and the map with unmapped rocks."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from rover_iface.behaviour.target import DesignatedTarget
from rover_iface.errors import WorldError
from rover_iface.simulator.world import World
from rover_iface.streams import stream
from rover_iface.terrain.strew import add_rocks
from rover_iface.terrain.terrain import Terrain


def true_terrain(
    world: World, terrain: Terrain, targets: Iterable[DesignatedTarget], seed: int, half_m: float
) -> Terrain:
    """Return the map with the rocks of the world that are not on it, within `half_m` of the origin.

    None lies near the start, a target or an observation point. A seed gives the same rocks to every rover.
    """
    density = world.map_error.unmapped_rocks_per_m2
    if density <= 0:
        return terrain
    rng = stream("unmapped rocks", seed)
    half = min(half_m, 20.0)
    count = int(rng.poisson(density * 4 * half * half))
    table = np.column_stack([rng.uniform(-half, half, (count, 2)), rng.uniform(0.18, 0.45, count)])
    clear = [(world.start.x, world.start.y, 1.6)]
    for target in targets:
        clear.append((target.point[0], target.point[1], 0.7))
        if target.observation_point is not None:
            clear.append((target.observation_point.x, target.observation_point.y, 1.0))
    return add_rocks(terrain, table, seed=seed, keep_clear=clear, prefix="U")


def world_targets(world: World) -> list[DesignatedTarget]:
    """Return the targets of a world, from its problem where it lists none itself.

    Raises
    ------
    WorldError
        If a target of the problem has no point.
    """
    if world.targets:
        return list(world.targets)
    from rover_iface.simulator.model import AbstractModel

    if world.problem is None:
        return []
    model = AbstractModel.from_problem(world.problem)
    found = []
    for k, name in enumerate(model.targets):
        point = model.points[k]
        if point is None:
            raise WorldError(f'target {name} has no "point_m"; a rover on terrain needs it')
        contact = any(o.contact for o in model.observations if o.place == k + 1)
        found.append(
            DesignatedTarget(
                name,
                point,
                model.normals[k],
                kind="place" if contact else "image",
                observation_point=model.poses[k + 1],
            )
        )
    return found
