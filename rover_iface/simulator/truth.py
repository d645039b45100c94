"""What only a simulation knows: which surface point each target is, how far off the rover is, true labels."""

from __future__ import annotations

import json
import math
from collections import OrderedDict
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass

import numpy as np

from executive.ports import Value
from rover_iface.behaviour.hardware import TrackReport
from rover_iface.cameras.model import Array, CameraModel
from rover_iface.cameras.panorama import camera_document
from rover_iface.frames import Pose
from rover_iface.simulator.body import Body
from rover_iface.simulator.engine import pose_label
from rover_iface.simulator.render.picture import Frame

CREST_M = 0.3
"""Difference in range at which a pixel is taken to see past the target."""

KEPT = 8
"""How many of the last pictures for tracks are known with all they show: answers come before the next one."""


@dataclass(frozen=True, slots=True)
class TrackRecord:
    """One answer of the tracker, its position in the believed site frame, and how far off it truly was."""

    t_s: float
    target: str
    state: str
    confidence: float
    range_m: float
    error_m: float
    reasons: tuple[str, ...]
    position_m: tuple[float, float, float]


class Truth:
    """Scores what the rover says against what is.

    Attributes
    ----------
    history
        Every answer of the tracker.
    odometry
        (t_s, true pose, believed pose) whenever the rover has moved.
    touched
        By target: the surface point (3,), true site frame, that a tool last touched for it.
    """

    def __init__(self, body: Body) -> None:
        self.body = body
        self.history: list[TrackRecord] = []
        self.odometry: list[tuple[float, Pose, Pose]] = []
        self.touched: dict[str, Array] = {}
        self._points: dict[str, Array] = {}
        self._frames: OrderedDict[int, Callable[[], Frame]] = OrderedDict()
        self._cameras: list[CameraModel] = []

    def took(self, camera: CameraModel, frame: Callable[[], Frame] | None = None) -> int:
        """Return the number of a picture, by which its camera, site frame, is known, and what gives it, if it
        is for a track.
        """
        number = len(self._cameras)
        self._cameras.append(camera)
        if frame is not None:
            self._frames[number] = frame
            if len(self._frames) > KEPT:
                self._frames.popitem(last=False)
        return number

    def moved(self, t_s: float) -> None:
        """Note where the rover is now."""
        self.odometry.append((t_s, self.body.pose, self.body.believed))

    def point(self, target: str) -> Array:
        """Return the surface point (3,) of the true site that a target stands for: by its pixel when it was
        first tracked, before that as designated on the map.
        """
        known = self._points.get(target)
        return np.array(self.body.targets[target].point) if known is None else known

    def told(self, t_s: float, report: TrackReport) -> None:
        """Score an answer of the tracker."""
        if report.begun and report.picture is not None:
            seen = self._surface_near(self._frames[report.picture](), report)
            if seen is not None:
                self._points[report.target] = seen
        here = self.body.true_from_believed.apply(report.position)
        x, y, z = (float(v) for v in report.position)
        self.history.append(
            TrackRecord(
                t_s,
                report.target,
                report.state,
                report.confidence,
                report.range_m,
                float(np.linalg.norm(here - self.point(report.target))),
                report.reasons,
                (x, y, z),
            )
        )

    def _surface_near(self, frame: Frame, report: TrackReport, reach_px: int = 4) -> Array | None:
        """Return the surface point that a new track stands for: the one under its pixel.

        On a crest the pixel itself, off by the mast's error, may see the ground behind: then the one seen
        near it that is nearest to the track's position.
        """
        eye, way = frame.camera.back_project(report.pixel)
        away = float(self.body.renderer.scene.ranges(eye, way[None])[0])
        place = self.body.true_from_believed.apply(report.position)
        if math.isfinite(away) and abs(away - float(np.linalg.norm(place - eye))) < CREST_M:
            return np.asarray(eye + away * way)
        column, row = (round(float(v)) for v in report.pixel)
        rows = slice(max(0, row - reach_px), row + reach_px + 1)
        columns = slice(max(0, column - reach_px), column + reach_px + 1)
        points = frame.truth.point_site[rows, columns].reshape(-1, 3)
        points = points[np.isfinite(points).all(axis=1)]
        if not len(points):
            return None
        return np.asarray(points[int(np.argmin(np.linalg.norm(points - place, axis=1)))], dtype=float)

    # ---- scores in results, labels and logs

    def scored(self, target: str, values: Mapping[str, Value]) -> dict[str, Value]:
        """Return the values of a placement with its error, where the tool has touched."""
        if values.get("made") is not True or target not in self.touched:
            return dict(values)
        scored = list(values.items())
        # before the count of products, where stored journals have it
        at = list(values).index("products") if "products" in values else len(scored)
        scored.insert(at, ("placement_error_m", self.placement_error_m(target)))
        return dict(scored)

    def placement_error_m(self, target: str) -> float:
        """Return how far from a target's surface point the tool touched."""
        return float(np.linalg.norm(self.touched[target] - self.point(target)))

    def camera(self, number: int) -> CameraModel:
        """Return where the camera of a picture truly was, site frame."""
        return self._cameras[number]

    def label(self, number: int, target: object, kind: str) -> dict[str, object]:
        """Return what is true of a picture of a target, for its label, in the true site frame."""
        truth: dict[str, object] = {
            **self.pose_label(),
            "camera_model": camera_document(self._cameras[number]),
        }
        if isinstance(target, str):
            truth["point_m"] = [float(v) for v in np.asarray(self.point(target), dtype=float)]
            if target in self.touched and kind != "image":
                truth["placement_error_m"] = self.placement_error_m(target)
        return truth

    def pose_label(self) -> dict[str, object]:
        """Return where the rover truly is, for a label."""
        return {"frame": "true site", "pose": pose_label(self.body.pose)}

    def log(self, kind: str) -> tuple[int, bytes]:
        """Return how many rows the log `odometry` or `tracking` has, and the log as JSON."""
        if kind == "odometry":
            return len(self.odometry), _table(
                {
                    "t_s": t,
                    "true": [true.x, true.y, true.z, true.heading],
                    "believed": [believed.x, believed.y, believed.z, believed.heading],
                }
                for t, true, believed in self.odometry
            )
        return len(self.history), _table(asdict(record) for record in self.history)


def _table(rows: Iterable[dict[str, object]]) -> bytes:
    return (json.dumps(list(rows)) + "\n").encode()
