"""Tables of traverses."""

from __future__ import annotations

from typing import Any

from sqlalchemy.orm import Mapped

from ground.gdr.base import Notes, Row, Text40, Text200, mission_column


class TraverseRow(Row):
    """Stops of recorded runs that were adjusted together: a job's result."""

    __tablename__ = "traverses"

    mission_id: Mapped[str] = mission_column()
    name: Mapped[Text200]
    notes: Mapped[Notes]
    job_id: Mapped[Text40]
    stops: Mapped[list[Any]]
    """Frame and source of each, in the order driven."""
    document: Mapped[dict[str, Any] | None]
    """`localization/1`, with the pictures; null while it is computed."""
    solution_ids: Mapped[list[Any]]
