"""Tables of comments."""

from __future__ import annotations

from sqlalchemy import (
    Index,
    String,
    Text,
)
from sqlalchemy.orm import Mapped, mapped_column

from ground.gdr.base import Row, mission_column


class CommentRow(Row):
    __tablename__ = "comments"
    __table_args__ = (Index("ix_comments_subject", "mission_id", "subject_kind", "subject_id"),)

    mission_id: Mapped[str] = mission_column()
    subject_kind: Mapped[str] = mapped_column(String(40))
    subject_id: Mapped[str] = mapped_column(String(40))
    text: Mapped[str] = mapped_column(Text)
