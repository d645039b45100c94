"""All that a rover does by itself, by the names of its commands; and how the rovers here are put together."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Protocol

from executive.ports import Command
from rover_iface.behaviour.action import Action, Outcome
from rover_iface.behaviour.arm_placing import ArmPlacing
from rover_iface.behaviour.base_moves import BaseMoves
from rover_iface.behaviour.driving import Driving
from rover_iface.behaviour.following import TargetFollower
from rover_iface.behaviour.hardware import Hardware
from rover_iface.behaviour.hazard_eyes import HazardEyes
from rover_iface.behaviour.imaging import Imaging
from rover_iface.behaviour.lost_pose import PoseFinder
from rover_iface.behaviour.mast_cameras import MastCameras
from rover_iface.behaviour.placing import KinematicHandoff, Placing, TestedHandoff
from rover_iface.behaviour.sight import ScannedSight, StereoSight
from rover_iface.behaviour.target import DesignatedTarget
from rover_iface.vision.tracker import FindsBeside
from rover_iface.vision.trackers import TrackerAids, make_tracker

WINDOW_PX = 400
"""Side of what the `full` rover's tracker gets of a navcam frame, at full resolution; a whole one costs five
times that."""

RIGHT_MARGIN_PX = 24

CADENCE = 0.08
"""Share of its range after which a far target is looked at again; the paper's steps are a tenth."""

Targets = Mapping[str, DesignatedTarget]


class Repertoire:
    """The commands that behaviour carries out; `act` gives None for those that need nothing but time."""

    def __init__(
        self, follower: TargetFollower, driving: Driving, imaging: Imaging, placing: Placing
    ) -> None:
        self.follower = follower
        self.driving = driving
        self.imaging = imaging
        self.placing = placing
        self._actions: dict[str, Callable[[Command], Action]] = {
            "navigate": driving.navigate,
            "turn": driving.turn,
            "trackstart": self._start_track,
            "trackstop": follower.stop,
            "ipplaceinstrument": self._turning(placing.place),
            "handoff": self._turning(placing.hand_off),
            "image": self._turning(imaging.image),
            "imagepanorama": imaging.panorama,
            "pointmast": self._turning(imaging.point_mast),
        }

    def _turning(self, act: Callable[[Command], Action]) -> Callable[[Command], Action]:
        """Return an action before which the rover turns to what lies behind the mast's reach."""

        def turned(command: Command) -> Action:
            hardware, point = self.follower.hardware, self.imaging.looked_at(command)
            if point is None or not hardware.cameras_work or self.imaging.in_reach(point):
                return (yield from act(command))
            begin_j = hardware.drawn_j
            trouble = yield from self.driving.face(point)
            outcome = yield from act(command)
            reason = outcome.reason
            if reason and trouble:
                reason = f"{reason}; on the turn to what is behind the mast's reach: {trouble}"
            values = {**outcome.values, "energy_j": hardware.drawn_j - begin_j}
            return replace(outcome, reason=reason, values=values)

        return turned

    def _start_track(self, command: Command) -> Action:
        """Carry out `trackstart`; what it drew is told with the turn and the pair that is kept."""
        hardware = self.follower.hardware
        begin_j = hardware.drawn_j
        outcome = yield from self._turn_and_start(command)
        return replace(outcome, values={**outcome.values, "energy_j": hardware.drawn_j - begin_j})

    def _turn_and_start(self, command: Command) -> Action:
        """Turn to what lies behind the mast's reach, and start its track."""
        name = str(command.parameters["target"])
        if name in self.follower.targets and name not in self.follower.followed:
            trouble = yield from self.driving.face(self.follower.position(name))
            if trouble:
                return Outcome(False, f"target {name} is behind the mast's reach; on the turn: {trouble}")
        return (yield from self.follower.start(command))

    def act(self, command: Command) -> Action | None:
        """Return the action of a command."""
        profile = self.placing.hardware.profile
        made = self._actions.get(profile.usual_action(command.action, command.parameters))
        return None if made is None else made(command)


class MakeRepertoire(Protocol):
    """Puts a rover's behaviour together over its hardware.

    `targets` are those the ground designated; `tracker` names another than the rover's own.
    """

    def __call__(self, hardware: Hardware, targets: Targets, tracker: str = "") -> Repertoire: ...


def subframe(hardware: Hardware, targets: Targets, tracker: str = "") -> Repertoire:
    """Return the behaviour of the `subframe` rover: ranges as given, correlation on subframes.

    Once near it looks again in wider ones: for the spot that its first narrow picture shows, and for the
    hand-off to the hazcams.
    """
    cameras = MastCameras(hardware)
    wide = MastCameras(hardware, window_px=WINDOW_PX, right_margin_px=RIGHT_MARGIN_PX)
    aids = TrackerAids(
        hardware.profile.mobility.odometry_error,
        narrow=lambda target, point: wide.stereo(point, "pancam", track=target).view,
        wide=lambda target, point: wide.stereo(point, track=target).view,
    )
    own = make_tracker(tracker or "ncc-narrow", aids)
    finder = PoseFinder(hardware, wide, MastCameras(hardware, window_px=None))
    follower = TargetFollower(hardware, targets, cameras, own, cadence=CADENCE, finder=finder)
    driving = Driving(hardware, ScannedSight(hardware), follower)
    eyes = HazardEyes(hardware, wide, own.beside if isinstance(own, FindsBeside) else None)
    handoff = TestedHandoff(eyes, KinematicHandoff(hardware, cameras))
    placing = Placing(hardware, cameras, follower, handoff, BaseMoves(hardware, driving))
    return Repertoire(follower, driving, Imaging(hardware, cameras, follower), placing)


class FullRepertoire(Repertoire):
    """See `full`. `placing.attempts` holds every placement, `eyes.answers` every hand-off."""

    placing: ArmPlacing

    def __init__(self, hardware: Hardware, targets: Targets, tracker: str = "") -> None:
        cameras = MastCameras(hardware, window_px=WINDOW_PX, right_margin_px=RIGHT_MARGIN_PX)
        self.eyes = HazardEyes(hardware, cameras)
        aids = TrackerAids(
            hardware.profile.mobility.odometry_error,
            narrow=lambda target, point: cameras.stereo(point, "pancam", track=target).view,
        )
        own = make_tracker(tracker or "sift-shape", aids)
        finder = PoseFinder(hardware, cameras, MastCameras(hardware, window_px=None))
        follower = TargetFollower(hardware, targets, cameras, own, cadence=CADENCE, finder=finder)
        self.sight = StereoSight(hardware, cameras)
        driving = Driving(hardware, self.sight, follower)
        placing = ArmPlacing(hardware, cameras, follower, self.eyes, driving)
        super().__init__(follower, driving, Imaging(hardware, cameras, follower), placing)

    def act(self, command: Command) -> Action | None:
        """Return the action of a command; a target that is tracked anew is handed off anew."""
        if command.action == "trackstart":
            self.eyes.forget(str(command.parameters["target"]))
        return super().act(command)


def full(hardware: Hardware, targets: Targets, tracker: str = "") -> FullRepertoire:
    """Return the behaviour of the `full` rover: everything by stereo, features, cascade and planned arm."""
    return FullRepertoire(hardware, targets, tracker)
