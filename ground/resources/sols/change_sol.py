"""Change a sol."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sqlalchemy.orm import Session

from ground.gdr.repository import Repository
from ground.records.kind import Changed, Prepared, plain
from ground.resources.sols.create_sol import require_free_number
from ground.resources.sols.row import SolRow


def change_sol(
    _repo: Repository, session: Session, row: SolRow, members: Mapping[str, Any], _prepared: Prepared
) -> Changed:
    """Return the columns of a sol that a change sets.

    Raises
    ------
    NameTakenError
        If the mission has a sol of that number.
    """
    if "number" in members and members["number"] != row.number:
        require_free_number(session, row.mission_id, members["number"])
    return Changed({name: plain(value) for name, value in members.items()})
