"""The `full` rover's placing: hazcam cloud, safety, arm, contact, and what the microscopic imager brings."""

from __future__ import annotations

import json
import math
from collections.abc import Generator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from executive.ports import Command, Value
from rover_iface.cameras.model import Array, CameraModel
from rover_iface.errors import CameraError, PlacementError, RenderError, RoverError, TrackerError
from rover_iface.frames import Pose, wrap_angle
from rover_iface.placement.arm import Arm, ArmRefusal
from rover_iface.placement.arm_motion import Motion, Obstacles, plan_motion
from rover_iface.placement.base_adjustment import base_move
from rover_iface.placement.base_placement import REACH_SHARE
from rover_iface.placement.cloud import SurfaceCloud
from rover_iface.placement.cloud_alignment import Alignment
from rover_iface.placement.safety import plan_placement
from rover_iface.placement.safety_limits import SafetyLimits
from rover_iface.placement.segmentation import Segmentation, SegmentationOptions, segment
from rover_iface.placement.verdict import BaseMove, PlacementVerdict
from rover_iface.profile import Instrument
from rover_iface.simulator.body import Body
from rover_iface.simulator.contact import Touch, place_tool
from rover_iface.simulator.driving import Driving
from rover_iface.simulator.engine import Action, Outcome, Step, milliseconds, number
from rover_iface.simulator.following import Followed, TargetFollower
from rover_iface.simulator.hazard_eyes import HazardEyes
from rover_iface.simulator.mast_cameras import MastCameras, Shot
from rover_iface.simulator.microscope import CloseUp, close_up
from rover_iface.simulator.placing import Contact, HandedOff, Placing
from rover_iface.simulator.placing_clouds import hazcam_cloud, mast_cloud
from rover_iface.simulator.products import picture_label, png
from rover_iface.simulator.routine import RoutineRover

NEAR_M = 0.015
"""How far from the designated point a safe one may be taken; with hand-off and arm that keeps 2 cm."""

MOVES, FARTHEST_MOVE_M, MOST_TURN_RAD = 2, 0.5, 0.8
"""How often, how far and with how much of a turn the rover moves without a look so that the arm reaches."""

IMAGER = "mi"


@dataclass(frozen=True, eq=False)
class Attempt:
    """One placement as it was decided and carried out; rover frame where not said otherwise.

    `laid` is the mast's cloud as it was laid on the hazcams' `cloud`, None where that failed.
    """

    handed: HandedOff
    verdict: PlacementVerdict
    cloud: SurfaceCloud
    segmentation: Segmentation
    laid: Alignment | None
    motion: Motion | None
    touch: Touch | None


