"""A target that was designated, and the same place hours later from where the rover does not know that it is.

The rover has the whole navcam pair of its last stop with the target in it. It then makes a step of a tenth
of the range, as it believes; in truth it comes out up to a metre and 15 degrees elsewhere, and the sun has
gone on by four hours. The mast points where the target is believed to be, and to either side of that if it is
asked to.
"""

from __future__ import annotations

import math
import time
from pathlib import Path

import numpy as np

from mission.soltime import SOL_S, sun_direction
from rover_iface.frames import Pose, Transform
from rover_iface.simulator.render.renderer import Sun
from rover_iface.vision.tracker import StereoView
from studies.common.domain_painters import painter
from studies.common.domain_runs import World, pair_of, world_of
from studies.common.domain_split import Purpose
from studies.common.perception_worlds import Shot
from studies.common.tracking_worlds import PIVOT, Array

WHOLE = (1024, 768)
NEAREST_M, FARTHEST_M, SHARE = 2.0, 8.0, 0.10
LOST_M, LOST_RAD = 1.0, math.radians(15.0)
HOURS, LOWEST_RAD = 4.0, math.radians(20.0)
ASIDES = (0.0, math.radians(36.0), -math.radians(36.0))
"""How far to either side the mast looks if it is asked to: frames of 49 degrees overlap by 13."""
TARGETS = 3


class Trial:
    """One stop before and one after the pose was lost; close it when it is done with.

    The step between them is a share of the range; the sun goes on by some hours.

    Attributes
    ----------
    before
        The pair with the targets in it.
    targets
        (n, 3), m: surface points that its left picture shows.
    taking_s
        Processor time that pictures have taken so far: no part of finding anything in them.
    """

    def __init__(
        self,
        domain: str,
        seed: int,
        purpose: Purpose,
        imagery: Path,
        share: float = SHARE,
        hours: float = HOURS,
    ) -> None:
        self.domain, self.seed, self.later_s = domain, seed, hours / 24.0 * SOL_S
        self.world = world = world_of(seed)
        sensor, middle = world.rig.mounted("navcam_left").sensor, np.array([0.0, 0.0, world.rock.z])
        self.paint = painter(domain, world.renderer, sensor, purpose, imagery, seed, middle, WHOLE)
        rng = np.random.default_rng([seed, 0xAC0])
        early, self.late = suns(rng, hours)
        self.look = np.array([0.0, 0.0, world.rock.z + 0.4 * world.rock.height])
        bearing = math.pi + math.radians(float(rng.uniform(-30, 30)))
        self.range_m = float(rng.uniform(NEAREST_M, FARTHEST_M))
        first, second = (
            _pose(world, rng, bearing, away) for away in (self.range_m / (1.0 - share), self.range_m)
        )
        self.shift_m, way = LOST_M * math.sqrt(float(rng.uniform())), float(rng.uniform(0, math.tau))
        self.turn_rad = float(rng.uniform(-LOST_RAD, LOST_RAD))
        x, y = second.x + self.shift_m * math.cos(way), second.y + self.shift_m * math.sin(way)
        tilt = [math.radians(rng.normal(0, sd)) for sd in (1.0, 2.0)]
        height = float(world.terrain.height_at(x, y))
        self.true = Pose(x, y, height, second.heading + self.turn_rad, *tilt)
        # inertial unit and wheels have roll, pitch and height of the true pose, not place and heading
        roll, pitch = (v + float(rng.normal(0, math.radians(0.1))) for v in tilt)
        told = Pose(second.x, second.y, height + float(rng.normal(0, 0.02)), second.heading, roll, pitch)
        self.believed = told.site_from_rover
        self.before = pair_of(
            world, self.paint, first, first.site_from_rover, early, self.look, rng, "navcam", WHOLE
        )
        self.targets = _targets(self.before[0], rng)
        self._pairs: dict[int, tuple[Shot, Shot]] = {}
        self.taking_s = 0.0

    def pair(self, number: int) -> tuple[Shot, Shot]:
        """Return the pair towards the believed place (0), or that to the left (1) or right (2) of it."""
        if number not in self._pairs:
            started = time.process_time()
            rng = np.random.default_rng([self.seed, 0xAC1, number])
            eye = self.believed.translation
            ray = Transform.from_rpy(0.0, 0.0, ASIDES[number]).rotate(self.look - eye)
            where = self.true, self.believed, self.late, eye + ray
            self._pairs[number] = pair_of(self.world, self.paint, *where, rng, "navcam", WHOLE)
            self.taking_s += time.process_time() - started
        return self._pairs[number]

    def in_sight(self, point: Array) -> bool:
        """Return whether nothing hides a point (3,), m, from the left camera, wherever the mast points."""
        eye = self.pair(0)[0].true.C
        return bool(self.world.renderer.scene.sees(eye, point[None])[0])

    def close(self) -> None:
        """Free what draws the pictures."""
        self.paint.close()


def view_of(pair: tuple[Shot, Shot], t_s: float = 0.0) -> StereoView:
    """Return a pair taken at a time, s, with its cameras as the rover believes them to be."""
    left, right = pair
    return StereoView(left.unit, right.unit, left.told, right.told, t_s)


def suns(rng: np.random.Generator, hours: float = HOURS) -> tuple[Sun, Sun]:
    """Return two suns some hours apart, both 20 degrees high or more, of a season within the tropics."""
    while True:
        season, latitude = float(rng.uniform(0, 360)), float(rng.uniform(-25, 25))
        hour = float(rng.uniform(7.0, 13.0))
        pair = [sun_direction(season, latitude, hour + later) for later in (0.0, hours)]
        if min(up for _, _, up in pair) > math.sin(LOWEST_RAD):
            return Sun(pair[0]), Sun(pair[1])


def _pose(world: World, rng: np.random.Generator, bearing: float, away_m: float) -> Pose:
    """Return a pose from which the mast sees the rock at the origin from `away_m` off."""
    heading = math.remainder(bearing + math.pi + rng.normal(0, 0.04), math.tau)
    x = away_m * math.cos(bearing) - PIVOT[0] * math.cos(heading)
    y = away_m * math.sin(bearing) - PIVOT[0] * math.sin(heading)
    tilt = [math.radians(rng.normal(0, sd)) for sd in (1.0, 2.0)]
    return Pose(x, y, float(world.terrain.height_at(x, y)), heading, *tilt)


def _targets(first: Shot, rng: np.random.Generator) -> Array:
    """Return points of the rock (n, 3), 3 px and more inside its outline in the first picture."""
    import cv2

    inner = cv2.erode(first.on_rock.astype(np.uint8), np.ones((7, 7), np.uint8)) > 0
    lines, samples = np.nonzero(inner)
    picks = rng.permutation(len(lines))[:TARGETS]
    return np.asarray(first.points()[lines[picks], samples[picks]]).reshape(-1, 3)
