"""What the job that learns from runs is given."""

from __future__ import annotations

from mission.codec import Codec
from mission.values import value


@value
class CalibrationOrder:
    """Addresses of run folders to learn from; unless `strict`, those without a leg are passed over."""

    folders: tuple[str, ...]
    strict: bool
    name: str
    rover_profile: str
    terrain_dir: str


ORDERS = Codec(
    CalibrationOrder,
    "calibration-order/1",
    "order for a calibration",
    upgrades={"": ("calibration-order/1", dict)},
)
