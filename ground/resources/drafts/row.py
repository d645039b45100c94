"""Tables of drafts."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from sqlalchemy.orm import Mapped

from ground.gdr.base import Long, Row, Text20, Text40, Text80, mission_column


class DraftRow(Row):
    __tablename__ = "drafts"

    mission_id: Mapped[str] = mission_column()
    kind: Mapped[Text20]
    form: Mapped[dict[str, Any]]
    drafted_by: Mapped[Text80]
    drafted_for: Mapped[Text80]
    note: Mapped[Long]
    state: Mapped[Text20]
    reason: Mapped[Long]
    decided_by: Mapped[Text80]
    decided_utc: Mapped[datetime | None]
    made_kind: Mapped[Text40]
    made_id: Mapped[Text40]
