"""What the job that adjusts a traverse is given."""

from __future__ import annotations

from mission.codec import Codec
from mission.values import value


@value
class SeenStop:
    """What was seen from one stop: a panorama or points at `path`, and where its frame lies."""

    name: str
    path: str
    file_name: str
    east_m: float
    north_m: float
    max_bytes: int


@value
class Accuracy:
    """How well the traverse was driven: odometry as a share of the path, headings and sun sightings in
    radians; legs longer than `longest_m` are not matched.
    """

    odometry: float
    heading_rad: float
    sun_rad: float | None
    longest_m: float


@value
class TraverseWork:
    """Stops of a traverse, in order; pictures go into the file store at `files_dir`."""

    stops: tuple[SeenStop, ...]
    files_dir: str
    options: Accuracy


ORDERS = Codec(
    TraverseWork, "traverse-order/1", "order for a traverse", upgrades={"": ("traverse-order/1", dict)}
)
