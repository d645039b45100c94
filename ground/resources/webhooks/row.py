"""Tables of webhooks, of how far each has come, and of what it sent."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from sqlalchemy import BigInteger, ForeignKey
from sqlalchemy.orm import Mapped, mapped_column

from ground.gdr.base import Base, Long, Row, Text20, Text40, Text80, Text200, mission_column, utc_now


class WebhookRow(Row):
    __tablename__ = "webhooks"

    mission_id: Mapped[str] = mission_column()
    name: Mapped[Text80]
    url: Mapped[Long]
    kinds: Mapped[list[Any]]
    active: Mapped[bool]


def _of_webhook() -> Mapped[str]:
    return mapped_column(ForeignKey("webhooks.id", ondelete="CASCADE"), primary_key=True)


class WebhookStateRow(Base):
    """Secrets of a webhook, and how far it has come.

    The secret itself is kept, as the server signs with it: never in an archive, and in a backup only among
    its secrets. A webhook without this row, as from a backup, sends nothing until its secret is made anew.
    """

    __tablename__ = "webhook_states"

    webhook_id: Mapped[str] = _of_webhook()
    secret: Mapped[Text80]
    old_secret: Mapped[Text80 | None]
    """That before the last rotation; it signs too until `old_until_utc`."""
    old_until_utc: Mapped[datetime | None]
    position: Mapped[int] = mapped_column(BigInteger)
    """The number of the last event that was delivered, given up or not asked for."""
    due_utc: Mapped[datetime] = mapped_column(default=utc_now)
    """When the next event may be sent: later than now after a failure."""
    lease: Mapped[Text40] = mapped_column(default="")
    leased_until_utc: Mapped[datetime | None]
    trouble: Mapped[Text200] = mapped_column(default="")


class WebhookDeliveryRow(Base):
    __tablename__ = "webhook_deliveries"

    webhook_id: Mapped[str] = _of_webhook()
    event: Mapped[int] = mapped_column(BigInteger, primary_key=True)
    type: Mapped[Text80]
    state: Mapped[Text20]
    attempts: Mapped[int]
    status: Mapped[int | None]
    detail: Mapped[Text200]
    at_utc: Mapped[datetime]
    next_utc: Mapped[datetime | None]
