"""Tables of planning problems."""

from __future__ import annotations

from typing import Any

from sqlalchemy.orm import Mapped

from ground.gdr.base import Row, Sha256, mission_column
from ground.records.actor import ELSEWHERE


class ProblemRow(Row):
    __tablename__ = "problems"

    mission_id: Mapped[str] = mission_column()
    sha256: Mapped[Sha256]
    document: Mapped[dict[str, Any]]


def came_with_an_archive(row: ProblemRow) -> bool:
    """Return whether a problem was made elsewhere: then it is what whoever wrote the archive says."""
    return row.author.endswith(ELSEWHERE)
