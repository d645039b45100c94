"""Where the rover stands, once it sees nothing of what it followed: it looks round for what it knows.

Dead reckoning does not know of a turn on a loose stone, and a tracker looks where that tells it to. So while
targets are in sight a pair is kept now and then, with the map of that moment. When all are lost at once the
mast looks at what was last known, and to either side of it if nothing is recognised there; each picture takes
its time and energy. The engine is that of `rover_iface.vision.reacquisition`.

A pose is believed over the map's if a target is found by it, ranged where it should be, or if two kept pairs
agree on it. One that no pair tells is told as lost, and the map knows its targets as poorly as that leaves
them.
"""

from __future__ import annotations

import copy
import math
from collections import deque
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from rover_iface.behaviour.action import Doing
from rover_iface.behaviour.hardware import Hardware
from rover_iface.behaviour.mast_cameras import MastCameras, Sighting
from rover_iface.cameras.model import Array
from rover_iface.errors import CameraError, RenderError, TrackerError
from rover_iface.frames import Pose, wrap_angle
from rover_iface.localization.target_map import CONTRADICTS, TargetMap
from rover_iface.vision.reacquisition import KnownPair, Reacquired, ReacquisitionOptions, searched
from rover_iface.vision.sift_motion import Motion, cross
from rover_iface.vision.tracker import StereoView, TrackUpdate

LIMITS = ReacquisitionOptions()
LOST_M, LOST_RAD = 0.5 * LIMITS.lost_m, 0.5 * LIMITS.lost_rad
"""What a rover may be off that recognises nothing, one standard deviation: the engine finds two of them."""
KEPT, ASKED = 4, 2
"""Pairs that are kept, and how many of them are asked, the latest first: two can agree."""
KEEP_SHARE, KEEP_M = 0.3, 0.5
"""How far the rover goes until another pair is kept, as a share of the target's range, and at least: the
engine was measured over a tenth of the range and a metre aside."""
NEAR_M = 1.5
"""How far it may have come from a pair that should be recognised: a step of 0.25 to 0.8 m, and a metre."""
AGREED_M, AGREED_RAD = 0.1, math.radians(1.0)
"""How far apart poses of two pairs may be: three deviations of what a pair errs at 8 m."""


@dataclass(frozen=True, eq=False)
class KeptStop:
    """A stop at which a target was in sight, and what was known then: where it was, believed site frame (3,),
    m, with its covariance (3, 3), m^2.

    `sighting` is the pair with the target in it.
    """

    target: str
    point: Array
    covariance: Array
    sighting: Sighting
    pose: Pose
    map: TargetMap

    @cached_property
    def known(self) -> KnownPair:
        """Return what is known of the pair: few are ever asked, so it is not read out before."""
        return KnownPair(self.sighting.view, LIMITS)


@dataclass(frozen=True, eq=False)
class PoseFound:
    """Where pictures have the rover.

    Attributes
    ----------
    pose
        In the site frame as it was believed at `stop`.
    covariance
        (4, 4) of place, m, and heading, rad, relative to that stop.
    map
        That of the stop, with the rover there.
    """

    pose: Pose
    covariance: Array
    map: TargetMap
    stop: KeptStop
    answer: Reacquired

    def target_covariance(self, mast_rad: float) -> Array:
        """Return the covariance (3, 3), m^2, of the target in a further look, what it was known to before
        included; `mast_rad` is the error of the mast in each.
        """
        answer, view = self.answer, self.answer.view
        assert view is not None
        away = float(np.linalg.norm(answer.position - view.left_camera.C))
        across_rad = math.hypot(answer.error_px / view.left_camera.hs, math.sqrt(2.0) * mast_rad)
        return np.asarray(self.stop.covariance + answer.covariance + (across_rad * away) ** 2 * np.eye(3))

    def off(self, believed: Pose) -> str:
        """Return in words how far a pose was off."""
        far = math.hypot(self.pose.x - believed.x, self.pose.y - believed.y)
        turn = math.degrees(abs(wrap_angle(self.pose.heading - believed.heading)))
        told = f"{self.answer.agreeing} patches and {self.answer.features} features of a pair kept"
        return f"the rover stands {far:.2f} m and {turn:.1f} degrees from where it believed, by {told}"

    def contradicts(self, other: TargetMap) -> bool:
        """Return whether a map has the rover elsewhere than the pictures have it."""
        (here, ours), (there, theirs) = self.map.rover, other.rover
        gap = here - there
        gap[3] = wrap_angle(float(gap[3]))
        return float(gap @ np.linalg.solve(ours + theirs, gap)) > CONTRADICTS


