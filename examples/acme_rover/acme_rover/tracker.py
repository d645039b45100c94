"""A tracker of our own: correlation that takes nothing for the target below a confidence of its own."""

from __future__ import annotations

from dataclasses import replace

import numpy.typing as npt

from rover_iface.cameras.model import Array
from rover_iface.vision.tracker import StereoView, Tracker, TrackState, TrackUpdate
from rover_iface.vision.trackers import TrackerAids, correlation

LEAST_CONFIDENCE = 0.6
"""Of an update that is believed; correlation alone believes 0.5. Chosen for a drill that costs an hour."""


class CautiousTracker:
    """See `rover_iface.vision.tracker.Tracker`."""

    def __init__(self, inner: Tracker) -> None:
        self._inner = inner

    def start(self, target: str, position: npt.ArrayLike, view: StereoView) -> TrackUpdate:
        """Begin to follow a target; its first match is believed."""
        return self._inner.start(target, position, view)

    def update(self, target: str, view: StereoView) -> TrackUpdate:
        """Find the target again; a match that is not good enough is none."""
        found = self._inner.update(target, view)
        if found.state is TrackState.TRACKED and found.confidence < LEAST_CONFIDENCE:
            why = f"confidence {found.confidence:.2f} is below {LEAST_CONFIDENCE:g}"
            return replace(found, state=TrackState.LOST, reasons=(*found.reasons, why))
        return found

    def predicted(self, target: str) -> Array:
        """Return where the target is believed to be (3,)."""
        return self._inner.predicted(target)

    def clear(self, target: str) -> None:
        """Forget a target."""
        self._inner.clear(target)


def make_tracker(aids: TrackerAids) -> Tracker:
    """Return the tracker for one rover: the entry point of `outcrop.trackers`."""
    return CautiousTracker(correlation(aids))
