"""Change a sol."""

from __future__ import annotations

from sqlalchemy.orm import Session

from ground.gdr.repository import Repository
from ground.records.kind import Changed, Prepared, given_columns
from ground.resources.sols.bodies import SolChange
from ground.resources.sols.create_sol import require_free_number
from ground.resources.sols.row import SolRow


def change_sol(
    _repo: Repository, session: Session, row: SolRow, given: SolChange, _prepared: Prepared
) -> Changed:
    """Return the columns of a sol that a change sets.

    Raises
    ------
    NameTakenError
        If the mission has a sol of that number.
    """
    if given.number is not None and given.number != row.number:
        require_free_number(session, row.mission_id, given.number)
    return Changed(given_columns(given))
