"""What the job that computes a path network is given."""

from __future__ import annotations

from ground.day.worksite import Worksite, from_version_0
from mission import Day
from mission.codec import Codec
from mission.values import value


@value
class NetworkOrder:
    """A path network for a day at a worksite."""

    site: Worksite
    day: Day


ORDERS = Codec(
    NetworkOrder,
    "network-order/1",
    "order for a path network",
    upgrades={"": ("network-order/1", from_version_0)},
)