class PoseFinder:
    """Keeps pairs of stops, and finds the rover's pose by them.

    Parameters
    ----------
    near
        Takes the pair that is kept; its frames hold a target and what lies a metre round it.
    whole
        Takes whole frames, in which it is looked for.
    """

    def __init__(self, hardware: Hardware, near: MastCameras, whole: MastCameras) -> None:
        self.hardware, self.near, self.whole = hardware, near, whole
        self._stops: deque[KeptStop] = deque(maxlen=KEPT)
        self._seen: list[StereoView] = []

    def keep(self, update: TrackUpdate, known: TargetMap) -> Doing[None]:
        """Keep a pair of a target that is in sight, if the last one was taken too far from here."""
        point = update.position
        here = self.hardware.believed
        away = math.hypot(point[0] - here.x, point[1] - here.y)
        if self._come_m < max(KEEP_M, KEEP_SHARE * away):
            return
        taken = yield from self._taken(self.near, point)
        if taken is not None:
            known = copy.deepcopy(known)
            self._stops.append(KeptStop(update.target, point, update.covariance, taken, here, known))

    @property
    def should_know(self) -> bool:
        """Return whether a pair is kept that was taken so near that it must be recognised."""
        return self._come_m <= NEAR_M

    @property
    def _come_m(self) -> float:
        """Return how far the rover has come since a pair was kept last."""
        return self.hardware.travelled_m - self._stops[-1].sighting.travelled_m if self._stops else math.inf

    def find(self, target: str = "") -> Doing[PoseFound | str]:
        """Look for where the rover stands, by any pair or by those of a target alone; gives that, or in words
        why it is not known.
        """
        poses: list[PoseFound] = []
        why = "no pair was kept"
        self._seen = []
        stops = [stop for stop in reversed(self._stops) if target in ("", stop.target)]
        for stop in stops[:ASKED]:
            answer = yield from self._searched(stop)
            if answer.motion is None:
                why = answer.reasons[0]
                continue
            pose = self._pose(stop, answer, answer.motion)
            if answer.accepted or any(_agree(pose.pose, other.pose) for other in poses):
                return pose
            poses.append(pose)
            why = f"one pair alone tells a pose, and not its target: {answer.reasons[0]}"
        return why

    def _searched(self, stop: KeptStop) -> Doing[Reacquired]:
        search = searched(stop.known, stop.point)
        asked = next(search)
        while True:
            view = next((taken for taken in self._seen if _in_the_middle(taken, asked)), None)
            if view is None:
                taken = yield from self._taken(self.whole, asked)
                view = None if taken is None else taken.view
                self._seen += [] if view is None else [view]
            try:
                asked = search.send(view)
            except StopIteration as ended:
                found: Reacquired = ended.value
                return found

    def _taken(self, cameras: MastCameras, point: Array) -> Doing[Sighting | None]:
        """Take a pair towards a believed point (3,), m; none where that cannot be."""
        yield from self.hardware.spend("track_update")
        try:
            return cameras.stereo(point)
        except (CameraError, RenderError, TrackerError):
            return None

    def _pose(self, stop: KeptStop, answer: Reacquired, motion: Motion) -> PoseFound:
        """Return where the rover stands; roll and pitch are those of the inertial unit."""
        here = self.hardware.believed
        back = motion.new_from_old.inverse()
        x, y, z = (float(v) for v in back.apply((here.x, here.y, here.z)))
        yaw = math.atan2(back.rotation[1, 0] - back.rotation[0, 1], back.rotation[0, 0] + back.rotation[1, 1])
        pose = replace(here, x=x, y=y, z=z, heading=wrap_angle(here.heading + float(yaw)))
        arm = np.array((here.x, here.y, here.z)) - motion.centre
        slope = np.zeros((4, 6))
        slope[:3, :3], slope[:3, 3:], slope[3, 2] = -cross(arm), np.eye(3), 1.0
        turned = np.eye(4)
        turned[:3, :3] = back.rotation
        slope = turned @ slope
        covariance = slope @ motion.covariance @ slope.T
        # the mast was off by itself in both pictures
        covariance[3, 3] += 2.0 * stop.map.pointing_rad**2
        known = copy.deepcopy(stop.map)
        known.found(pose, pose, covariance)
        return PoseFound(pose, covariance, known, stop, answer)


def _in_the_middle(view: StereoView, point: Array) -> bool:
    """Return whether a pair has a point (3,), m, in the middle half of its left picture."""
    return view.shows(np.asarray(view.left_camera.project(point)), 0.25 * min(view.left.shape))


def _agree(one: Pose, other: Pose) -> bool:
    apart = math.dist((one.x, one.y, one.z), (other.x, other.y, other.z))
    return apart < AGREED_M and abs(wrap_angle(one.heading - other.heading)) < AGREED_RAD
