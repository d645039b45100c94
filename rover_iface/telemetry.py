"""Words of telemetry that the program itself speaks: states of a tracker, and how keys are put together.

Which keys a rover reports stands in its dictionary. A key with arguments is stored under `key argument`, for
instance `trackerstate Rock1` (CRL.md, section 3).
"""

from __future__ import annotations

from enum import StrEnum


class TrackState(StrEnum):
    """State of one target's tracker, as trackers answer and `:trackerstate` reports (Kim et al. 2009).

    `IDLE`: not being tracked (never started, or stopped). `LOST`: the last update found nothing credible, the
    tracker still tries. `FAILED`: it has given up.
    """

    IDLE = "idle"
    TRACKED = "tracked"
    LOST = "lost"
    FAILED = "failed"


def key(name: str, *arguments: str) -> str:
    """Return the database key: `key("trackerstate", "T1")` is `trackerstate T1`."""
    return " ".join((name, *arguments))
