"""From the mast to the hazard cameras: hand-off by a registered method on the pairs of one stop."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from rover_iface.behaviour.following import Followed
from rover_iface.behaviour.hardware import Hardware
from rover_iface.behaviour.mast_cameras import MastCameras, Sighting
from rover_iface.behaviour.placing import HandedOff
from rover_iface.cameras.model import Array
from rover_iface.errors import CameraError, RenderError, TrackerError
from rover_iface.frames import Pose
from rover_iface.vision.handoff import Handoff, Side
from rover_iface.vision.handoffs import Found, Refused, find_handoff
from rover_iface.vision.narrow.crest import beside_m, open_along_m, open_depth_m
from rover_iface.vision.narrow.references import angle_rad
from rover_iface.vision.tracker import StereoView

FoundIn = Callable[[str, StereoView], Array | None]
"""Gives the pixel (2,) of a tracked target in the left image of another pair of a stop, None if unknown."""


class HazardEyes:
    """Hands targets to the hazcams (`Handoff`); keeps the pair it looked with for what follows at that stop.

    `answers` tells, for each target, how it went: method, error in pixels, reasons. `found` is asked where
    a target is in the navcam pair that is taken for it. Where nobody knows, it is where its position has it;
    the mast's noise between two looks is in that.
    """

    def __init__(self, hardware: Hardware, cameras: MastCameras, found: FoundIn | None = None) -> None:
        self.hardware = hardware
        self.cameras = cameras
        self.found = found
        self.answers: dict[str, Mapping[str, object]] = {}
        self._pair: tuple[Pose, Sighting] | None = None
        self._handed: dict[str, tuple[Pose, HandedOff]] = {}
        self._near: dict[str, tuple[Pose, StereoView, Array]] = {}

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

    def near_pixel(self, target: str) -> Array | None:
        """Return the pixel (2,) of a target in the left image of that pair, None without one."""
        known = self._near.get(target)
        return known[2] if known is not None and known[0] == self.hardware.believed else None

    def hand_off(self, followed: Followed, method: str) -> HandedOff:
        """See `Handoff` of the rover's placing; the default method is the cascade from the near navcams."""
        name, find = followed.target.id, find_handoff(method)
        if not self.sees(followed):
            raise TrackerError(f"the hazard camera does not see target {name}")
        try:
            near = self.cameras.stereo(followed.update.position).view
        except (CameraError, RenderError) as err:
            raise TrackerError(f"target {name} cannot be looked at for the hand-off: {err}") from err
        haz = self.pair().view
        seen = None if self.found is None else self.found(name, near)
        pixel = near.left_camera.project(followed.update.position) if seen is None else seen
        pixel = np.asarray(pixel, dtype=np.float64)
        self._near[name] = (self.hardware.believed, near, pixel)
        given = Handoff(Side(haz, 0.3), Side(near, 0.8), pixel)
        answer = find(given)
        self.answers[name] = answer.about
        if isinstance(answer, Refused):
            raise TrackerError(f"hand-off of target {name} {answer.why}")
        handed = _handed(followed, given, answer)
        self._handed[name] = (self.hardware.believed, handed)
        return handed


def _handed(followed: Followed, given: Handoff, found: Found) -> HandedOff:
    """Return a hand-off; where a method does not know its error, that of the tracked position stands in.

    It says nothing of which spot was meant: what the track tells of that stays. The hazcams range what they
    are shown, so what counts is how deep the surface is in their picture, not in the track's.
    """
    near = given.source("near")[0].view
    camera, eye = given.hazcam.view.left_camera, near.left_camera.C
    ray = found.position - camera.C
    away = float(np.linalg.norm(ray))
    error_px = found.error_px
    if error_px is None:
        error_px = camera.hs * math.sqrt(float(np.trace(followed.update.covariance)) / 3) / away
    sigma = error_px * away / camera.hs + 0.001
    sight = followed.update.position - followed.view.left_camera.C
    sight = sight / np.linalg.norm(sight)
    meant = followed.update.covariance - followed.update.deep_m**2 * np.outer(sight, sight)
    off_m = math.sqrt(0.5 * float(np.trace(meant) - sight @ meant @ sight) + sigma**2)
    deep = open_depth_m(given.hazcam, found.pixel, away, off_m * camera.hs / away)
    # what is a crest for the navcams may be a plain face for the hazcams
    shown = near.left_camera.project(found.position)
    open_m = open_along_m(given.hazcam, near.left_camera, shown, found.position, off_m)
    turned_rad = angle_rad(ray, found.position - eye)
    aside = max(beside_m(deep, turned_rad), open_m * math.sin(turned_rad))
    along = np.outer(ray, ray) / away**2
    update = replace(
        followed.update,
        position=np.asarray(found.position, dtype=np.float64),
        covariance=meant + (sigma**2 + aside**2) * np.eye(3) + deep**2 * along,
        confidence=min(1.0, max(found.score, followed.update.confidence)),
        pixel=np.asarray(found.pixel),
        reasons=(),
        deep_m=0.0,
    )
    return HandedOff(update, float(error_px))
