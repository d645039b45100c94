"""Change a keep-out's outline or the frame that it is tied to."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sqlalchemy.orm import Session

from ground.gdr.repository import Repository
from ground.records.kind import Changed, Prepared, plain
from ground.resources.keep_outs.create_keep_out import require_polygon
from ground.resources.keep_outs.row import KeepOutRow
from ground.resources.keep_outs.tie_keep_out import tied_keep_out


def change_keep_out(
    _repo: Repository, session: Session, row: KeepOutRow, members: Mapping[str, Any], _prepared: Prepared
) -> Changed:
    """Return the columns of a keep-out that a change sets.

    Raises
    ------
    InvalidInputError
        If the outline is none on this terrain, or the mission has no such frame.
    """
    columns = {name: plain(value) for name, value in members.items()}
    if "polygon_m" in members:
        require_polygon(session, row.mission_id, members["polygon_m"])
    return Changed(columns | tied_keep_out(session, row, columns))
