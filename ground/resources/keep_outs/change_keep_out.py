"""Change a keep-out's outline or the frame that it is tied to."""

from __future__ import annotations

from sqlalchemy.orm import Session

from ground.gdr.repository import Repository
from ground.records.kind import Changed, Prepared, given_columns
from ground.resources.keep_outs.bodies import KeepOutChange
from ground.resources.keep_outs.row import KeepOutRow
from ground.resources.keep_outs.rules import require_outline
from ground.resources.keep_outs.tie_keep_out import tied_keep_out
from ground.resources.missions.terrain import terrain_bounds


def change_keep_out(
    _repo: Repository, session: Session, row: KeepOutRow, given: KeepOutChange, _prepared: Prepared
) -> Changed:
    """Return the columns of a keep-out that a change sets.

    Raises
    ------
    InvalidInputError
        If the outline is none on this terrain, or the mission has no such frame.
    """
    columns = given_columns(given)
    if "polygon_m" in given.model_fields_set:
        require_outline(given.polygon_m, terrain_bounds(session, row.mission_id))
    return Changed(columns | tied_keep_out(session, row, columns))
