"""Tables of comments."""

from __future__ import annotations

from sqlalchemy import Index
from sqlalchemy.orm import Mapped

from ground.gdr.base import Long, Row, Text40, Text200, mission_column


class CommentRow(Row):
    __tablename__ = "comments"
    __table_args__ = (Index("ix_comments_subject", "mission_id", "subject_kind", "subject_id"),)

    mission_id: Mapped[str] = mission_column()
    subject_kind: Mapped[Text40]
    subject_id: Mapped[Text40]
    text: Mapped[Long]
    part: Mapped[Text200 | None]
