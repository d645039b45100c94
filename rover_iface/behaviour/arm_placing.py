"""Placing as the `full` rover does: hazcam cloud, safety check, arm, contact, and a close-up."""

from __future__ import annotations

import json
from collections.abc import Generator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from executive.ports import Command, Value
from mission.instrument import Instrument
from rover_iface.behaviour.action import Action, Doing, Outcome, Step, number
from rover_iface.behaviour.attempt import Attempt, overlay
from rover_iface.behaviour.base_moves import MOVES, BaseMoves
from rover_iface.behaviour.close_look import carried, meant_on, narrow_cloud, registered
from rover_iface.behaviour.driving import Driving
from rover_iface.behaviour.following import Followed, TargetFollower
from rover_iface.behaviour.hardware import Contact, Hardware
from rover_iface.behaviour.hazard_eyes import HazardEyes
from rover_iface.behaviour.mast_cameras import MastCameras
from rover_iface.behaviour.placing import Placing
from rover_iface.behaviour.placing_clouds import hazcam_cloud, mast_cloud
from rover_iface.behaviour.products import picture_label, png
from rover_iface.cameras.model import Array
from rover_iface.errors import CameraError, PlacementError, RenderError, RoverError, TrackerError
from rover_iface.frames import Pose
from rover_iface.placement.arm import Arm, ArmRefusal
from rover_iface.placement.arm_motion import Motion, Obstacles, plan_motion
from rover_iface.placement.base_adjustment import base_move, mast_eye, view_move
from rover_iface.placement.base_placement import REACH_SHARE
from rover_iface.placement.cloud import SurfaceCloud
from rover_iface.placement.cloud_alignment import Alignment
from rover_iface.placement.safety import plan_placement
from rover_iface.placement.safety_limits import SafetyLimits
from rover_iface.placement.segmentation import SegmentationOptions, segment
from rover_iface.placement.verdict import BaseMove, Reason

NEAR_M = 0.015
"""How far from the designated point a safe one may be taken; with hand-off and arm that keeps 2 cm."""


