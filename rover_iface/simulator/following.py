"""The tracking loop: which targets are followed, a look at each at every stop, and what telemetry says."""

from __future__ import annotations

import math
from collections.abc import Generator
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from executive.ports import Command
from rover_iface.cameras.model import Array
from rover_iface.errors import CameraError, RenderError, TrackerError
from rover_iface.simulator.body import Body
from rover_iface.simulator.engine import Action, Outcome, Step
from rover_iface.simulator.mast_cameras import Sighting
from rover_iface.simulator.products import TrackRecord, png, track_label
from rover_iface.simulator.render.picture import Frame
from rover_iface.simulator.routine import RoutineRover
from rover_iface.simulator.world import WorldTarget
from rover_iface.telemetry import TrackState
from rover_iface.vision.tracker import StereoView, Tracker, TrackUpdate

VIEW_PX = 321
"""Largest side of the picture that is kept of a tracker's view."""
NEAR_M = 2.5
"""Range within which a target is looked at at every stop, whatever the cadence."""

CREST_M = 0.3
"""Difference in range at which a pixel is taken to see past the target."""


class Eyes(Protocol):
    """What a tracker sees with."""

    def stereo(self, point_believed: Array, t_s: float) -> Sighting:
        """Look at a point (3,) of the believed site frame.

        Raises
        ------
        CameraError, RenderError, TrackerError
            If that cannot be.
        """


@dataclass(slots=True)
class Followed:
    """A target being tracked: what the map said, and which surface point (3,) of the true site it is."""

    target: WorldTarget
    truth: Array
    update: TrackUpdate
    view: StereoView
    """What it was last looked for in."""
    seen_from: tuple[float, float] = (math.inf, math.inf)
    """Where the rover believed to be then."""
    gone: bool = False
    shaded: bool = False
    refused: bool = False
    """Whether the instrument could not be placed on it."""


