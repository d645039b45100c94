"""From the mast to the tool: the commands `handoff` and `ipplaceinstrument`.

Here the way of the tool is left to the arm's own controller (`Hardware.reach`); `arm_placing` plans it.
"""

from __future__ import annotations

import json
import math
from collections.abc import Generator
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from executive.ports import Command, Value
from mission.instrument import Use
from rover_iface.behaviour.action import Action, Outcome, Step, number
from rover_iface.behaviour.base_moves import MOVES, BaseMoves
from rover_iface.behaviour.following import Followed, TargetFollower
from rover_iface.behaviour.hardware import Contact, Hardware
from rover_iface.behaviour.mast_cameras import MastCameras
from rover_iface.behaviour.products import picture_label, png
from rover_iface.cameras.model import Array
from rover_iface.errors import CameraError, RenderError, RoverError, TrackerError
from rover_iface.vision.correlation.judging import ASTRAY
from rover_iface.vision.tracker import TrackUpdate

MOST_OFF_M = 0.02
"""95 % error on the surface up to which a tool is put on a target: further off it is not a placement
(Pedersen and others 2005 place within 1 cm; 2 cm is asked for here)."""
TOUCHED_OFF_M = 0.015
"""How far from its target a tool may be believed to have touched: where both are known to half a centimetre,
it is within 2 cm then. On days looked at (1061916257, 477206370) two were believed so, 2.2 and 2.8 cm off."""
RELIEF_SLOPE = 0.5
"""What lies astray across a surface lies deeper or higher by so much of it: `NccOptions.relief_slope`."""
INSIDE_95 = 5.991
"""95 % of chi square with two degrees of freedom."""


@dataclass(frozen=True, eq=False)
class HandedOff:
    """A target as the receiving camera has it: where it is now believed to be, and the error in pixels."""

    update: TrackUpdate
    error_px: float


class Handoff(Protocol):
    """Finds a tracked target again in the hazard cameras."""

    def hand_off(self, followed: Followed, method: str) -> HandedOff:
        """Return the target in the receiving camera; `method` as commanded, empty for the rover's choice.

        Raises
        ------
        TrackerError
            If the camera does not see it, or the answer is not to be trusted; the message says why.
        """

    def at_this_stop(self, followed: Followed) -> HandedOff:
        """Return the hand-off of a target that a tool is to be put on from here, made now if there is none.

        Raises
        ------
        TrackerError
            If it is refused.
        """


class KinematicHandoff:
    """Takes the tracked position over as it is; its error is that of tracker and mast."""

    def __init__(self, hardware: Hardware, cameras: MastCameras) -> None:
        self.hardware = hardware
        self.cameras = cameras

    def hand_off(self, followed: Followed, method: str) -> HandedOff:
        """See `Handoff`."""
        del method
        rover = self.hardware.believed.site_from_rover.inverse().apply(followed.update.position)
        camera = self.cameras.rig.camera(self.hardware.profile.cameras.hazard)
        if not bool(camera.sees(rover)):
            raise TrackerError(f"the hazard camera does not see target {followed.target.id}")
        handed = self.at_this_stop(followed)
        away = float(np.linalg.norm(rover - camera.C))
        sigma = math.sqrt(float(np.trace(handed.update.covariance)) / 3)
        return HandedOff(handed.update, float(camera.hs * sigma / max(away, 0.1)))

    def at_this_stop(self, followed: Followed) -> HandedOff:
        """See `Handoff`; the tracker knows a place relative to the cameras, and the mast holds them askew."""
        eye, mast = followed.view.left_camera.C, self.hardware.profile.mast
        ray = followed.update.position - eye
        away = float(np.linalg.norm(ray))
        across = np.eye(3) - np.outer(ray, ray) / away**2
        askew = (mast.bias_rad**2 + mast.noise_rad**2) * away**2 * across
        return HandedOff(replace(followed.update, covariance=followed.update.covariance + askew), math.nan)


