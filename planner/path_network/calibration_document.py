"""The document of a calibration, in the oldest form that can say all of it."""

from __future__ import annotations

from typing import Any

from mission.codec import Codec
from planner.errors import ProblemError
from planner.path_network.calibration import Calibration

CALIBRATIONS = Codec(
    Calibration,
    "calibration/2",
    "calibration",
    upgrades={"calibration/1": ("calibration/2", lambda members: members)},
    error=ProblemError,
)


def calibration_document(calibration: Calibration) -> dict[str, Any]:
    """Return a calibration as a document; where no drive failed as `calibration/1`, which older programs
    read.
    """
    document = CALIBRATIONS.document(calibration)
    if calibration.fail_per_m or calibration.failures:
        return document
    later = ("fail_per_m", "fail_se_per_m", "failures")
    return {**{k: v for k, v in document.items() if k not in later}, "format": "calibration/1"}
