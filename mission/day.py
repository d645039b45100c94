"""A day of work as everybody takes it: what is asked where, from where the rover starts, what may be used.

Positions are metres in the site frame (east, north, up), headings radians from east, counter-clockwise;
times are seconds of the plan clock, energies joules.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import field
from typing import Annotated

from annotated_types import MinLen

from mission.codec import Codec
from mission.constraints import After, Constraint, MustDo, Tracked, Window
from mission.errors import MissionError
from mission.geometry import Pose
from mission.sky import Sky
from mission.values import NotNegative, Point2, Point3, Share, value


@value
class Target:
    """A point on a rock, with the outward normal of its surface."""

    id: str
    name: str
    point_site: Point3
    normal_site: Point3 = (0.0, 0.0, 1.0)


@value
class Request:
    """What a scientist asks of a target.

    Parameters
    ----------
    value
        Utility of the observation when it is made.
    constraints
        All of them must hold; of several windows one must.
    dwell_s
        Time on the surface beside the instrument's own.
    observation_point
        Where a person wants the rover to stand; None leaves it to base placement.
    """

    id: str
    target_id: str
    instrument: str
    value: NotNegative
    constraints: tuple[Constraint, ...] = ()
    dwell_s: NotNegative | None = None
    observation_point: Pose | None = None

    @property
    def tracked(self) -> bool:
        """Whether the target's track must be alive."""
        return any(isinstance(c, Tracked) for c in self.constraints)

    @property
    def must_do(self) -> bool:
        """Whether every plan must contain it."""
        return any(isinstance(c, MustDo) for c in self.constraints)

    @property
    def after(self) -> tuple[str, ...]:
        """Requests whose observations must have been made before."""
        return tuple(c.request_id for c in self.constraints if isinstance(c, After))

    @property
    def window(self) -> Window | None:
        """The first window that is said outright."""
        return next((c for c in self.constraints if isinstance(c, Window)), None)


@value
class KeepOut:
    """A region the rover must not enter: corners (east, north) of a simple polygon, closed by itself."""

    id: str
    polygon_m: Annotated[tuple[Point2, ...], MinLen(3)]


@value
class DriveRule:
    """What people say of the drive between two targets' stands, in both directions; None is the start.

    `via_m` are the corners (east, north) of the route from the first to the second that the rover takes,
    none for a straight line; None takes the drive out.
    """

    from_target_id: str | None
    to_target_id: str
    via_m: tuple[Point2, ...] | None = None


@value
class Limits:
    """What the day may use; the energy is above the battery's floor already."""

    time_s: NotNegative
    energy_j: NotNegative
    overrun_penalty: NotNegative = 0.0
    data_mbit: NotNegative | None = None
    max_overrun_probability: Share | None = None


@value
class Day:
    """One day of work, whole: what planner, jobs and simulated worlds are given (`day/1`).

    `refs` travels untouched into plans (mission, sol and the like).
    """

    name: str
    start: Pose
    limits: Limits
    targets: tuple[Target, ...] = ()
    requests: tuple[Request, ...] = ()
    keep_outs: tuple[KeepOut, ...] = ()
    drive_rules: tuple[DriveRule, ...] = ()
    sky: Sky = Sky()
    refs: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for what, ids in (
            ("target", [t.id for t in self.targets]),
            ("observation request", [r.id for r in self.requests]),
            ("keep-out", [k.id for k in self.keep_outs]),
        ):
            twice = sorted({i for i in ids if ids.count(i) > 1})
            if twice:
                raise MissionError(f"{what} {twice[0]} stands in the day twice")
        targets = {t.id for t in self.targets}
        requests = {r.id for r in self.requests}
        for request in self.requests:
            if request.target_id not in targets:
                raise MissionError(f"observation request {request.id}: unknown target {request.target_id}")
            for other in request.after:
                if other not in requests:
                    raise MissionError(
                        f"observation request {request.id}: comes after the unknown request {other}"
                    )
        for rule in self.drive_rules:
            for target in (rule.from_target_id, rule.to_target_id):
                if target is not None and target not in targets:
                    raise MissionError(f"a drive rule names the unknown target {target}")

    def target(self, target_id: str) -> Target:
        """Return one target."""
        return next(t for t in self.targets if t.id == target_id)

    def distance_m(self, target_id: str) -> float:
        """Return how far a target lies from the start, metres in the plane."""
        point = self.target(target_id).point_site
        return math.hypot(point[0] - self.start.east_m, point[1] - self.start.north_m)


DAYS = Codec(Day, "day/1", "day")
