"""What a rover on terrain stands on and is: the true world, its body in it, and where it believes to be.

Two site frames are kept apart. The *true* one is the terrain's. The *believed* one is where dead reckoning
puts things; targets, goals and telemetry live in it. Both agree at the start.
"""

from __future__ import annotations

import math
from functools import cached_property

from rover_iface.errors import WorldError
from rover_iface.frames import Pose, Transform
from rover_iface.navigation.sensor import GroundRaster
from rover_iface.simulator.chassis import Chassis
from rover_iface.simulator.own_shadow import OwnShadow, ShadowedScene
from rover_iface.simulator.render.from_terrain import scene_from_terrain
from rover_iface.simulator.render.renderer import Renderer, Sun
from rover_iface.simulator.true_ground import true_terrain, world_targets
from rover_iface.simulator.world import World
from rover_iface.streams import stream
from rover_iface.terrain.terrain import Terrain

ROUND_M = 8.0
"""How much farther than it works a rover may be led round rocks: on four days of `studies.subframe_day`
(906202541 to 906202544) three drives ended at the edge of the ground."""


class Body:
    """A rover's body in its true world.

    Attributes
    ----------
    terrain, map
        The true ground, and the map of it that the planner had.
    targets
        By id, as designated on the map.
    chassis
        Drives; holds the true pose and the believed one.
    rng
        Of everything that is drawn during the run, one stream.
    own_shadow
        Whether pictures show the rover's own shadow.

    Raises
    ------
    WorldError
        If the rover cannot stand at its start.
    OutsideTerrainError
        If the start lies outside the terrain.
    """

    def __init__(self, world: World, terrain: Terrain, *, seed: int = 0, own_shadow: bool = False) -> None:
        terrain.require_inside(world.start.x, world.start.y, "start of the rover")
        self.world = world
        self.profile = world.profile
        self.seed = seed
        self.own_shadow = own_shadow
        self.rng = stream("wheels and sensors", seed)
        self.map = terrain
        self.targets = {t.id: t for t in world_targets(world)}
        self.terrain = true_terrain(world, terrain, self.targets.values(), seed, self._half_width())
        self.ground = GroundRaster.of(self.terrain, self._half_width() + ROUND_M)
        self.chassis = Chassis(
            self.ground,
            self.profile,
            world.start,
            soil=world.soil,
            softer=world.map_error.softer,
            rng=self.rng,
        )
        if math.isnan(self.chassis.pose.z):
            raise WorldError(
                f"the rover cannot stand at its start ({world.start.x:.2f}, {world.start.y:.2f})"
            )
        self.sun_clock = world.sun.clock()

    @property
    def pose(self) -> Pose:
        """Return where the rover truly is."""
        return self.chassis.pose

    @property
    def believed(self) -> Pose:
        """Return where dead reckoning puts the rover."""
        return self.chassis.believed

    @property
    def true_from_believed(self) -> Transform:
        """Return how the believed site frame lies in the true one, by where the rover is in both."""
        return self.pose.site_from_rover * self.believed.site_from_rover.inverse()

    @cached_property
    def renderer(self) -> Renderer:
        """Return the eye of the simulation; made when first needed."""
        start = self.world.start
        scene = scene_from_terrain(self.terrain, (start.x, start.y), radius_m=self._half_width() + ROUND_M)
        if self.own_shadow:
            scene = ShadowedScene(scene, OwnShadow(self.profile, lambda: self.pose.site_from_rover))
        return Renderer(scene)

    @property
    def eye(self) -> Renderer:
        """Return what takes pictures from where the rover stands now, whenever they are read out."""
        scene = self.renderer.scene
        if not isinstance(scene, ShadowedScene):
            return self.renderer
        return Renderer(scene.cast_from(self.pose.site_from_rover), look=self.renderer.look)

    def sun(self, t_s: float) -> Sun:
        """Return the light at a time of the plan."""
        return Sun(self.sun_clock.direction(t_s))

    def _half_width(self) -> float:
        """Return how far from the origin the rover works: its targets and 6 m more, 12 to 40 m."""
        far = [abs(self.world.start.x), abs(self.world.start.y)]
        for target in self.targets.values():
            far += [abs(target.point[0]), abs(target.point[1])]
        return min(40.0, max(12.0, max(far) + 6.0))