class ArmPlacing(Placing):
    """Hands a target off, looks for a safe point, moves the arm until contact, and takes a close-up.

    What the pictures of the hazcams show decides.
    """

    def __init__(
        self,
        hardware: Hardware,
        cameras: MastCameras,
        follower: TargetFollower,
        eyes: HazardEyes,
        driving: Driving,
        limits: SafetyLimits | None = None,
    ) -> None:
        super().__init__(hardware, cameras, follower, eyes, BaseMoves(hardware, driving))
        self.eyes = eyes
        self.driving = driving
        self.arm = Arm(hardware.profile.arm)
        self.limits = limits or SafetyLimits(search_m=NEAR_M)
        self.attempts: dict[str, Attempt] = {}

    def place(self, command: Command) -> Action:
        """Carry out `ipplaceinstrument`."""
        name = str(command.parameters["target"])
        instrument = str(command.parameters.get("instrument", self._usual_instrument()))
        if name not in self.follower.targets:
            return Outcome(False, f"unknown target {name}", {"made": False})
        if not self.hardware.cameras_work:
            return Outcome(False, "camera failed", {"made": False})
        try:
            followed = self.follower.in_sight(name)
            figures = self.hardware.profile.instrument(instrument)
        except RoverError as err:
            return Outcome(False, str(err), {"made": False})
        begin_j = self.hardware.drawn_j
        try:
            attempt = yield from self._attempt_moving(followed)
        except (TrackerError, RenderError, CameraError, PlacementError) as err:
            followed.refused = True
            yield from self.hardware.spend("handoff")
            return Outcome(False, str(err), {"made": False, "energy_j": self.hardware.drawn_j - begin_j})
        outcome = yield from self._carry_out(command, name, instrument, figures, followed, attempt)
        return replace(outcome, values={**outcome.values, "energy_j": self.hardware.drawn_j - begin_j})

    def _attempt_moving(self, followed: Followed) -> Generator[Step, None, Attempt]:
        """Return what comes of a placement, the rover moved where the safety check asks for it: to where the
        arm reaches, and to see the designated point from another side.

        So it is where the hand-off is refused: patches that are dark, cut off or seen at a slant here may not
        be from there.

        Raises
        ------
        TrackerError, RenderError, CameraError, PlacementError
            See `_attempt` and `BaseMoves.to`; the first refusal of the hand-off, if the last view has one.
        """
        stand = self.driving.stands.of(followed.target.id)
        if stand is not None and not self.eyes.sees(followed):
            yield from self.moves.to(followed, stand)
        views_left = MOVES
        seen_from: list[Array] = []
        refused: TrackerError | None = None
        while True:
            attempt: Attempt | None = None
            try:
                attempt = yield from self._attempt(followed, views_left, seen_from)
            except TrackerError as err:
                refused = refused or err
            move = self._move_after(followed, attempt, seen_from) if views_left else None
            moved = False
            eye = self.hardware.believed.site_from_rover.apply(mast_eye(self.hardware.profile))
            if move is not None:
                wanted = self.hardware.believed.site_from_rover * move.pose.site_from_rover
                moved = yield from self.moves.to(followed, Pose.from_transform(wanted))
            if attempt is not None and move is None:
                return attempt
            if attempt is None and not moved:
                assert refused is not None
                raise refused
            if moved:
                seen_from.append(np.asarray(eye, dtype=np.float64))
            # where the rover cannot go it decides by what it sees from here
            views_left = views_left - 1 if moved else 0

    def _move_after(
        self, followed: Followed, attempt: Attempt | None, seen_from: Sequence[Array]
    ) -> BaseMove | None:
        """Return the move after an attempt, or after a hand-off that was refused, by which more may be known;
        None where nothing is to be hoped for.
        """
        if attempt is not None:
            move = attempt.verdict.base_move or self._nearer(attempt)
            if move is not None or attempt.verdict.reason is not Reason.OUTSIDE_CLOUD:
                return move
        return self._another_side(followed, seen_from)

    def _another_side(self, followed: Followed, seen_from: Sequence[Array]) -> BaseMove | None:
        """Return a move to where a target is seen from another side than from here and from the places (3,)
        of `seen_from`, site frame, m; None where there is none. Nothing is known of its face.
        """
        rover_from_site = self.hardware.believed.site_from_rover.inverse()
        try:
            cloud = hazcam_cloud(self.eyes.pair().view, rover_from_site)
        except (CameraError, RenderError):
            return None
        at = np.asarray(rover_from_site.apply(followed.update.position), dtype=np.float64)
        eyes = [np.asarray(rover_from_site.apply(eye), dtype=np.float64) for eye in seen_from]
        move = view_move(cloud, self.hardware.profile, at, np.asarray(cloud.up), eyes)
        return None if isinstance(move, str) else move

    def _nearer(self, attempt: Attempt) -> BaseMove | None:
        """Return the move that brings a refused target into the arm's reach; None when it is in reach.

        From too far away a face is seen too poorly to be judged.
        """
        rover_from_site = self.hardware.believed.site_from_rover.inverse()
        at = np.asarray(rover_from_site.apply(attempt.handed.update.position), dtype=np.float64)
        arm = self.hardware.profile.arm
        away = float(np.linalg.norm(at - np.array(arm.shoulder_m)))
        if attempt.verdict.accepted or arm.min_reach_m <= away <= REACH_SHARE * arm.reach_m:
            return None
        move = base_move(attempt.cloud, self.hardware.profile, at, None)
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
            yield from self.hardware.spend("handoff")
            self._write_look(command, name, instrument, attempt)
            return Outcome(False, f"target {name}: {attempt.verdict.text}", {"made": False})
        yield from self.hardware.operate(figures, number(command, "dwell_s", 0.0) if touch.made else 0.0)
        count = self._write_look(command, name, instrument, attempt)
        values: dict[str, Value] = {"made": touch.made}
        if not touch.made:
            self.follower.forget(name)
            return Outcome(False, f"target {name}: {touch.reason}", values)
        count += self._write_close_up(command, name, instrument, touch)
        values["products"] = float(count)
        self.follower.forget(name)
        return Outcome(True, values=values)

    def _attempt(self, followed: Followed, views_left: int, seen_from: Sequence[Array]) -> Doing[Attempt]:
        """Return what comes of a placement from here; while there are `views_left` that may be a move to see
        the target from another side (`plan_placement`) than from the places (3,) of `seen_from`, site frame,
        m.

        Raises
        ------
        TrackerError
            If the hand-off is refused.
        RenderError, CameraError
            If the hazcams show nothing.
        """
        handed = self.eyes.at_this_stop(followed)
        followed.update = handed.update
        rover_from_site = self.hardware.believed.site_from_rover.inverse()
        cloud = hazcam_cloud(self.eyes.pair().view, rover_from_site)
        mast = self.eyes.near(followed.target.id)
        laid = None if mast is None else mast_cloud(mast, rover_from_site, cloud)
        at = np.asarray(rover_from_site.apply(handed.update.position), dtype=np.float64)
        pixel = self.eyes.near_pixel(followed.target.id)
        if mast is not None and laid is not None and pixel is not None:
            spot = meant_on(laid, mast.left_camera.transformed(rover_from_site), pixel, at)
            at = at if spot is None else spot
        shown = cloud.points if laid is None else np.concatenate((cloud.points, laid.cloud.points))
        obstacles = Obstacles.of(self.hardware.profile, shown)

        def way(point: Array, normal: Array) -> Motion | ArmRefusal:
            return plan_motion(self.arm, obstacles, point, normal)

        looks: list[SurfaceCloud | None] = []

        def narrow(point: Array) -> SurfaceCloud | None:
            looks.append(self._narrow(point, cloud, laid))
            return looks[-1]

        found = segment(cloud, SegmentationOptions())
        verdict = plan_placement(
            cloud,
            at,
            self.hardware.profile,
            limits=self.limits,
            segmentation=found,
            arm=way,
            second=None if laid is None else laid.cloud,
            narrow=narrow if carried(self.cameras.rig) else None,
            views_left=views_left,
            seen_from=[rover_from_site.apply(eye) for eye in seen_from],
        )
        motion = verdict.posture if isinstance(verdict.posture, Motion) else None
        touch = None
        if verdict.accepted and motion is not None:
            touch = yield from self.hardware.move_arm(followed.target.id, motion)
        attempt = Attempt(handed, verdict, cloud, found, laid, motion, touch, tuple(looks))
        self.attempts[followed.target.id] = attempt
        return attempt

    def _narrow(self, point: Array, cloud: SurfaceCloud, laid: Alignment | None) -> SurfaceCloud | None:
        """Return what the narrow pair ranges round a point (3,), rover frame, registered to the mast's cloud
        as it was `laid` on the hazcams' `cloud`, to that itself where there is none; None where the pair sees
        nothing to be trusted.
        """
        motion = None if laid is None else laid.motion
        # the mast stands where it stood for the wide pair: it is pointed to where that had the place
        at = point if motion is None else np.asarray(motion.inverse().apply(point), dtype=np.float64)
        try:
            view = self.cameras.narrow_pair(at)
        except (CameraError, RenderError):
            return None
        narrow = narrow_cloud(view, at, cloud.up)
        return None if narrow is None else registered(narrow, motion, cloud if laid is None else laid.cloud)

    # ---- products

    def _write_look(self, command: Command, name: str, instrument: str, attempt: Attempt) -> int:
        """Write the hazcam picture, the same with the decision drawn on it, and the decision itself."""
        if not self.hardware.keeps_products:
            return 0
        hazard = self.hardware.profile.cameras.hazard
        pair = self.eyes.pair()
        image = pair.left.image8
        label: dict[str, Any] = {
            "target": name,
            "instrument": instrument,
            "camera": hazard,
            **picture_label(pair.view.left_camera, attempt.handed.update.position),
        }
        drawn = overlay(image, self.cameras.rig.camera(hazard), attempt, self.arm)
        count = 0
        for kind, pixels in (("hazcam", image), ("placement", drawn)):
            count += self.hardware.write_product(
                command, kind, png(pixels), ".png", label, picture=pair.left.number
            )
        document = {
            "target": name,
            "handoff": self.eyes.answers.get(name, {}),
            "verdict": attempt.verdict.as_dict(),
            "text": attempt.verdict.text,
            "mast": None if attempt.laid is None else attempt.laid.as_dict(),
            "narrow_looks": [None if look is None else len(look) for look in attempt.looks],
            "joints_rad": None if attempt.motion is None else attempt.motion.contact.tolist(),
            "contact": None if attempt.touch is None else attempt.touch.made,
            "beyond_m": None if attempt.touch is None else _finite(attempt.touch.beyond_m),
        }
        data = (json.dumps(document, indent=1) + "\n").encode()
        about = {"target": name, "instrument": instrument, "frame": "rover"}
        return count + self.hardware.write_product(command, "verdict", data, ".json", about)

    def _write_close_up(self, command: Command, name: str, instrument: str, touch: Contact) -> int:
        """Write the merged picture of an imager on the tool, what was measured for another instrument."""
        if not self.hardware.keeps_products:
            return 0
        camera = self.hardware.profile.instrument(instrument).camera
        if not camera:
            return self.write_measurement(command, name, instrument, touch)
        try:
            seen = self.hardware.take_close_up(camera)
        except RenderError:
            return 0
        label = {
            "target": name,
            "instrument": instrument,
            "pixel_m": seen.pixel_m,
            "sharp": seen.sharp,
            "planes": seen.planes,
            **picture_label(seen.camera, touch.point),
        }
        return self.hardware.write_product(
            command, "microscopic", png(seen.image), ".png", label, picture=seen.number
        )


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None
