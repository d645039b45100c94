"""Tie a keep-out to a frame, so that it moves with it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import cast

from sqlalchemy.orm import Session

from ground.resources.frames.site_chain import load_chain, require_frame, tie_outline
from ground.resources.keep_outs.row import KeepOutRow


def tied_keep_out(session: Session, row: KeepOutRow, columns: Mapping[str, object]) -> dict[str, object]:
    """Return the columns that follow for a keep-out when its outline or frame is changed.

    Raises
    ------
    InvalidInputError
        If the mission has no such frame.
    """
    frame_id = columns.get("frame_id", row.frame_id)
    if not {"frame_id", "polygon_m"} & set(columns) or (frame_id is None and row.frame_id is None):
        return {}
    chain = load_chain(session, row.mission_id)
    if not isinstance(frame_id, str):
        return {"frame_id": None, "in_frame": None, "sigma_m": 0.0}
    require_frame(session, row.mission_id, frame_id)
    outline_m = cast("Sequence[Sequence[float]]", columns.get("polygon_m", row.polygon_m))
    return tie_outline(chain, frame_id, outline_m)
