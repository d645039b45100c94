"""The telemetry dictionary: state keys a rover reports and plans may test.

A key with arguments is stored under `key argument`, for instance `trackerstate Rock1` (CRL.md, section 3).
"""

from __future__ import annotations

import math
from enum import StrEnum

from executive.crl.dictionary import TelemetryDictionary, ValueSpec, ValueType

VERSION = "1"


class TrackState(StrEnum):
    """State of one target's tracker, as trackers answer and `:trackerstate` reports (Kim et al. 2009).

    `IDLE`: not being tracked (never started, or stopped). `LOST`: the last update found nothing credible, the
    tracker still tries. `FAILED`: it has given up.
    """

    IDLE = "idle"
    TRACKED = "tracked"
    LOST = "lost"
    FAILED = "failed"


def _number(
    name: str, unit: str, doc: str, minimum: float | None = None, maximum: float | None = None
) -> ValueSpec:
    return ValueSpec(name, ValueType.NUMBER, unit, minimum=minimum, maximum=maximum, doc=doc)


_KEYS: tuple[tuple[ValueSpec, int], ...] = (
    (_number("battery-energy", "J", "energy left in the battery", 0), 0),
    (_number("energy-used", "J", "energy used since the start of the plan, hotel load included", 0), 0),
    (
        ValueSpec(
            "trackerstate",
            ValueType.STRING,
            choices=tuple(state.value for state in TrackState),
            doc="state of the tracker of the target named",
        ),
        1,
    ),
    (_number("trackerconfidence", "", "credibility of the last update of that target", 0, 1), 1),
    (_number("range", "m", "estimated distance of that target from the rover", 0), 1),
    (_number("pose", "m, m, rad", "estimated pose in the site frame: argument x, y or heading"), 1),
    (_number("tilt", "rad", "angle between the rover's up and the vertical", 0, math.pi), 0),
    (
        _number("sun-elevation", "rad", "height of the sun above the horizon", -math.pi / 2, math.pi / 2),
        0,
    ),
    (_number("novelty", "", "interest of what the cameras see, by the rover's own judgement", 0, 1), 0),
    (_number("heartbeat", "s", "plan time of the last sign of life", 0), 0),
)

TELEMETRY = TelemetryDictionary(
    "outcrop-rover",
    VERSION,
    keys={spec.name: spec for spec, _ in _KEYS},
    arguments={spec.name: count for spec, count in _KEYS},
)
"""The dictionary handed to the validator."""


def key(name: str, *arguments: str) -> str:
    """Return the database key: `key("trackerstate", "T1")` is `trackerstate T1`."""
    return " ".join((name, *arguments))
