"""Tables of planning problems."""

from __future__ import annotations

from sqlalchemy.orm import Mapped, mapped_column

from ground.gdr.base import JsonObject, Row, Sha256, mission_column
from ground.records.actor import ELSEWHERE
from planner.problem_document import ProblemDocument


class ProblemRow(Row):
    __tablename__ = "problems"

    mission_id: Mapped[str] = mission_column()
    sha256: Mapped[Sha256]
    document: Mapped[ProblemDocument] = mapped_column(JsonObject(none_as_null=True))


def came_with_an_archive(row: ProblemRow) -> bool:
    """Return whether a problem was made elsewhere: then it is what whoever wrote the archive says."""
    return row.author.endswith(ELSEWHERE)