class ArmPlacing(Placing):
    """Hands a target off, looks for a safe point, moves the arm until contact, and takes a close-up.

    It is its own `Placement`: what the pictures of the hazcams show decides, not the terrain.
    """

    def __init__(
        self,
        host: RoutineRover,
        body: Body,
        cameras: MastCameras,
        follower: TargetFollower,
        eyes: HazardEyes,
        driving: Driving,
        limits: SafetyLimits | None = None,
    ) -> None:
        super().__init__(host, body, cameras, follower, eyes, self)
        self.eyes = eyes
        self.driving = driving
        self.arm = Arm(body.profile.arm)
        self.limits = limits or SafetyLimits(search_m=NEAR_M)
        self.attempts: dict[str, Attempt] = {}

    def contact(self, followed: Followed, instrument: str, t_s: float) -> Contact:
        """See `Placement`."""
        touch = self._attempt(followed, t_s).touch
        if touch is None or not touch.made:
            reason = "no contact" if touch is None else touch.reason
            raise PlacementError(f"target {followed.target.id}: {reason}")
        return Contact(touch.point, -touch.site_from_tool.rotation[:, 0])

    def place(self, command: Command) -> Action:
        """Carry out `ipplaceinstrument`."""
        name = str(command.parameters["target"])
        instrument = str(command.parameters.get("instrument", self._contact_instrument()))
        if name not in self.body.targets:
            return Outcome(False, f"unknown target {name}", {"made": False})
        followed = self.follower.tracked(name)
        if followed is None:
            return Outcome(False, f"target {name} is not tracked", {"made": False})
        if self.host.camera_failed:
            return Outcome(False, "camera failed", {"made": False})
        try:
            figures = self.body.profile.instrument(instrument)
        except RoverError as err:
            return Outcome(False, str(err), {"made": False})
        begin_j = self.host.drawn_j
        try:
            attempt = yield from self._attempt_moving(followed)
        except (TrackerError, RenderError, CameraError) as err:
            followed.refused = True
            duration, energy = self.host.spread("handoff")
            yield Step(duration, energy)
            return Outcome(False, str(err), {"made": False, "energy_j": self.host.drawn_j - begin_j})
        outcome = yield from self._carry_out(command, name, instrument, figures, followed, attempt)
        return replace(outcome, values={**outcome.values, "energy_j": self.host.drawn_j - begin_j})

    def _attempt_moving(self, followed: Followed) -> Generator[Step, None, Attempt]:
        """Return what comes of a placement, the rover moved where the safety check asks for it.

        Raises
        ------
        TrackerError, RenderError, CameraError
            See `_attempt`.
        """
        stand = self.driving.stand(followed.target.id)
        if stand is not None and not self.eyes.sees(followed):
            yield from self._move(followed, stand)
        attempt = self._attempt(followed, self.host.t_s)
        for _ in range(MOVES):
            move = attempt.verdict.base_move or self._nearer(attempt)
            if move is None:
                break
            wanted = self.body.believed.site_from_rover * move.pose.site_from_rover
            if not (yield from self._move(followed, Pose.from_transform(wanted))):
                break
            attempt = self._attempt(followed, self.host.t_s)
        return attempt

    def _move(self, followed: Followed, pose: Pose) -> Generator[Step, None, bool]:
        """Move to a pose of the believed frame; False, and no move, if that is too far without a look.

        Raises
        ------
        TrackerError
            If the target is lost on the way.
        """
        here = self.body.believed
        if math.hypot(pose.x - here.x, pose.y - here.y) > FARTHEST_MOVE_M:
            return False
        if abs(wrap_angle(pose.heading - here.heading)) > MOST_TURN_RAD:
            return False
        yield Step(*self.host.spread("handoff"))
        yield from self.driving.shift(pose)
        if self.follower.tracked(followed.target.id) is None:
            raise TrackerError(f"target {followed.target.id} was lost while the rover moved for it")
        return True

    def _nearer(self, attempt: Attempt) -> BaseMove | None:
        """Return the move that brings a refused target into the arm's reach; None when it is in reach.

        From too far away a face is seen too poorly to be judged.
        """
        rover_from_site = self.body.believed.site_from_rover.inverse()
        at = np.asarray(rover_from_site.apply(attempt.handed.update.position), dtype=np.float64)
        arm = self.body.profile.arm
        away = float(np.linalg.norm(at - np.array(arm.shoulder_m)))
        if attempt.verdict.accepted or arm.min_reach_m <= away <= REACH_SHARE * arm.reach_m:
            return None
        move = base_move(attempt.cloud, self.body.profile, at, None)
        return None if isinstance(move, str) else move

    def _carry_out(
        self,
        command: Command,
        name: str,
        instrument: str,
        figures: Instrument,
        followed: Followed,
        attempt: Attempt,
    ) -> Generator[Step, None, Outcome]:
        touch = attempt.touch
        if touch is None:
            followed.refused = True
            duration, energy = self.host.spread("handoff")
            yield Step(duration, energy)
            self._write_look(command, name, instrument, attempt)
            return Outcome(False, f"target {name}: {attempt.verdict.text}", {"made": False})
        duration, energy = self.host.drawn(figures, self.body.rng)
        dwell = milliseconds(number(command, "dwell_s", 0.0)) if touch.made else 0
        yield Step(duration + dwell, energy)
        count = self._write_look(command, name, instrument, attempt)
        values: dict[str, Value] = {"made": touch.made}
        if not touch.made:
            self.follower.forget(name)
            return Outcome(False, f"target {name}: {touch.reason}", values)
        error_m = float(np.linalg.norm(touch.point - followed.truth))
        count += self._write_close_up(command, name, instrument, touch, error_m)
        values["placement_error_m"] = error_m
        values["products"] = float(count)
        self.follower.forget(name)
        return Outcome(True, values=values)

    def _attempt(self, followed: Followed, t_s: float) -> Attempt:
        """Return what comes of a placement from here.

        Raises
        ------
        TrackerError
            If the hand-off is refused.
        RenderError, CameraError
            If the hazcams show nothing.
        """
        handed = self.eyes.at_this_stop(followed, t_s)
        followed.update = handed.update
        rover_from_site = self.body.believed.site_from_rover.inverse()
        cloud = hazcam_cloud(self.eyes.pair(t_s).view, rover_from_site)
        mast = self.eyes.near(followed.target.id)
        laid = None if mast is None else mast_cloud(mast, rover_from_site, cloud)
        at = np.asarray(rover_from_site.apply(handed.update.position), dtype=np.float64)
        obstacles = Obstacles.of(self.body.profile, cloud.points)

        def way(point: Array, normal: Array) -> Motion | ArmRefusal:
            return plan_motion(self.arm, obstacles, point, normal)

        found = segment(cloud, SegmentationOptions())
        verdict = plan_placement(
            cloud,
            at,
            self.body.profile,
            limits=self.limits,
            segmentation=found,
            arm=way,
            second=None if laid is None else laid.cloud,
        )
        motion = verdict.posture if isinstance(verdict.posture, Motion) else None
        touch = None
        if verdict.accepted and motion is not None:
            pose = self.body.pose.site_from_rover
            touch = place_tool(self.body.renderer.scene, self.arm, pose, motion, rng=self.body.rng)
        attempt = Attempt(handed, verdict, cloud, found, laid, motion, touch)
        self.attempts[followed.target.id] = attempt
        return attempt

    # ---- products

    def _write_look(self, command: Command, name: str, instrument: str, attempt: Attempt) -> int:
        """Write the hazcam picture, the same with the decision drawn on it, and the decision itself."""
        if self.host.out is None:
            return 0
        hazard = self.body.profile.cameras.hazard
        pair = self.eyes.pair(self.host.t_s)
        shot = Shot(pair.left, pair.view.left_camera)
        label: dict[str, Any] = {
            "target": name,
            "instrument": instrument,
            "camera": hazard,
            **picture_label(
                shot.camera,
                attempt.handed.update.position,
                self.body,
                shot.frame.camera,
                self.follower.truth(name),
            ),
        }
        drawn = overlay(shot.frame.image8, self.cameras.rig.camera(hazard), attempt, self.arm)
        count = int(self.host.write_product(command, "hazcam", png(shot.frame.image8), ".png", label))
        count += int(self.host.write_product(command, "placement", png(drawn), ".png", label))
        document = {
            "target": name,
            "handoff": self.eyes.answers.get(name, {}),
            "verdict": attempt.verdict.as_dict(),
            "text": attempt.verdict.text,
            "mast": None if attempt.laid is None else attempt.laid.as_dict(),
            "joints_rad": None if attempt.motion is None else attempt.motion.contact.tolist(),
            "contact": None if attempt.touch is None else attempt.touch.made,
            "beyond_m": None if attempt.touch is None else _finite(attempt.touch.beyond_m),
        }
        data = (json.dumps(document, indent=1) + "\n").encode()
        about = {"target": name, "instrument": instrument, "frame": "rover"}
        return count + int(self.host.write_product(command, "verdict", data, ".json", about))

    def _write_close_up(
        self, command: Command, name: str, instrument: str, touch: Touch, error_m: float
    ) -> int:
        """Write the merged picture of the imager on the tool."""
        if self.host.out is None:
            return 0
        try:
            seen = self._close_up(touch)
        except RenderError:
            return 0
        believed_from_true = self.body.true_from_believed.inverse()
        camera = seen.frame.camera.transformed(believed_from_true)
        label = {
            "target": name,
            "instrument": instrument,
            "pixel_m": seen.pixel_m,
            "sharp": seen.sharp,
            "planes": len(seen.stack),
            **picture_label(
                camera,
                believed_from_true.apply(touch.point),
                self.body,
                seen.frame.camera,
                self.follower.truth(name),
            ),
        }
        label["simulation_truth"]["placement_error_m"] = error_m
        return int(self.host.write_product(command, "microscopic", png(seen.image), ".png", label))

    def _close_up(self, touch: Touch) -> CloseUp:
        mounted = self.cameras.rig.mounted(IMAGER)
        camera = mounted.model.transformed(touch.site_from_tool)
        sun = self.body.sun(self.host.t_s)
        return close_up(self.body.renderer, camera, sun, sensor=mounted.sensor, seed=self.body.seed)


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None


