"""The tracking loop: which targets are followed, a look at each at every stop, and what telemetry says."""

from __future__ import annotations

import logging
import math
from collections.abc import Generator, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from executive.ports import Command
from rover_iface.behaviour.action import Action, Doing, Outcome, Step
from rover_iface.behaviour.hardware import Hardware, TrackReport
from rover_iface.behaviour.lost_pose import LOST_M, LOST_RAD, PoseFinder, PoseFound
from rover_iface.behaviour.mast_cameras import Sighting
from rover_iface.behaviour.products import png, track_label
from rover_iface.behaviour.target import DesignatedTarget
from rover_iface.cameras.model import Array
from rover_iface.errors import CameraError, RenderError, TrackerError
from rover_iface.localization.target_map import TargetMap
from rover_iface.navigation.navigator import SeenWay
from rover_iface.telemetry import TrackState
from rover_iface.vision.narrow.recall import coasting
from rover_iface.vision.tracker import Expects, StereoView, TakesBack, Tracker, TrackUpdate

logger = logging.getLogger(__name__)
MOST_LOST = 0.25
"""Most confidence in a target of a rover that does not know where it stands."""
VIEW_PX = 321
"""Largest side of the picture that is kept of a tracker's view."""
NEAR_M = 2.5
"""Range within which a target is looked at at every stop, whatever the cadence."""
TILT_RAD = 0.0035
"""Error of the attitude that the inertial sensor tells: 0.2 degrees."""


class Eyes(Protocol):
    """What a tracker sees with."""

    def stereo(self, point: Array, *, track: str) -> Sighting:
        """Look at a point (3,), m, of the believed site frame for the track of a target.

        Raises
        ------
        CameraError, RenderError, TrackerError
            If that cannot be.
        """


@dataclass(slots=True)
class Followed:
    """A target being tracked: as it was designated, and what the tracker answered last."""

    target: DesignatedTarget
    update: TrackUpdate
    view: StereoView
    """What it was last looked for in."""
    seen_from: tuple[float, float] = (math.inf, math.inf)
    """Where the rover believed to be then."""
    refused: bool = False
    """Whether the instrument could not be placed on it."""
    in_reach: bool = True
    """Whether the mast could look at it when it was last looked for."""


