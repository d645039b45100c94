"""The site chain of a mission, and what is tied to its frames.

A thing tied to a frame keeps, in the frame's own axes, what was seen from there (`in_frame`). Its columns in
the mission's axes follow from that and the solutions in use; so no carry adds to an error of the one before,
and the way back ends where it began.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.errors import InvalidInputError, StateError
from ground.resources.frames.row import FrameRow, SolutionRow
from ground.resources.frames.value import FramePlace
from ground.resources.missions.row import MissionRow

if TYPE_CHECKING:
    from rover_iface.localization.anchored_chain import AnchoredChain, Placed
    from rover_iface.localization.site_frames import FrameId


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

    f, s = FrameRow, SolutionRow
    rows = session.execute(
        select(f.id, f.name, f.counter, f.solution_id).where(f.mission_id == mission_id)
    ).all()
    names = {row.id: FrameId(row.name, tuple(row.counter)) for row in rows}
    used = {row.id: row.solution_id for row in rows if row.solution_id is not None} | dict(choices or {})
    anchor = session.scalar(select(MissionRow.anchor_frame_id).where(MissionRow.id == mission_id))
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


def tie_outline(chain: Chain, frame_id: str, outline_m: Sequence[Sequence[float]]) -> dict[str, object]:
    """Return frame, outline in the frame's axes (at the anchor's height 0) and deviation of an outline [n,
    2], all in m.
    """
    import numpy as np

    from rover_iface.frames import NED_FROM_ENU

    placed = chain.placed(frame_id)
    corners = np.array([[e, n, 0.0] for e, n in outline_m]) @ NED_FROM_ENU
    in_frame = {"outline_m": placed.anchor_from_frame.inverse().apply(corners).tolist()}
    return {"frame_id": frame_id, "in_frame": in_frame, "sigma_m": outline_of(placed, in_frame)[1]}


def outline_of(placed: Placed, in_frame: Mapping[str, object]) -> tuple[list[list[float]], float]:
    """Return corners [east, north] in the mission's axes, and the middle's largest level deviation; m."""
    import numpy as np

    from rover_iface.frames import NED_FROM_ENU

    corners = np.array(in_frame["outline_m"], dtype=float)
    moved = placed.anchor_from_frame.apply(corners) @ NED_FROM_ENU
    _, spread = placed.point(corners.mean(axis=0))
    sigma = math.sqrt(max(0.0, float(np.linalg.eigvalsh(spread[:2, :2])[-1])))
    return moved[:, :2].tolist(), sigma


def require_frame(session: Session, mission_id: str, frame_id: str, pointer: str = "/frame_id") -> FrameRow:
    """Return a frame of the mission.

    Raises
    ------
    InvalidInputError
        If the mission has no such frame.
    """
    row = session.get(FrameRow, frame_id)
    if row is None or row.mission_id != mission_id:
        raise InvalidInputError(f"there is no frame {frame_id} in mission {mission_id}", pointer=pointer)
    return row
