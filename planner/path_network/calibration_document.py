"""The document of a calibration, in the oldest form that can say all of it."""

from __future__ import annotations

from typing import Any

from mission.codec import Codec
from planner.errors import ProblemError
from planner.path_network.calibration import Calibration

CALIBRATIONS = Codec(
    Calibration,
    "calibration/4",
    "calibration",
    upgrades={
        "calibration/1": ("calibration/2", lambda members: members),
        "calibration/2": ("calibration/3", lambda members: members),
        "calibration/3": ("calibration/4", lambda members: members),
    },
    error=ProblemError,
)


FAILURES = ("fail_per_m", "fail_se_per_m", "failures")
DAYS = ("day_time_sd", "day_time_se", "day_energy_sd", "day_energy_se", "days")
"""Members of which `calibration/1` knows nothing."""
LEARNED = ("track_s", "fixed_j", "arrival_rate", "arrival_se", "activities")
"""Members of which `calibration/2` knows nothing."""
TOGETHER = ("intraday_correlation", "intraday_correlation_se", "days")
"""Members of activities of which `calibration/3` knows nothing."""


def calibration_document(calibration: Calibration) -> dict[str, Any]:
    """Return a calibration as a document, of the oldest version that says all of it: `calibration/3` where
    no successes of a day go together, `calibration/2` where nothing was learned of tracks' time and other
    activities, `calibration/1` where no drive is said to fail either and days are alike. Members of days
    stand only where days differ.
    """
    document = CALIBRATIONS.document(calibration)
    if any(one.days for one in calibration.activities):
        return document
    alone = [{k: v for k, v in one.items() if k not in TOGETHER} for one in document["activities"]]
    document = {**document, "activities": alone, "format": "calibration/3"}
    if calibration.track_s is not None or any(document[name] for name in LEARNED):
        return document
    document = {**{k: v for k, v in document.items() if k not in LEARNED}, "format": "calibration/2"}
    if calibration.days:
        return document
    document = {k: v for k, v in document.items() if k not in DAYS}
    if calibration.fail_per_m or calibration.failures:
        return document
    return {**{k: v for k, v in document.items() if k not in FAILURES}, "format": "calibration/1"}
