"""The site chain of a mission, and what is tied to its frames.

A thing tied to a frame keeps, in the frame's own axes, what was seen from there (`in_frame`). Its columns in
the mission's axes follow from that and the solutions in use; so no carry adds to an error of the one before,
and the way back ends where it began.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.errors import InvalidInputError, StateError
from ground.gdr import models as m
from ground.gdr.frame_values import FramePlace

if TYPE_CHECKING:
    from rover_iface.localization.anchored_chain import AnchoredChain, Placed
    from rover_iface.localization.site_frames import FrameId

Columns = dict[str, Any]


def key_of(name: str, counter: Sequence[int]) -> str:
    """Return what a frame is known by within its mission."""
    return f"{name} {'.'.join(map(str, counter))}"


@dataclass(frozen=True)
class Chain:
    """The frames of a mission by the ids of their rows, as seen from its anchor."""

    names: Mapping[str, FrameId]
    placements: AnchoredChain | None

    def placed(self, frame_id: str) -> Placed:
        """Return where a frame lies.

        Raises
        ------
        StateError
            If nothing ties it to the anchor.
        """
        from rover_iface.errors import LocalizationError

        if self.placements is None:
            raise StateError("the mission has no anchor site; choose one (anchor_frame_id)")
        try:
            return self.placements.placed(self.names[frame_id])
        except LocalizationError as err:
            raise StateError(str(err)) from err

    def place(self, frame_id: str) -> FramePlace:
        """Return where a frame lies, in the mission's axes."""
        from rover_iface.frames import FRD_FROM_FLU, NED_FROM_ENU, rpy_of
        from rover_iface.localization.site_frames import SITE

        found = self.placed(frame_id)
        moved = found.anchor_from_frame
        axes = NED_FROM_ENU if self.names[frame_id].name == SITE else FRD_FROM_FLU
        east, north, up = (float(x) for x in NED_FROM_ENU @ moved.translation)
        _, spread = found.point((0.0, 0.0, 0.0))
        return FramePlace(
            east,
            north,
            up,
            rpy_of(NED_FROM_ENU @ moved.rotation @ axes)[2],
            (NED_FROM_ENU @ spread @ NED_FROM_ENU).tolist(),
            found.unknown,
        )


def load_chain(session: Session, mission_id: str, choices: Mapping[str, str] | None = None) -> Chain:
    """Return the chain of a mission; `choices` puts other solutions in use, by the ids of frames.

    Raises
    ------
    StateError
        If frames refer to each other in a circle.
    """
    from rover_iface.errors import LocalizationError
    from rover_iface.frames import Transform, rotation_from_quaternion
    from rover_iface.localization.anchored_chain import AnchoredChain, Link
    from rover_iface.localization.site_frames import FrameId

    f, s = m.FrameRow, m.SolutionRow
    rows = session.execute(
        select(f.id, f.name, f.counter, f.solution_id).where(f.mission_id == mission_id)
    ).all()
    names = {row.id: FrameId(row.name, tuple(row.counter)) for row in rows}
    used = {row.id: row.solution_id for row in rows if row.solution_id is not None} | dict(choices or {})
    anchor = session.scalar(select(m.MissionRow.anchor_frame_id).where(m.MissionRow.id == mission_id))
    if anchor is None:
        return Chain(names, None)
    wanted = set(used.values())
    links = {}
    for row in session.execute(
        select(s.id, s.frame_id, s.reference_id, s.offset_m, s.quaternion, s.covariance).where(
            s.mission_id == mission_id
        )
    ):
        if row.id in wanted and used[row.frame_id] == row.id:
            moved = Transform(rotation_from_quaternion(*row.quaternion), row.offset_m)
            links[names[row.frame_id]] = Link(names[row.reference_id], moved, row.covariance)
    try:
        return Chain(names, AnchoredChain(links, names[anchor]))
    except LocalizationError as err:
        raise StateError(f"the frames make no chain: {err}") from err


def tie_target(chain: Chain, frame_id: str, columns: Mapping[str, Any]) -> Columns:
    """Return the columns of a target tied to a frame, from its columns in the mission's axes.

    Place and normal stay; the covariance becomes that of the point and of the way between frame and anchor.
    """
    import numpy as np

    from rover_iface.frames import NED_FROM_ENU

    placed = chain.placed(frame_id)
    back = placed.anchor_from_frame.inverse()
    own = NED_FROM_ENU @ np.array(columns["covariance_m2"], dtype=float) @ NED_FROM_ENU
    in_frame = {
        "position_m": back.apply(
            NED_FROM_ENU @ (columns["east_m"], columns["north_m"], columns["up_m"])
        ).tolist(),
        "normal": back.rotate(NED_FROM_ENU @ columns["normal"]).tolist(),
        "slope_over_normal_rad": columns["slope_rad"] - _lean(columns["normal"]),
        "covariance_m2": back.covariance(own).tolist(),
    }
    grown = target_columns_of(placed, in_frame)["covariance_m2"]
    return {"frame_id": frame_id, "in_frame": in_frame, "covariance_m2": grown}


def _lean(normal: Any) -> float:
    """Return the angle between a normal and the vertical."""
    return math.acos(min(1.0, max(-1.0, float(normal[2]))))