class TestedHandoff:
    """Hands off by the hazcams' own picture, and by the mast's angles where that is refused."""

    def __init__(self, eyes: Handoff, by_mast: KinematicHandoff) -> None:
        self.eyes = eyes
        self.by_mast = by_mast

    def hand_off(self, followed: Followed, method: str) -> HandedOff:
        """See `Handoff`."""
        return (self.eyes if method else self.by_mast).hand_off(followed, method)

    def at_this_stop(self, followed: Followed) -> HandedOff:
        """See `Handoff`; where the hazcams contradict track and mast nothing tells which of them is wrong."""
        tracked = self.by_mast.at_this_stop(followed)
        try:
            handed = self.eyes.at_this_stop(followed)
        except (TrackerError, CameraError, RenderError):
            return tracked
        gap = handed.update.position - tracked.update.position
        # what the track is off is in both
        open_m2 = tracked.update.covariance + handed.update.covariance - followed.update.covariance
        if float(gap @ np.linalg.solve(open_m2, gap)) > ASTRAY:
            off_cm = 100.0 * float(np.linalg.norm(gap))
            name = followed.target.id
            raise TrackerError(
                f"the hazard cameras have target {name} {off_cm:.1f} cm from where track and mast have it"
            )
        return handed


def require_known(followed: Followed, arm_m: float) -> None:
    """Refuse to put a tool on a target whose place is known too poorly.

    What the tool's axis is off along itself the contact takes up; what it is off across decides which
    point is touched. That point lies deeper or higher than the target by the relief of rock.

    Raises
    ------
    TrackerError
        If the 95 % error of the point that is touched, the arm's own in it, is over the limit.
    """
    across = across_m(followed.update.covariance, followed.target.normal, arm_m)
    off_m = across * math.hypot(1.0, RELIEF_SLOPE)
    if off_m > MOST_OFF_M:
        raise TrackerError(
            f"target {followed.target.id} is known to {100 * off_m:.1f} cm on its surface (95 %); "
            f"{100 * MOST_OFF_M:.0f} cm is the limit"
        )


def across_m(covariance: Array, normal: npt.ArrayLike, arm_m: float) -> float:
    """Return the half axis, metres, of the 95 % ellipse of a covariance (3, 3), m^2, across a normal (3,).

    The arm's largest error `arm_m` is taken for two deviations.
    """
    up = np.asarray(normal, dtype=np.float64)
    up = up / np.linalg.norm(up)
    flat = np.eye(3) - np.outer(up, up)
    largest = float(np.linalg.eigvalsh(flat @ covariance @ flat)[-1])
    return math.sqrt(INSIDE_95 * (largest + (arm_m / 2.0) ** 2))


def beside(contact: Contact, target: Array) -> str:
    """Return why a tool that has touched does not stand on a target (3,), believed site frame, or nothing.

    At an edge what is 2 mm off across lies centimetres deeper: no relief of rock, and nothing that was known.
    """
    off_m = float(np.linalg.norm(contact.point - target))
    if off_m <= TOUCHED_OFF_M:
        return ""
    return (
        f"the surface under the tool lies {100 * off_m:.1f} cm from the target; "
        f"{100 * TOUCHED_OFF_M:.1f} cm is the limit"
    )