class TargetFollower:
    """Follows targets with one tracker; every answer of it goes into telemetry and the engineering log.

    With a `cadence` a target that is tracked and far is looked at again only when the rover has come that
    share of its range since the last look; 0 looks at every stop. With a `finder` it looks round for where it
    stands when all that were in sight are lost at once.

    Attributes
    ----------
    corrections
        How often the pose was found to be another than dead reckoning had.
    pose_lost
        Why the rover does not know where it stands, empty where it does.
    """

    def __init__(
        self,
        hardware: Hardware,
        targets: Mapping[str, DesignatedTarget],
        eyes: Eyes,
        tracker: Tracker,
        *,
        cadence: float = 0.0,
        finder: PoseFinder | None = None,
    ) -> None:
        self.hardware = hardware
        self.targets = targets
        self.eyes = eyes
        self.tracker = tracker
        self.cadence = cadence
        self.finder = finder
        self.corrections, self.pose_lost = 0, ""
        self._saw: set[str] = set()
        self.followed: dict[str, Followed] = {}
        profile = hardware.profile
        pointing_rad = math.hypot(profile.mast.bias_rad, profile.mast.noise_rad, TILT_RAD)
        self.map = TargetMap(pointing_rad, profile.mobility.heading_drift_rad_m)
        self._forgotten: dict[str, Followed] = {}
        for name in self.targets:
            hardware.set(f"trackerstate {name}", TrackState.IDLE.value)
            hardware.set(f"trackerconfidence {name}", 0.0)
            self._set_range(name)

    # ---- what is known of the targets

    def state(self, name: str) -> TrackState:
        """Return the state of a target's tracker as telemetry has it."""
        return TrackState(str(self.hardware.get(f"trackerstate {name}")))

    def tracked(self, name: str) -> Followed | None:
        """Return a target that is tracked now, or None."""
        return self.followed.get(name) if self.state(name) is TrackState.TRACKED else None

    def in_sight(self, name: str) -> Followed:
        """Return a target that is tracked and was seen when it was last looked for.

        Raises
        ------
        TrackerError
            If it is not.
        """
        followed = self.tracked(name)
        if followed is None:
            raise TrackerError(f"target {name} is not tracked")
        if not _seen(followed.update):
            raise TrackerError(f"target {name} is out of sight: {'; '.join(followed.update.reasons[:1])}")
        return followed

    def alive(self) -> list[Followed]:
        """Return the targets that are followed and not given up."""
        return [f for f in self.followed.values() if self.state(f.target.id) is not TrackState.FAILED]

    def position(self, name: str) -> Array:
        """Return where a target is believed to be (3,): as it was last tracked, or the map's place."""
        known = self.followed.get(name) or self._forgotten.get(name)
        return np.array(self.targets[name].point) if known is None else known.update.position

    def set_ranges(self) -> None:
        """Bring the ranges in telemetry up to date."""
        for name in self.targets:
            self._set_range(name)

    def _set_range(self, name: str) -> None:
        here = self.hardware.believed
        x, y = self.position(name)[:2]
        self.hardware.set(f"range {name}", float(math.hypot(x - here.x, y - here.y)))

    # ---- commands

    def start(self, command: Command) -> Action:
        """Carry out `trackstart`; what it draws from the battery is for the caller to tell."""
        name = str(command.parameters["target"])
        if name not in self.targets:
            return Outcome(False, f"unknown target {name}")
        if name in self.followed:
            return Outcome(False, "already tracked")
        if not self.hardware.cameras_work:
            return Outcome(False, "camera failed")
        yield from self.hardware.spend("trackstart")
        self.map.move(self.hardware.believed)
        point = self.position(name)
        try:
            sighting = self.eyes.stereo(point, track=name)
            update = self.tracker.start(name, point, sighting.view)
        except (CameraError, TrackerError, RenderError) as err:
            return Outcome(False, str(err))
        followed = Followed(self.targets[name], update, sighting.view)
        self.followed[name] = followed
        self._see(update)
        self.tell(followed, update, sighting.left.number, begun=True)
        yield from self._keep([followed])
        return Outcome(
            True,
            values={
                "confidence": float(update.confidence),
                "range_m": float(update.scores.get("range_m", 0.0)),
            },
        )

    def stop(self, command: Command) -> Action:
        """Carry out `trackstop`."""
        yield from ()
        self.forget(str(command.parameters["target"]))
        return Outcome(True)

    def forget(self, name: str) -> None:
        """Follow a target no longer."""
        known = self.followed.pop(name, None)
        if known is not None:
            self._forgotten[name] = known
            self.tracker.clear(name)
            self.map.forget(name)
            self.hardware.set(f"trackerstate {name}", TrackState.IDLE.value)
            self.hardware.set(f"trackerconfidence {name}", 0.0)

    def came(self, way: SeenWay) -> None:
        """Take a way that ended here, as looks at the ground from both its ends tell it."""
        self.map.move(self.hardware.believed)
        if self.map.before == way.began:
            self.map.came(way.ended, way.covariance)

    def leave_refused(self, goal: str) -> None:
        """Follow those that were refused no longer, now that the rover goes elsewhere (`goal`)."""
        for name in [n for n, f in self.followed.items() if f.refused and n != goal]:
            self.forget(name)

    # ---- the loop

    def update_all(self) -> Generator[Step, None, None]:
        """Update every followed target, each with its own pointing and pair of pictures; those last that
        were not seen at the last stop, as the others tell where they are.
        """
        looked = yield from self._look_at_all()
        if self.finder is None or not looked:
            return
        seen = [followed for followed in looked if not _missed(followed)]
        if not seen and self._saw:
            # before the rover takes it that it knows nothing of what it sees
            known = {followed.target.id for followed in looked}
            rest = [followed for followed in self.alive() if followed.target.id not in known]
            yield from self._look_at(rest)
            looked += rest
            seen = [followed for followed in rest if not _missed(followed)]
        saw, self._saw = self._saw, {followed.target.id for followed in seen}
        if not seen and saw:
            yield from self._find_pose(self.finder)
        for followed in looked:
            if seen and followed.target.id in saw - self._saw and self._away_m(followed) < NEAR_M:
                yield from self._take_back(self.finder, followed)
        seen = [followed for followed in self.alive() if _seen(followed.update)]
        if seen:
            self.pose_lost = ""
            yield from self._keep(seen)

    def _away_m(self, followed: Followed) -> float:
        here = self.hardware.believed
        return math.hypot(*(followed.update.position[:2] - (here.x, here.y)))

    def _look_at_all(self) -> Doing[list[Followed]]:
        """Look at every target that is due; gives those."""
        self.map.move(self.hardware.believed)
        looked = [followed for followed in self.alive() if self._due(followed)]
        yield from self._look_at(looked)
        return looked

    def _look_at(self, targets: Iterable[Followed]) -> Doing[None]:
        """Look at targets, at those first that were in sight."""
        for followed in sorted(targets, key=lambda one: not _seen(one.update)):
            yield from self.hardware.spend("track_update")
            self._follow(followed)

    def _keep(self, seen: list[Followed]) -> Doing[None]:
        """Keep a pair of the nearest of the targets in sight, by which the pose is found again."""
        self._saw |= {followed.target.id for followed in seen}
        if self.finder is not None:
            yield from self.finder.keep(min(seen, key=self._away_m).update, self.map)

    def _take_back(self, finder: PoseFinder, followed: Followed) -> Doing[None]:
        """Look round for a target that was lost near by, while the others say that the pose is right."""
        found = yield from finder.find(followed.target.id)
        if isinstance(found, PoseFound) and not found.contradicts(self.map):
            yield from self._go_on(found)

    def _go_on(self, found: PoseFound) -> Doing[None]:
        """Let the tracker go on from where the surroundings have a target, in a look of its own."""
        name, place = found.stop.target, found.answer.position
        followed = self.followed.get(name)
        if followed is None or not found.answer.accepted or not isinstance(self.tracker, TakesBack):
            return
        if _seen(followed.update):
            return
        yield from self.hardware.spend("track_update")
        try:
            sighting = self.eyes.stereo(place, track=name)
        except (CameraError, TrackerError, RenderError):
            return
        covariance = found.target_covariance(self.hardware.profile.mast.noise_rad)
        update = self.tracker.take_back(name, sighting.view, place, covariance)
        if update is not None:
            followed.view = sighting.view
            self._see(update)
            self.tell(followed, update, sighting.left.number)

    def _find_pose(self, finder: PoseFinder) -> Doing[None]:
        """Look round for where the rover stands, and look at the targets again if that is elsewhere."""
        should_know = finder.should_know
        found = yield from finder.find()
        if isinstance(found, PoseFound):
            if found.contradicts(self.map):
                told = found.off(self.hardware.believed)
                logger.info("pose found again", extra={"t_s": self.hardware.t_s, "found": told})
                self.map, self.corrections = found.map, self.corrections + 1
                self.hardware.correct(found.pose)
                yield from self._look_at_all()
                for followed in self.alive():
                    reasons = (*followed.update.reasons, told)
                    self.tell(followed, replace(followed.update, reasons=reasons), None)
            else:
                yield from self._go_on(found)
        elif should_know:
            self.pose_lost = found
            logger.info("pose lost", extra={"t_s": self.hardware.t_s, "why": found})
            self.map.lose(LOST_M, LOST_RAD)
            for followed in self.alive():
                reasons = (f"the rover does not recognise where it stands: {found}", *followed.update.reasons)
                lost = replace(
                    followed.update,
                    state=TrackState.LOST,
                    confidence=min(MOST_LOST, followed.update.confidence),
                    reasons=reasons,
                )
                self.tell(followed, lost, None)

    def _due(self, followed: Followed) -> bool:
        here = self.hardware.believed
        moved = math.hypot(here.x - followed.seen_from[0], here.y - followed.seen_from[1])
        away = self._away_m(followed)
        tracked = self.state(followed.target.id) is TrackState.TRACKED
        return not tracked or away < NEAR_M or moved >= self.cadence * away

    def _follow(self, followed: Followed) -> None:
        name = followed.target.id
        if name in self.map and isinstance(self.tracker, Expects):
            self.tracker.expect(name, *self.map.place(name))
        try:
            sighting = self.eyes.stereo(self.tracker.predicted(name), track=name)
        except (CameraError, TrackerError, RenderError) as err:
            followed.in_reach = False
            self.tell(followed, self._unseen(followed, str(err)), None)
            return
        followed.view, followed.in_reach = sighting.view, True
        update = self.tracker.update(name, sighting.view)
        self._see(update)
        self.tell(followed, update, sighting.left.number)

    def _see(self, update: TrackUpdate) -> None:
        """Put a target that was seen on the map."""
        if update.state is TrackState.TRACKED and _seen(update):
            self.map.see(update.target, update.position, update.covariance)

    def _unseen(self, followed: Followed, why: str) -> TrackUpdate:
        """Return an answer about a target that the mast cannot look at now: the tracker did not miss it.

        It is where the drive and the other targets have it, and counts as lost once they have it so poorly
        that it would hardly be found again from near.
        """
        before = replace(followed.update, pixel=np.full(2, np.nan))
        if followed.target.id in self.map:
            position, covariance = self.map.place(followed.target.id)
            before = replace(before, position=position, covariance=covariance, deep_m=0.0)
        told = coasting(replace(before, state=TrackState.LOST))
        if followed.update.state is not TrackState.TRACKED or told.state is TrackState.FAILED:
            told = replace(told, state=TrackState.LOST)
        return replace(told, confidence=min(told.confidence, before.confidence), reasons=(why,))

    def tell(
        self, followed: Followed, update: TrackUpdate, picture: int | None, *, begun: bool = False
    ) -> None:
        """Put an answer about a target, got from a left picture, into telemetry and the engineering log."""
        name = followed.target.id
        followed.update = update
        here = self.hardware.believed
        followed.seen_from = (here.x, here.y)
        self.hardware.set(f"trackerstate {name}", update.state.value)
        self.hardware.set(f"trackerconfidence {name}", float(min(1.0, max(0.0, update.confidence))))
        self._set_range(name)
        self.hardware.log_track(
            TrackReport(
                name,
                update.state.value,
                float(update.confidence),
                float(self.hardware.get(f"range {name}") or 0.0),
                tuple(update.reasons),
                update.position,
                update.pixel,
                picture,
                begun,
            )
        )

    def write_views(self, command: Command) -> None:
        """Write what each followed target was last looked for in, with what the tracker found there."""
        from rover_iface.cameras.panorama import camera_document

        for name, followed in self.followed.items():
            update, camera = followed.update, followed.view.left_camera
            height, width = followed.view.left.shape
            middle = update.pixel if np.isfinite(update.pixel).all() else camera.project(update.position)
            if not np.isfinite(middle).all():
                middle = np.array([width / 2, height / 2])
            wide, high = min(VIEW_PX, width), min(VIEW_PX, height)
            left = min(max(round(float(middle[0])) - wide // 2, 0), width - wide)
            top = min(max(round(float(middle[1])) - high // 2, 0), height - high)
            part = followed.view.left[top : top + high, left : left + wide]
            label = {
                "target": name,
                "camera_model": camera_document(camera.window(left, top, wide, high)),
                "tracker": track_label(update, (left, top)),
            }
            pixels = np.clip(255.0 * part, 0.0, 255.0).astype(np.uint8)
            self.hardware.write_product(command, "trackview", png(pixels), ".png", label)


def _seen(update: TrackUpdate) -> bool:
    """Return whether a target was in the picture that an answer is of."""
    return bool(np.isfinite(update.pixel).all())


def _missed(followed: Followed) -> bool:
    """Return whether a target was looked for and not seen."""
    return followed.in_reach and not _seen(followed.update)
