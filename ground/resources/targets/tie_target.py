"""Tie a target to the frame that it was seen from, so that it moves with it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, TypedDict, cast

from sqlalchemy.orm import Session

from ground.resources.frames.site_chain import Chain, load_chain, require_frame
from ground.resources.targets.row import SeenTarget, TargetRow

if TYPE_CHECKING:
    from rover_iface.localization.anchored_chain import Placed


class TargetPlace(TypedDict):
    """Place, normal, slope and covariance of a target in the mission's axes: columns of its row."""

    east_m: float
    north_m: float
    up_m: float
    normal: list[float]
    slope_rad: float
    covariance_m2: list[list[float]]


def _tie_target(chain: Chain, frame_id: str, columns: TargetPlace) -> dict[str, object]:
    """Return the columns of a target tied to a frame, from its columns in the mission's axes.

    Place and normal stay; the covariance becomes that of the point and of the way between frame and anchor.
    """
    import numpy as np

    from rover_iface.frames import NED_FROM_ENU

    placed = chain.placed(frame_id)
    back = placed.anchor_from_frame.inverse()
    own = NED_FROM_ENU @ np.array(columns["covariance_m2"], dtype=float) @ NED_FROM_ENU
    in_frame: SeenTarget = {
        "position_m": back.apply(
            NED_FROM_ENU @ (columns["east_m"], columns["north_m"], columns["up_m"])
        ).tolist(),
        "normal": back.rotate(NED_FROM_ENU @ columns["normal"]).tolist(),
        "slope_over_normal_rad": columns["slope_rad"] - _lean(columns["normal"]),
        "covariance_m2": back.covariance(own).tolist(),
    }
    grown = target_columns_of(placed, in_frame)["covariance_m2"]
    return {"frame_id": frame_id, "in_frame": in_frame, "covariance_m2": grown}


def _lean(normal: Iterable[float]) -> float:
    """Return the angle between a normal and the vertical."""
    _, _, up = normal
    return math.acos(min(1.0, max(-1.0, float(up))))


def target_columns_of(placed: Placed, in_frame: SeenTarget) -> TargetPlace:
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


def untie_target(chain: Chain, row: TargetRow) -> dict[str, object]:
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


def tied_target(session: Session, row: TargetRow, columns: Mapping[str, object]) -> dict[str, object]:
    """Return the columns that follow for a target when its place or frame is changed.

    Raises
    ------
    InvalidInputError
        If the mission has no such frame.
    """
    places = {"east_m", "north_m"} & set(columns)
    frame_id = cast("str | None", columns.get("frame_id", row.frame_id))
    if not ("frame_id" in columns or places) or (frame_id is None and row.frame_id is None):
        return {}
    chain = load_chain(session, row.mission_id)
    if frame_id is not None:
        require_frame(session, row.mission_id, frame_id)
    loose = {} if places else untie_target(chain, row)
    if frame_id is None:
        return loose or {"frame_id": None, "in_frame": None}
    known = {name: getattr(row, name) for name in TargetPlace.__annotations__} | loose | dict(columns)
    return _tie_target(chain, frame_id, cast("TargetPlace", known))
