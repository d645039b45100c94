"""From the mast to the tool: the commands `handoff` and `ipplaceinstrument` of a rover on terrain."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from executive.ports import Command, Value
from rover_iface.cameras.model import CameraModel, pinhole
from rover_iface.errors import PlacementError, RenderError, RoverError, TrackerError
from rover_iface.placement.base_placement import check_observation_point
from rover_iface.simulator.body import Body
from rover_iface.simulator.engine import Action, Outcome, Step, milliseconds, number
from rover_iface.simulator.following import Followed, TargetFollower
from rover_iface.simulator.mast_cameras import MastCameras, Shot
from rover_iface.simulator.products import picture_label, png
from rover_iface.simulator.routine import RoutineRover
from rover_iface.vision.tracker import TrackUpdate

Array = NDArray[np.floating]


@dataclass(frozen=True, eq=False)
class HandedOff:
    """A target as the receiving camera has it: where it is now believed to be, and the error in pixels."""

    update: TrackUpdate
    error_px: float


class Handoff(Protocol):
    """Finds a tracked target again in the hazard cameras."""

    def hand_off(self, followed: Followed, method: str, t_s: float) -> HandedOff:
        """Return the target in the receiving camera; `method` as commanded, empty for the rover's choice.

        Raises
        ------
        TrackerError
            If the camera does not see it, or the answer is not to be trusted; the message says why.
        """


@dataclass(frozen=True, eq=False)
class Contact:
    """Where the tool touches (3,) and against which outward normal (3,), true site frame."""

    point: Array
    normal: Array


class Placement(Protocol):
    """Decides whether and where a contact instrument may touch a target."""

    def contact(self, followed: Followed, instrument: str, t_s: float) -> Contact:
        """Return where the tool comes to touch.

        Raises
        ------
        PlacementError
            If the arm does not reach or the place is not safe; the message says why.
        """


class KinematicHandoff:
    """Takes the tracked position over as it is; its error follows from the tracker's covariance."""

    def __init__(self, body: Body, cameras: MastCameras) -> None:
        self.body = body
        self.cameras = cameras

    def hand_off(self, followed: Followed, method: str, t_s: float) -> HandedOff:
        """See `Handoff`."""
        del method, t_s
        rover = self.body.believed.site_from_rover.inverse().apply(followed.update.position)
        camera = self.cameras.rig.camera(self.body.profile.cameras.hazard)
        if not bool(camera.sees(rover)):
            raise TrackerError(f"the hazard camera does not see target {followed.target.id}")
        away = float(np.linalg.norm(rover - camera.C))
        sigma = math.sqrt(float(np.trace(followed.update.covariance)) / 3)
        return HandedOff(followed.update, float(camera.hs * sigma / max(away, 0.1)))


class ReachPlacement:
    """Touches where the target is believed to be, if arm and ground allow it by the true terrain."""

    def __init__(self, body: Body) -> None:
        self.body = body

    def contact(self, followed: Followed, instrument: str, t_s: float) -> Contact:
        """See `Placement`."""
        del t_s
        point = self.body.true_from_believed.apply(followed.update.position)
        spot = [float(v) for v in point]
        check_observation_point(
            self.body.terrain,
            self.body.profile,
            self.body.pose,
            spot,
            target=followed.target.id,
            instrument=instrument,
        )
        return Contact(point, self.body.terrain.normal(spot[0], spot[1], 0.08))