def overlay(
    image: npt.NDArray[np.uint8], camera: CameraModel, attempt: Attempt, arm: Arm
) -> npt.NDArray[np.uint8]:
    """Return a hazcam image with what was decided, RGB: the rock (orange), the target as handed off (white
    cross), the tool's circle (green; red when refused), the arm at contact (blue).

    `camera` is the left hazcam in the rover frame.
    """
    import cv2

    out = np.repeat(image[:, :, None], 3, axis=2)
    verdict = attempt.verdict
    if verdict.rock is not None:
        points = attempt.cloud.points[attempt.segmentation.labels == verdict.rock.label]
        pixels = _inside(camera.project(points), out.shape)
        tint = out[pixels[:, 1], pixels[:, 0]].astype(np.float64)
        out[pixels[:, 1], pixels[:, 0]] = (0.7 * tint + 0.3 * np.array([255, 150, 40])).astype(np.uint8)
    good, bad, blue = (60, 230, 90), (240, 50, 50), (70, 140, 255)
    if verdict.point is not None and verdict.normal is not None:
        ring = _circle(verdict.point, verdict.normal, arm.profile.tool_radius_m)
        line = np.round(camera.project(ring)).astype(np.int32)
        cv2.polylines(out, [line.reshape(-1, 1, 2)], True, good if verdict.accepted else bad, 2, cv2.LINE_AA)
    if attempt.motion is not None:
        places = arm.joint_places(attempt.motion.contact)
        t = np.linspace(0.0, 1.0, 12)[:, None]
        for a, b in pairwise(places[1:]):
            link = camera.project(a + t * (b - a))
            link = link[np.isfinite(link).all(axis=1)]
            if len(link) > 1:
                cv2.polylines(
                    out, [np.round(link).astype(np.int32).reshape(-1, 1, 2)], False, blue, 3, cv2.LINE_AA
                )
    x, y = (round(float(v)) for v in attempt.handed.update.pixel)
    cv2.drawMarker(out, (x, y), (255, 255, 255) if verdict.accepted else bad, cv2.MARKER_CROSS, 17, 2)
    return np.asarray(out, dtype=np.uint8)


def _inside(pixels: Array, shape: tuple[int, ...]) -> npt.NDArray[np.int64]:
    whole = np.round(pixels[np.isfinite(pixels).all(axis=1)]).astype(np.int64)
    keep = (whole >= 0).all(axis=1) & (whole[:, 0] < shape[1]) & (whole[:, 1] < shape[0])
    return np.asarray(whole[keep])


def _circle(middle: Array, normal: Array, radius: float) -> Array:
    side = np.cross(normal, (0.0, 0.0, 1.0) if abs(normal[2]) < 0.9 else (1.0, 0.0, 0.0))
    side /= np.linalg.norm(side)
    turn = np.linspace(0.0, 2.0 * np.pi, 40)[:, None]
    return np.asarray(middle + radius * (np.cos(turn) * side + np.sin(turn) * np.cross(normal, side)))