class TargetFollower:
    """Follows targets with one tracker. `history` holds every answer of it.

    With a `cadence` a target that is tracked and far is looked at again only when the rover has come that
    share of its range since the last look; 0 looks at every stop.
    """

    def __init__(
        self, host: RoutineRover, body: Body, eyes: Eyes, tracker: Tracker, *, cadence: float = 0.0
    ) -> None:
        self.host = host
        self.body = body
        self.eyes = eyes
        self.tracker = tracker
        self.cadence = cadence
        self.history: list[TrackRecord] = []
        self.followed: dict[str, Followed] = {}
        self._forgotten: dict[str, Followed] = {}
        for name in body.targets:
            host.set(f"trackerstate {name}", TrackState.IDLE.value)
            host.set(f"trackerconfidence {name}", 0.0)
            self._set_range(name)

    # ---- what is known of the targets

    def state(self, name: str) -> TrackState:
        """Return the state of a target's tracker as telemetry has it."""
        return TrackState(str(self.host.get(f"trackerstate {name}")))

    def tracked(self, name: str) -> Followed | None:
        """Return a target that is tracked now, or None."""
        return self.followed.get(name) if self.state(name) is TrackState.TRACKED else None

    def alive(self) -> list[Followed]:
        """Return the targets that are followed and not given up."""
        return [f for f in self.followed.values() if self.state(f.target.id) is not TrackState.FAILED]

    def position(self, name: str) -> Array:
        """Return where a target is believed to be (3,): as it was last tracked, or the map's place."""
        known = self.followed.get(name) or self._forgotten.get(name)
        return np.array(self.body.targets[name].point) if known is None else known.update.position

    def truth(self, name: str) -> Array:
        """Return the surface point (3,) of the true site that a target stands for."""
        known = self.followed.get(name) or self._forgotten.get(name)
        return np.array(self.body.targets[name].point) if known is None else known.truth

    def error_m(self, name: str) -> float:
        """Return how far the tracked position of a target is from the surface point it stands for."""
        followed = self.followed[name]
        here = self.body.true_from_believed.apply(followed.update.position)
        return float(np.linalg.norm(here - followed.truth))

    def set_ranges(self) -> None:
        """Bring the ranges in telemetry up to date."""
        for name in self.body.targets:
            self._set_range(name)

    def _set_range(self, name: str) -> None:
        here = self.body.believed
        x, y = self.position(name)[:2]
        self.host.set(f"range {name}", float(math.hypot(x - here.x, y - here.y)))

    # ---- commands

    def start(self, command: Command) -> Action:
        """Carry out `trackstart`."""
        name = str(command.parameters["target"])
        if name not in self.body.targets:
            return Outcome(False, f"unknown target {name}")
        if name in self.followed:
            return Outcome(False, "already tracked")
        if self.host.camera_failed:
            return Outcome(False, "camera failed")
        duration, energy = self.host.spread("trackstart")
        yield Step(duration, energy)
        target = self.body.targets[name]
        point = self.position(name)
        try:
            sighting = self.eyes.stereo(point, self.host.t_s)
            update = self.tracker.start(name, point, sighting.view)
        except (CameraError, TrackerError, RenderError) as err:
            return Outcome(False, str(err), {"energy_j": energy})
        truth = self._surface_near(sighting.left, update)
        if truth is None:
            self.tracker.clear(name)
            return Outcome(False, f"target {name} is not on the ground", {"energy_j": energy})
        self.followed[name] = Followed(target, truth, update, sighting.view)
        self.tell(self.followed[name], update)
        return Outcome(
            True,
            values={
                "confidence": float(update.confidence),
                "range_m": float(update.scores.get("range_m", 0.0)),
                "energy_j": energy,
            },
        )

    def _surface_near(self, frame: Frame, update: TrackUpdate, reach_px: int = 4) -> Array | None:
        """Return the surface point that a new track stands for: the one under its pixel.

        On a crest the pixel itself, off by the mast's error, may see the ground behind: then the one seen
        near it that is nearest to the track's position.
        """
        eye, way = frame.camera.back_project(update.pixel)
        away = float(self.body.renderer.scene.ranges(eye, way[None])[0])
        place = self.body.true_from_believed.apply(update.position)
        if math.isfinite(away) and abs(away - float(np.linalg.norm(place - eye))) < CREST_M:
            return np.asarray(eye + away * way)
        column, row = (round(float(v)) for v in update.pixel)
        rows = slice(max(0, row - reach_px), row + reach_px + 1)
        columns = slice(max(0, column - reach_px), column + reach_px + 1)
        points = frame.truth.point_site[rows, columns].reshape(-1, 3)
        points = points[np.isfinite(points).all(axis=1)]
        if not len(points):
            return None
        return np.asarray(points[int(np.argmin(np.linalg.norm(points - place, axis=1)))], dtype=float)

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
            self.host.set(f"trackerstate {name}", TrackState.IDLE.value)
            self.host.set(f"trackerconfidence {name}", 0.0)

    def leave_refused(self, goal: str) -> None:
        """Follow those that were refused no longer, now that the rover goes elsewhere (`goal`)."""
        for name in [n for n, f in self.followed.items() if f.refused and n != goal]:
            self.forget(name)

    # ---- the loop

    def update_all(self) -> Generator[Step, None, None]:
        """Update every followed target, each with its own pointing and pair of pictures."""
        for followed in self.alive():
            if not self._due(followed):
                continue
            duration, energy = self.host.spread("track_update")
            yield Step(duration, energy)
            self.tell(followed, self._follow(followed))

    def _due(self, followed: Followed) -> bool:
        here = self.body.believed
        moved = math.hypot(here.x - followed.seen_from[0], here.y - followed.seen_from[1])
        away = math.hypot(*(followed.update.position[:2] - (here.x, here.y)))
        tracked = self.state(followed.target.id) is TrackState.TRACKED
        return not tracked or away < NEAR_M or moved >= self.cadence * away

    def _follow(self, followed: Followed) -> TrackUpdate:
        name = followed.target.id
        try:
            view = self.eyes.stereo(self.tracker.predicted(name), self.host.t_s).view
        except (CameraError, TrackerError, RenderError) as err:
            return self._unseen(followed, str(err))
        if followed.gone or self.host.camera_failed:
            noise = self.body.rng.random(view.left.shape).astype(np.float32)
            view = replace(view, left=noise)
        elif followed.shaded:
            shade = np.linspace(0.15, 1.6, view.left.shape[1], dtype=np.float32)[None, :] ** 2
            view = replace(view, left=np.clip(view.left * shade, 0, 1))
        followed.view = view
        return self.tracker.update(name, view)

    def _unseen(self, followed: Followed, why: str) -> TrackUpdate:
        """Return the last answer, less sure: the mast cannot look there now, which is no miss of the tracker.

        After three such stops in a row the target counts as lost, until it is seen again.
        """
        confidence = 0.8 * followed.update.confidence
        state = followed.update.state
        if state is TrackState.TRACKED and confidence < 0.5:
            state = TrackState.LOST
        return replace(followed.update, state=state, confidence=confidence, reasons=(why,))

    def tell(self, followed: Followed, update: TrackUpdate) -> None:
        """Put an answer about a target into telemetry and history."""
        name = followed.target.id
        followed.update = update
        followed.seen_from = (self.body.believed.x, self.body.believed.y)
        self.host.set(f"trackerstate {name}", update.state.value)
        self.host.set(f"trackerconfidence {name}", float(min(1.0, max(0.0, update.confidence))))
        self._set_range(name)
        self.history.append(
            TrackRecord(
                self.host.t_s,
                name,
                update.state.value,
                float(update.confidence),
                float(self.host.get(f"range {name}") or 0.0),
                self.error_m(name),
                tuple(update.reasons),
                (float(update.position[0]), float(update.position[1]), float(update.position[2])),
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
            self.host.write_product(command, "trackview", png(pixels), ".png", label)

    # ---- faults

    def lose(self, target: str, confidence: float) -> None:
        """Hide a target from the tracker for good (a shadow only darkens it), by a fault."""
        followed = self.followed.get(target)
        if followed is None:
            return
        if confidence >= 0.25:
            followed.shaded = True
        else:
            followed.gone = True
            self.host.set(f"trackerstate {target}", TrackState.LOST.value)
            self.host.set(f"trackerconfidence {target}", confidence)