class Placing:
    """Hands targets off and places instruments on them."""

    def __init__(
        self,
        host: RoutineRover,
        body: Body,
        cameras: MastCameras,
        follower: TargetFollower,
        handoff: Handoff,
        placement: Placement,
    ) -> None:
        self.host = host
        self.body = body
        self.cameras = cameras
        self.follower = follower
        self.handoff = handoff
        self.placement = placement

    def hand_off(self, command: Command) -> Action:
        """Carry out `handoff`."""
        name = str(command.parameters["target"])
        duration, energy = self.host.spread("handoff")
        yield Step(duration, energy)
        followed = self.follower.tracked(name)
        if followed is None:
            return Outcome(False, f"target {name} is not tracked", {"energy_j": energy})
        try:
            handed = self.handoff.hand_off(followed, str(command.parameters.get("method", "")), self.host.t_s)
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
        instrument = str(command.parameters.get("instrument", self._contact_instrument()))
        if name not in self.body.targets:
            return Outcome(False, f"unknown target {name}", {"made": False})
        followed = self.follower.tracked(name)
        if followed is None:
            return Outcome(False, f"target {name} is not tracked", {"made": False})
        try:
            figures = self.body.profile.instrument(instrument)
        except RoverError as err:
            return Outcome(False, str(err), {"made": False})
        try:
            contact = self.placement.contact(followed, instrument, self.host.t_s)
        except (PlacementError, RoverError) as err:
            duration, energy = self.host.spread("handoff")
            yield Step(duration, energy)
            return Outcome(False, str(err), {"made": False, "energy_j": energy})
        dwell = number(command, "dwell_s", 0.0)
        duration_ms, energy = self.host.drawn(figures, self.body.rng)
        yield Step(duration_ms + milliseconds(dwell), energy)
        error = float(np.linalg.norm(contact.point - followed.truth))
        values: dict[str, Value] = {"made": True, "energy_j": energy, "placement_error_m": error}
        if self.body.rng.random() >= figures.p_success or self.host.camera_failed:
            self.follower.forget(name)
            return Outcome(False, "no usable product", values)
        values["products"] = float(self._write_products(command, name, instrument, contact, error))
        self.follower.forget(name)
        return Outcome(True, values=values)

    def _contact_instrument(self) -> str:
        return next((n for n, i in self.body.profile.instruments.items() if i.kind == "contact"), "mi")

    def _write_products(
        self, command: Command, name: str, instrument: str, contact: Contact, error: float
    ) -> int:
        """Write what the hazard camera and the contact instrument see."""
        if self.host.out is None:
            return 0
        count = 0
        label: dict[str, Any] = {"target": name, "instrument": instrument}
        believed_from_true = self.body.true_from_believed.inverse()
        truth = self.follower.truth(name)

        def write(kind: str, shot: Shot, point: Array, **more: str) -> int:
            seen = picture_label(shot.camera, point, self.body, shot.frame.camera, truth)
            seen["simulation_truth"]["placement_error_m"] = error
            return int(
                self.host.write_product(
                    command, kind, png(shot.frame.image8), ".png", {**label, **more, **seen}
                )
            )

        hazard = self.body.profile.cameras.hazard
        try:
            shot = self.cameras.body_picture(hazard, self.host.t_s)
            count += write("hazcam", shot, self.follower.position(name), camera=hazard)
        except RenderError:
            pass
        close = close_up(contact.point, contact.normal)
        try:
            frame = self.body.renderer.render(close, None, self.body.sun(self.host.t_s), samples=2)
        except RenderError:
            return count
        shot = Shot(frame, close.transformed(believed_from_true))
        return count + write("microscopic", shot, believed_from_true.apply(contact.point))


def close_up(point: Array, normal: Array, distance_m: float = 0.11, field_m: float = 0.05) -> CameraModel:
    """Return the camera of a microscopic imager over a point (3,), looking against the normal (3,), site
    frame.
    """
    away = np.asarray(normal, dtype=float)
    away = away / np.linalg.norm(away)
    up = np.array([0.0, 1.0, 0.0]) if abs(away[2]) > 0.9 else np.array([0.0, 0.0, 1.0])
    pixels = 256
    return pinhole(
        focal_px=pixels * distance_m / field_m,
        width=pixels,
        height=pixels,
        center=np.asarray(point, dtype=float) + distance_m * away,
        forward=-away,
        up=up,
    )
