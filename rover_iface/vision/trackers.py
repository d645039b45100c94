"""Trackers by name: those that come with the program, and what packages announce under `outcrop.trackers`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, cast

from mission.errors import PluginError
from mission.plugins import Registry
from rover_iface.errors import TrackerError
from rover_iface.vision.narrow_range import PairFor
from rover_iface.vision.tracker import Tracker

TRACKERS = Registry(
    "tracker",
    "outcrop.trackers",
    {
        "klt": "rover_iface.vision.trackers:flow",
        "ncc": "rover_iface.vision.trackers:correlation",
        "ncc-narrow": "rover_iface.vision.trackers:narrow_correlation",
        "sift": "rover_iface.vision.trackers:features",
        "sift-shape": "rover_iface.vision.trackers:features_and_shape",
    },
)


@dataclass(frozen=True, eq=False)
class TrackerAids:
    """What a rover tells its tracker: the error of odometry, a share of the distance, and how to look again.

    `narrow` takes a pair with the narrow cameras round a target's believed point, `wide` one with the
    navigation cameras that shows more than the tracker's own.
    """

    odometry_error: float = 0.05
    narrow: PairFor | None = None
    wide: PairFor | None = None


class MakeTracker(Protocol):
    """Makes a tracker for one rover: what an entry point of `outcrop.trackers` names."""

    def __call__(self, aids: TrackerAids) -> Tracker: ...


def make_tracker(name: str, aids: TrackerAids | None = None) -> Tracker:
    """Return a new tracker of a registered kind.

    Raises
    ------
    TrackerError
        If there is none of that name, or it cannot be loaded; the message names what is known.
    """
    try:
        make = TRACKERS.load(name)
    except PluginError as err:
        raise TrackerError(str(err)) from err
    if not callable(make):
        raise TrackerError(f'tracker "{name}" is {make!r}; a function that makes a tracker is needed')
    return cast("MakeTracker", make)(aids or TrackerAids())


def correlation(aids: TrackerAids) -> Tracker:
    """Return the correlation tracker on subframes, as flown on Opportunity."""
    from rover_iface.vision.correlation.ncc import NccTracker
    from rover_iface.vision.template import NccOptions

    # three sigma of the way: beyond it a range is not a range of the target
    return NccTracker(NccOptions(odometry_share=max(0.15, 3 * aids.odometry_error)))


def narrow_correlation(aids: TrackerAids) -> Tracker:
    """Return correlation on the way, and from near the first picture of the narrow pair, if there is one."""
    from rover_iface.vision.narrow.recall import NarrowRecall
    from rover_iface.vision.template import NccOptions

    options = NccOptions(odometry_share=max(0.15, 3 * aids.odometry_error))
    return NarrowRecall(options, aids.narrow, aids.wide)


def flow(aids: TrackerAids) -> Tracker:
    """Return the tracker by optical flow, checked there and back."""
    from rover_iface.vision.correlation.klt import KltTracker
    from rover_iface.vision.template import NccOptions

    return KltTracker(NccOptions(odometry_share=max(0.15, 3 * aids.odometry_error)))


def features(aids: TrackerAids) -> Tracker:
    """Return the feature tracker of K9, by itself."""
    from rover_iface.vision.sift import SiftOptions, SiftTracker

    return SiftTracker(SiftOptions(odometry_share=max(0.05, aids.odometry_error)))


def features_and_shape(aids: TrackerAids) -> Tracker:
    """Return features on the way, the narrow pair's first picture and registration of surfaces on arrival."""
    from rover_iface.vision.narrow.arrival import ArrivalTracker
    from rover_iface.vision.shape_tracker import CombinedTracker
    from rover_iface.vision.sift import SiftOptions

    options = SiftOptions(odometry_share=max(0.05, aids.odometry_error))
    return ArrivalTracker(CombinedTracker(options), narrow=aids.narrow)
