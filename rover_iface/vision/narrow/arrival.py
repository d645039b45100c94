"""The tracker of the `full` rover: features on the way, shape registration once the target is near."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.model import Array
from rover_iface.errors import CameraError, RenderError, TrackerError
from rover_iface.vision.narrow.designation import off_the_edge
from rover_iface.vision.narrow.recall import coasting
from rover_iface.vision.narrow_range import NarrowSight, PairFor
from rover_iface.vision.shape_tracker import RECALL_M, CombinedTracker
from rover_iface.vision.tracker import StereoView, TrackState, TrackUpdate

ARRIVED_M = 2.2
"""Distance from the mast cameras at which a target counts as arrived at."""


class ArrivalTracker:
    """A `Tracker`: features on the way, and shape registration with earlier views once the target is near.

    A target that the features have lost, even failed, is tracked again if registration finds it, as the
    single-cycle instrument placement paper reports; one that they have is settled where both agree. A target
    is looked at by the narrow pair too when it is designated, if there is one: it ranges better, and its
    picture is what the near navcams go back to (`CombinedTracker.recall`).
    """

    def __init__(
        self,
        tracker: CombinedTracker | None = None,
        *,
        arrived_m: float = ARRIVED_M,
        narrow: PairFor | None = None,
    ) -> None:
        self.tracker = tracker or CombinedTracker()
        self.arrived_m = arrived_m
        self.narrow = narrow
        self.settled: dict[str, TrackUpdate] = {}

    def start(self, target: str, position: npt.ArrayLike, view: StereoView) -> TrackUpdate:
        """See `Tracker`.

        A point that lies at an edge in the first pictures, as the mast's error puts it there, is moved to the
        nearest place beside it that lies on one surface.

        Raises
        ------
        TrackerError
            Besides what the feature tracker raises, if there is no such place near.
        """
        pixel, narrow = self._sighted(target, np.asarray(position, dtype=np.float64), view)
        return self.tracker.start(target, position, view, pixel=pixel, narrow=narrow)

    def _sighted(self, target: str, position: Array, view: StereoView) -> tuple[Array, NarrowSight | None]:
        """Return the pixel (2,) of a target, and what the narrow pair has there; None without one."""
        away = float(np.linalg.norm(position - view.left_camera.C))
        pixel = np.asarray(view.left_camera.project(position), dtype=np.float64)
        if self.narrow is None or not np.isfinite(pixel).all():
            return pixel, None
        try:
            pair = self.narrow(target, position)
        except (CameraError, RenderError, TrackerError):
            return pixel, None
        return off_the_edge(target, view, pixel, pair, away)

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
            return self._hoped(update, away) if self.tracker.remembers(target) else update
        found, registration = self.tracker.settle(target, view, nearest_m=0.6)
        if found.state is TrackState.LOST and update.state is TrackState.TRACKED:
            # two ways of looking contradict each other: the features, with their own test, are not given up
            return replace(update, reasons=found.reasons)
        if registration is not None:
            self.settled[target] = found
        return found

    def _hoped(self, update: TrackUpdate, away_m: float) -> TrackUpdate:
        """Return an answer about a target that its first picture may find from near, if it is lost far away.

        It coasts (`coasting`), and from where the picture is asked it is not given up before it has arrived.
        """
        if away_m > RECALL_M:
            return coasting(update)
        return replace(update, state=TrackState.LOST) if update.state is TrackState.FAILED else update

    def predicted(self, target: str) -> Array:
        """See `Tracker`."""
        settled = self.settled.get(target)
        return self.tracker.predicted(target) if settled is None else settled.position

    def clear(self, target: str) -> None:
        """See `Tracker`."""
        self.settled.pop(target, None)
        self.tracker.clear(target)