def target_columns_of(placed: Placed, in_frame: Mapping[str, Any]) -> Columns:
    """Return place, normal, slope and covariance of a target in the mission's axes."""
    from rover_iface.frames import NED_FROM_ENU

    point, spread = placed.point(in_frame["position_m"], in_frame["covariance_m2"])
    east, north, up = (float(x) for x in NED_FROM_ENU @ point)
    normal = NED_FROM_ENU @ placed.anchor_from_frame.rotate(in_frame["normal"])
    return {
        "east_m": east,
        "north_m": north,
        "up_m": up,
        "normal": normal.tolist(),
        "slope_rad": _lean(normal) + in_frame["slope_over_normal_rad"],
        "covariance_m2": (NED_FROM_ENU @ spread @ NED_FROM_ENU).tolist(),
    }


def untie_target(chain: Chain, row: m.TargetRow) -> Columns:
    """Return the columns of a target that is tied to nothing any more: it stays, with its own covariance."""
    import numpy as np

    from rover_iface.frames import NED_FROM_ENU

    if row.frame_id is None or row.in_frame is None:
        return {"frame_id": None, "in_frame": None}
    moved = chain.placed(row.frame_id).anchor_from_frame
    own = moved.covariance(np.array(row.in_frame["covariance_m2"], dtype=float))
    return {
        "frame_id": None,
        "in_frame": None,
        "covariance_m2": (NED_FROM_ENU @ own @ NED_FROM_ENU).tolist(),
    }


def tie_outline(chain: Chain, frame_id: str, outline_m: Sequence[Sequence[float]]) -> Columns:
    """Return frame, outline in the frame's axes (at the anchor's height 0) and deviation of an outline."""
    import numpy as np

    from rover_iface.frames import NED_FROM_ENU

    placed = chain.placed(frame_id)
    corners = np.array([[e, n, 0.0] for e, n in outline_m]) @ NED_FROM_ENU
    in_frame = {"outline_m": placed.anchor_from_frame.inverse().apply(corners).tolist()}
    return {"frame_id": frame_id, "in_frame": in_frame, "sigma_m": outline_of(placed, in_frame)[1]}


def outline_of(placed: Placed, in_frame: Mapping[str, Any]) -> tuple[list[list[float]], float]:
    """Return corners [east, north] in the mission's axes, and the largest level deviation of the middle."""
    import numpy as np

    from rover_iface.frames import NED_FROM_ENU

    corners = np.array(in_frame["outline_m"], dtype=float)
    moved = placed.anchor_from_frame.apply(corners) @ NED_FROM_ENU
    _, spread = placed.point(corners.mean(axis=0))
    sigma = math.sqrt(max(0.0, float(np.linalg.eigvalsh(spread[:2, :2])[-1])))
    return moved[:, :2].tolist(), sigma


def tied_columns(session: Session, kind: str, row: Any, columns: Mapping[str, Any]) -> Columns:
    """Return the columns that follow for a target or keep-out when its place or frame is changed.

    Raises
    ------
    InvalidInputError
        If the mission has no such frame.
    """
    places = {"target": {"east_m", "north_m"}, "keep_out": {"polygon_m"}}.get(kind)
    if places is None or not ({"frame_id"} | places) & set(columns):
        return {}
    frame_id = columns.get("frame_id", row.frame_id)
    if frame_id is None and row.frame_id is None:
        return {}
    chain = load_chain(session, row.mission_id)
    if frame_id is not None:
        require_frame(session, row.mission_id, frame_id)
    if kind == "keep_out":
        if frame_id is None:
            return {"frame_id": None, "in_frame": None, "sigma_m": 0.0}
        return tie_outline(chain, frame_id, columns.get("polygon_m", row.polygon_m))
    loose = {} if places & set(columns) else untie_target(chain, row)
    if frame_id is None:
        return loose or {"frame_id": None, "in_frame": None}
    names = ("east_m", "north_m", "up_m", "normal", "slope_rad", "covariance_m2")
    return tie_target(chain, frame_id, {n: {**loose, **columns}.get(n, getattr(row, n)) for n in names})


def require_frame(session: Session, mission_id: str, frame_id: str, pointer: str = "/frame_id") -> m.FrameRow:
    """Return a frame of the mission.

    Raises
    ------
    InvalidInputError
        If the mission has no such frame.
    """
    row = session.get(m.FrameRow, frame_id)
    if row is None or row.mission_id != mission_id:
        raise InvalidInputError(f"there is no frame {frame_id} in mission {mission_id}", pointer=pointer)
    return row


def require_anchor(session: Session, mission_id: str, frame_id: str | None) -> None:
    """Raise unless the mission's anchor may become this frame: a site, while nothing is tied to a frame.

    Raises
    ------
    InvalidInputError, StateError
        If it may not.
    """
    if (
        frame_id is not None
        and require_frame(session, mission_id, frame_id, "/anchor_frame_id").level != "site"
    ):
        raise InvalidInputError("the anchor has to be a site frame", pointer="/anchor_frame_id")
    for row, what in ((m.TargetRow, "targets"), (m.KeepOutRow, "keep-outs"), (m.SiteMapRow, "maps")):
        tied = len(
            session.scalars(
                select(row.id).where(row.mission_id == mission_id, row.frame_id.is_not(None))
            ).all()
        )
        if tied:
            raise StateError(f"{tied} {what} are tied to frames; untie them before the anchor changes")