class Placing:
    """Hands targets off and places instruments on them."""

    def __init__(
        self,
        hardware: Hardware,
        cameras: MastCameras,
        follower: TargetFollower,
        handoff: Handoff,
        moves: BaseMoves,
    ) -> None:
        self.hardware = hardware
        self.cameras = cameras
        self.follower = follower
        self.handoff = handoff
        self.moves = moves

    def hand_off(self, command: Command) -> Action:
        """Carry out `handoff`."""
        name = str(command.parameters["target"])
        energy = yield from self.hardware.spend("handoff")
        try:
            followed = self.follower.in_sight(name)
            handed = self.handoff.hand_off(followed, str(command.parameters.get("method", "")))
        except TrackerError as err:
            return Outcome(False, str(err), {"energy_j": energy})
        followed.update = handed.update
        values: dict[str, Value] = {
            "error_px": handed.error_px,
            "confidence": float(handed.update.confidence),
            "energy_j": energy,
        }
        return Outcome(True, values=values)

    def place(self, command: Command) -> Action:
        """Carry out `ipplaceinstrument`."""
        name = str(command.parameters["target"])
        instrument = str(command.parameters.get("instrument", self._usual_instrument()))
        if name not in self.follower.targets:
            return Outcome(False, f"unknown target {name}", {"made": False})
        try:
            followed = self.follower.in_sight(name)
            figures = self.hardware.profile.instrument(instrument)
        except RoverError as err:
            return Outcome(False, str(err), {"made": False})
        begin_j = self.hardware.drawn_j
        try:
            contact = yield from self._reach_moving(followed, instrument)
        except RoverError as err:
            followed.refused = True
            yield from self.hardware.spend("handoff")
            return Outcome(False, str(err), {"made": False, "energy_j": self.hardware.drawn_j - begin_j})
        reason = contact.reason if not contact.made else beside(contact, followed.update.position)
        if reason:
            followed.refused = True
            yield from self.hardware.spend("handoff")
            reason = f"target {name}: {reason}"
            return Outcome(False, reason, {"made": False, "energy_j": self.hardware.drawn_j - begin_j})
        yield from self.hardware.operate(figures, number(command, "dwell_s", 0.0))
        values: dict[str, Value] = {"made": True, "energy_j": self.hardware.drawn_j - begin_j}
        if not self.hardware.instrument_delivers(figures):
            self.follower.forget(name)
            return Outcome(False, "no usable product", values)
        values["products"] = float(self._write_products(command, name, instrument, contact))
        self.follower.forget(name)
        return Outcome(True, values=values)

    def _reach_moving(self, followed: Followed, instrument: str) -> Generator[Step, None, Contact]:
        """Return the contact with a target, the base moved where the arm does not reach it from here.

        Raises
        ------
        RoverError
            If the arm reaches it from nowhere near, with the first reason; or the target is lost, or a wheel
            stuck, on the way.
        """
        name = followed.target.id
        unreached: RoverError | None = None
        for tried in range(MOVES + 1):
            # a move of the base brings another look, and may tell more of the target than was known
            try:
                followed.update = self.handoff.at_this_stop(followed).update
                require_known(followed, self.hardware.profile.arm.accuracy_m)
                return self.hardware.reach(name, followed.update.position, instrument)
            except RoverError as err:
                unreached = unreached or err
            if tried == MOVES or not (yield from self.moves.nearer(followed, first=tried == 0)):
                break
        assert unreached is not None
        raise unreached

    def _usual_instrument(self) -> str:
        return self.hardware.profile.usual_instrument(Use.CONTACT)

    def write_measurement(self, command: Command, name: str, instrument: str, contact: Contact) -> int:
        """Write what an instrument without a camera leaves: what was measured, where, and for how long."""
        document = {
            "target": name,
            "instrument": instrument,
            "doc": self.hardware.profile.instrument(instrument).doc,
            "point_site": [round(float(v), 4) for v in contact.point],
            "dwell_s": number(command, "dwell_s", 0.0),
        }
        data = (json.dumps(document, indent=1) + "\n").encode()
        label = {"target": name, "instrument": instrument, "frame": "site"}
        return self.hardware.write_product(command, "measurement", data, ".json", label)

    def _write_products(self, command: Command, name: str, instrument: str, contact: Contact) -> int:
        """Write what the hazard camera and the contact instrument see."""
        if not self.hardware.keeps_products:
            return 0
        count = 0
        label: dict[str, Any] = {"target": name, "instrument": instrument}
        hazard = self.hardware.profile.cameras.hazard
        try:
            shot = self.cameras.body_picture(hazard)
        except RenderError:
            pass
        else:
            about = picture_label(shot.camera, self.follower.position(name))
            count += self.hardware.write_product(
                command,
                "hazcam",
                png(shot.picture.image8),
                ".png",
                {**label, "camera": hazard, **about},
                picture=shot.picture.number,
            )
        camera = self.hardware.profile.instrument(instrument).camera
        if not camera:
            return count + self.write_measurement(command, name, instrument, contact)
        try:
            seen = self.hardware.take_close_up(camera)
        except RenderError:
            return count
        about = picture_label(seen.camera, contact.point)
        return count + self.hardware.write_product(
            command, "microscopic", png(seen.image), ".png", {**label, **about}, picture=seen.number
        )
