"""The ground round the rover with a target on it, as one look round shows it."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass

import numpy as np

from rover_iface.behaviour.action import Step
from rover_iface.behaviour.hardware import Hardware
from rover_iface.behaviour.sight import Sight
from rover_iface.behaviour.target import DesignatedTarget
from rover_iface.cameras.model import Array
from rover_iface.frames import Pose, Transform
from rover_iface.placement.cloud import SurfaceCloud, cloud_of_points


@dataclass(frozen=True, slots=True, eq=False)
class Surroundings:
    """What a look round shows of a target's ground, in the rover frame of where it was made.

    Attributes
    ----------
    cloud
        The surface, m.
    point, normal
        Where the target is believed to be (3,), m, and the outward unit normal (3,) that was designated.
    site_from_rover
        Where that frame lies in the believed site frame.
    """

    cloud: SurfaceCloud
    point: Array
    normal: Array
    site_from_rover: Transform

    def in_site(self, pose: Pose) -> Pose:
        """Return a pose of the rover frame in the believed site frame."""
        return Pose.from_transform(self.site_from_rover * pose.site_from_rover)


def look_round(
    hardware: Hardware, sight: Sight, target: DesignatedTarget, position: Array
) -> Generator[Step, None, Surroundings | None]:
    """Look round, and return the ground with a target that is believed to be at `position` (3,), m, site
    frame; None where nothing is seen.
    """
    looks = sight.cost(around=True)
    clouds = sight.look(around=True)
    yield from hardware.spend("navigator_step", looks)
    if not clouds:
        return None
    here = hardware.believed.site_from_rover
    rover_from_site = here.inverse()
    return Surroundings(
        cloud_of_points(np.concatenate(clouds)),
        np.asarray(rover_from_site.apply(position), dtype=np.float64),
        np.asarray(rover_from_site.rotate(target.normal), dtype=np.float64),
        here,
    )
