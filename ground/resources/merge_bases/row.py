"""Tables of merge bases."""

from __future__ import annotations

from typing import Any

from sqlalchemy.orm import Mapped, mapped_column

from ground.errors import DamagedDataError
from ground.gdr.base import Large, Row, Text40, mission_column


class MergeBaseRow(Row):
    """What a mission took over from another: all of its state when an event of it had been written."""

    __tablename__ = "merge_bases"

    mission_id: Mapped[str] = mission_column()
    from_id: Mapped[Text40] = mapped_column(index=True)
    """The other mission; it may be gone."""
    event: Mapped[Large]
    """Number of the newest event of the other mission that is taken over."""
    pairs: Mapped[list[Any]]
    """[id there, id here] of each part that was made of one of the other mission."""


def pairs_of(row: MergeBaseRow) -> list[tuple[str, str]]:
    """Return the ids of what belongs together, there and here.

    Raises
    ------
    DamagedDataError
        If the row holds something else.
    """
    pairs = [(str(p[0]), str(p[1])) for p in row.pairs if isinstance(p, list) and len(p) == 2]
    if len(pairs) != len(row.pairs):
        raise DamagedDataError(f"the merge base {row.id} holds what is not a pair of ids")
    return pairs
