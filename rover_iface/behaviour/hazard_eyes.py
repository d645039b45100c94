"""From the mast to the hazard cameras: shape registration on arrival, and the hand-off cascade."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from rover_iface.behaviour.following import Followed
from rover_iface.behaviour.hardware import Hardware
from rover_iface.behaviour.mast_cameras import MastCameras, Sighting
from rover_iface.behaviour.placing import HandedOff
from rover_iface.cameras.model import Array, CameraModel
from rover_iface.errors import CameraError, RenderError, TrackerError
from rover_iface.frames import Pose
from rover_iface.vision.handoff import METHODS, Handoff, Side, hand_off
from rover_iface.vision.handoff_cascade import cascade
from rover_iface.vision.narrow_range import NarrowSight, narrow_sight
from rover_iface.vision.shape_tracker import CombinedTracker
from rover_iface.vision.tracker import StereoView, TrackState, TrackUpdate

ARRIVED_M = 2.2
"""Distance from the mast cameras at which a target counts as arrived at."""

NARROW_M = 3.5
"""Distance from which on a new target is ranged by the narrow pair; nearer, the navcams know enough."""

PUBLISHED = {
    "kinematic": "pure kinematic",
    "alternate": "alternate kinematic",
    "refined": "refined kinematic",
    "geometric": "pure geometric",
    "draped": "refined geometric",
    "registration": "registration",
}
"""Methods of the command dictionary, by their names in the study."""


Narrow = Callable[[Array], StereoView]
"""Takes a pair with the narrow cameras round a believed point (3,)."""


class ArrivalTracker:
    """A `Tracker`: features on the way, and shape registration with earlier views once the target is near.

    A target that the features have lost, even failed, is tracked again if registration finds it, as the
    single-cycle instrument placement paper reports; one that they have is settled where both agree. A target
    that is far when it is designated is looked at by the narrow pair too, if there is one: it ranges better,
    and its picture is what the near navcams go back to (`CombinedTracker.recall`).
    """

    def __init__(
        self,
        tracker: CombinedTracker | None = None,
        *,
        arrived_m: float = ARRIVED_M,
        narrow: Narrow | None = None,
    ) -> None:
        self.tracker = tracker or CombinedTracker()
        self.arrived_m = arrived_m
        self.narrow = narrow
        self.settled: dict[str, TrackUpdate] = {}

    def start(self, target: str, position: npt.ArrayLike, view: StereoView) -> TrackUpdate:
        """See `Tracker`."""
        narrow = self._narrow(np.asarray(position, dtype=np.float64), view)
        return self.tracker.start(target, position, view, narrow=narrow)

    def _narrow(self, position: Array, view: StereoView) -> NarrowSight | None:
        """Return the target in the narrow pair; None where that is not needed or does not show it."""
        away = float(np.linalg.norm(position - view.left_camera.C))
        pixel = np.asarray(view.left_camera.project(position), dtype=np.float64)
        if self.narrow is None or away < NARROW_M or not np.isfinite(pixel).all():
            return None
        try:
            pair = self.narrow(position)
        except (CameraError, RenderError, TrackerError):
            return None
        return narrow_sight(view, pixel, pair, away)

    def update(self, target: str, view: StereoView) -> TrackUpdate:
        """See `Tracker`."""
        update = self.tracker.update(target, view)
        self.settled.pop(target, None)
        recalled = self.tracker.recall(target, view)
        if recalled is not None:
            self.settled[target] = recalled
            return recalled
        away = float(np.linalg.norm(update.position - view.left_camera.C))
        if away > self.arrived_m:
            return update
        found, registration = self.tracker.settle(target, view, nearest_m=0.6)
        if found.state is TrackState.LOST and update.state is TrackState.TRACKED:
            # two ways of looking contradict each other: the features, with their own test, are not given up
            return replace(update, reasons=found.reasons)
        if registration is not None:
            self.settled[target] = found
        return found

    def predicted(self, target: str) -> Array:
        """See `Tracker`."""
        settled = self.settled.get(target)
        return self.tracker.predicted(target) if settled is None else settled.position

    def clear(self, target: str) -> None:
        """See `Tracker`."""
        self.settled.pop(target, None)
        self.tracker.clear(target)


class HazardEyes:
    """Hands targets to the hazcams (`Handoff`); keeps the pair it looked with for what follows at that stop.

    `answers` tells, for each target, how it went: method, error in pixels, reasons.
    """

    def __init__(self, hardware: Hardware, cameras: MastCameras) -> None:
        self.hardware = hardware
        self.cameras = cameras
        self.answers: dict[str, dict[str, object]] = {}
        self._pair: tuple[Pose, Sighting] | None = None
        self._handed: dict[str, tuple[Pose, HandedOff]] = {}
        self._near: dict[str, tuple[Pose, StereoView]] = {}

    def pair(self) -> Sighting:
        """Return the hazcam pair of this stop, cameras in the believed site frame.

        Raises
        ------
        RenderError
            If a camera is below the ground.
        """
        here = self.hardware.believed
        if self._pair is None or self._pair[0] != here:
            self._pair = (here, self.cameras.body_pair("hazcam"))
        return self._pair[1]

    def forget(self, target: str) -> None:
        """Look anew for a target when asked next, though the rover has not moved."""
        self._pair = None
        self._handed.pop(target, None)
        self._near.pop(target, None)

    def sees(self, followed: Followed) -> bool:
        """Return whether the left hazard camera has a target in its frame, by where it is believed to be."""
        rover_from_site = self.hardware.believed.site_from_rover.inverse()
        camera = self.cameras.rig.camera(self.hardware.profile.cameras.hazard)
        return bool(camera.sees(rover_from_site.apply(followed.update.position)))

    def at_this_stop(self, followed: Followed) -> HandedOff:
        """Return the hand-off of a target made at this stop, made now if there is none.

        Raises
        ------
        TrackerError
            If it is refused.
        """
        known = self._handed.get(followed.target.id)
        if known is not None and known[0] == self.hardware.believed:
            return known[1]
        return self.hand_off(followed, "")

    def near(self, target: str) -> StereoView | None:
        """Return the navcam pair that a target was handed off from at this stop, None without one."""
        known = self._near.get(target)
        return known[1] if known is not None and known[0] == self.hardware.believed else None

    def hand_off(self, followed: Followed, method: str) -> HandedOff:
        """See `Handoff` of the rover's placing; the default method is the cascade from the near navcams."""
        name = followed.target.id
        if not self.sees(followed):
            raise TrackerError(f"the hazard camera does not see target {name}")
        try:
            near = self.cameras.stereo(followed.update.position).view
        except (CameraError, RenderError) as err:
            raise TrackerError(f"target {name} cannot be looked at for the hand-off: {err}") from err
        self._near[name] = (self.hardware.believed, near)
        haz = self.pair().view
        pixel = np.asarray(near.left_camera.project(followed.update.position), dtype=np.float64)
        given = Handoff(Side(haz, 0.3), Side(near, 0.8), pixel)
        if method and method != "cascade":
            handed = self._published(followed, given, method)
        else:
            handed = self._cascade(followed, given)
        self._handed[name] = (self.hardware.believed, handed)
        return handed

    def _cascade(self, followed: Followed, given: Handoff) -> HandedOff:
        name = followed.target.id
        answer = cascade(given, "near")
        self.answers[name] = {
            "method": "cascade",
            "accepted": answer.accepted,
            "agreeing": answer.agreeing,
            "score": answer.score,
            "error_px": answer.error_px if answer.accepted else None,
            "reasons": list(answer.reasons),
        }
        if not answer.accepted:
            raise TrackerError(f"hand-off of target {name} refused: {'; '.join(answer.reasons)}")
        camera = given.hazcam.view.left_camera
        return _handed(followed, camera, answer.pixel, answer.position, answer.error_px, answer.score)

    def _published(self, followed: Followed, given: Handoff, method: str) -> HandedOff:
        name, published = followed.target.id, PUBLISHED.get(method, "")
        if published not in METHODS:
            raise TrackerError(f'hand-off "{method}"; there are cascade, {", ".join(PUBLISHED)}')
        found = hand_off(published, "near", given)
        match = None if found is None else given.hazcam.point(found.pixel)
        self.answers[name] = {"method": published, "accepted": match is not None}
        if found is None or match is None:
            raise TrackerError(f"hand-off of target {name} by the {published} method found nothing")
        # none of the published methods knows its error: that of the tracked position stands in
        camera = given.hazcam.view.left_camera
        away = float(np.linalg.norm(match.point - camera.C))
        sigma = math.sqrt(float(np.trace(followed.update.covariance)) / 3)
        return _handed(followed, camera, found.pixel, match.point, camera.hs * sigma / away, found.score)


def _handed(
    followed: Followed, camera: CameraModel, pixel: Array, position: Array, error_px: float, score: float
) -> HandedOff:
    sigma = error_px * float(np.linalg.norm(position - camera.C)) / camera.hs + 0.001
    update = replace(
        followed.update,
        position=np.asarray(position, dtype=np.float64),
        covariance=sigma**2 * np.eye(3),
        confidence=min(1.0, max(score, followed.update.confidence)),
        pixel=np.asarray(pixel),
        reasons=(),
    )
    return HandedOff(update, float(error_px))
