"""Remember the answers to requests that carried an Idempotency-Key, for a day."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

from sqlalchemy import (
    LargeBinary,
    String,
    delete,
)
from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Mapped, mapped_column

from ground.errors import ConflictError, IdempotencyError
from ground.gdr.base import Base, utc_now
from ground.gdr.repository import Repository

KEPT = timedelta(hours=24)
UNDERWAY = timedelta(minutes=5)
"""How long an unanswered key blocks its repeat: the first request may still be at work."""


@dataclass(frozen=True, slots=True)
class StoredAnswer:
    status: int
    headers: dict[str, str]
    body: bytes


def begin(repo: Repository, actor: str, key: str, request_sha256: str) -> StoredAnswer | None:
    """Return the answer of the first request with the key, or None for the first.

    Raises
    ------
    IdempotencyError
        If the first request was another one.
    ConflictError
        If the first is still being answered.
    """
    now = utc_now()
    try:
        with repo.database.write() as session:
            session.execute(delete(IdempotencyRow).where(IdempotencyRow.created_utc < now - KEPT))
            row = session.get(IdempotencyRow, (actor, key))
            if row is not None and row.status == 0 and row.created_utc < now - UNDERWAY:
                session.delete(row)
                session.flush()
                row = None
            if row is None:
                session.add(
                    IdempotencyRow(
                        actor=actor, key=key, request_sha256=request_sha256, status=0, headers={}, body=b""
                    )
                )
                return None
            if row.request_sha256 != request_sha256:
                raise IdempotencyError(
                    "the Idempotency-Key was sent with another request before", pointer="Idempotency-Key"
                )
            if row.status == 0:
                raise ConflictError("the first request with this Idempotency-Key is still being answered")
            return StoredAnswer(row.status, dict(row.headers), row.body)
    except IntegrityError as err:
        raise ConflictError("the first request with this Idempotency-Key is still being answered") from err


def finish(repo: Repository, actor: str, key: str, status: int, headers: dict[str, str], body: bytes) -> None:
    """Keep the answer."""
    with repo.database.write() as session:
        row = session.get(IdempotencyRow, (actor, key))
        if row is not None:
            row.status, row.headers, row.body = status, headers, body


def forget(repo: Repository, actor: str, key: str) -> None:
    """Let the key be used again: the request was not answered."""
    with repo.database.write() as session:
        session.execute(
            delete(IdempotencyRow).where(IdempotencyRow.actor == actor, IdempotencyRow.key == key)
        )


class IdempotencyRow(Base):
    """The answer given to a POST that carried an Idempotency-Key."""

    __tablename__ = "idempotency_keys"

    actor: Mapped[str] = mapped_column(String(80), primary_key=True)
    key: Mapped[str] = mapped_column(String(255), primary_key=True)
    request_sha256: Mapped[str] = mapped_column(String(64))
    status: Mapped[int]
    headers: Mapped[dict[str, Any]]
    body: Mapped[bytes] = mapped_column(LargeBinary)
    created_utc: Mapped[datetime] = mapped_column(default=utc_now)
