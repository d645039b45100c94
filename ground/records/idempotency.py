"""Remember the answers to requests that carried an Idempotency-Key, for a day.

The key is written at the head of the transaction in which its request takes effect, and the answer at its
end: after a crash there is all of it or nothing. Two requests with one key write the same row, so the second
waits for the first and then has its answer.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any, Protocol

from sqlalchemy import (
    LargeBinary,
    String,
    delete,
)
from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Mapped, Session, mapped_column

from ground.errors import IdempotencyError
from ground.gdr.base import Base, utc_now
from ground.gdr.repository import Repository

KEPT = timedelta(hours=24)
"""As long as a client may still repeat a request; the promise of docs/reference/rest.md."""


@dataclass(frozen=True, slots=True)
class StoredAnswer:
    """What was answered the first time; `headers` are those that belong to the resource."""

    status: int
    headers: dict[str, str]
    body: bytes


class Answer(Protocol):
    """What an endpoint answers with."""

    @property
    def status_code(self) -> int: ...

    @property
    def body(self) -> bytes | memoryview: ...

    @property
    def raw_headers(self) -> list[tuple[bytes, bytes]]: ...


class AnsweredBeforeError(Exception):
    """Leads out of a use case whose request was answered before; `answer` is what was said."""

    def __init__(self, answer: StoredAnswer) -> None:
        super().__init__("the request was answered before")
        self.answer = answer


class AnsweredMeanwhileError(Exception):
    """Leads out of a use case when another request with the key ended while this one waited for it."""


@dataclass(slots=True)
class Once:
    """One request with a key; `answered` when its answer is kept."""

    repo: Repository
    actor: str
    key: str
    request_sha256: str
    answered: bool = False

    def find(self) -> StoredAnswer | None:
        """Return the answer that was kept, None for the first request.

        Raises
        ------
        IdempotencyError
            If the first request was another one.
        """
        with self.repo.database.read() as session:
            return self._kept(session)

    def _kept(self, session: Session) -> StoredAnswer | None:
        row = session.get(IdempotencyRow, (self.actor, self.key))
        if row is None or row.status == 0 or row.created_utc < utc_now() - KEPT:
            return None
        if row.request_sha256 != self.request_sha256:
            raise IdempotencyError(
                "the Idempotency-Key was sent with another request before", pointer="Idempotency-Key"
            )
        return StoredAnswer(row.status, dict(row.headers), row.body)

    def _begin(self, session: Session) -> None:
        """Write the key at the head of a transaction: whoever comes with it too waits here."""
        kept = self._kept(session)
        if kept is not None:
            raise AnsweredBeforeError(kept)
        old = IdempotencyRow.created_utc < utc_now() - KEPT
        mine = (IdempotencyRow.actor == self.actor) & (IdempotencyRow.key == self.key)
        session.execute(delete(IdempotencyRow).where(old | (mine & (IdempotencyRow.status == 0))))
        session.expunge_all()
        row = IdempotencyRow(actor=self.actor, key=self.key, request_sha256=self.request_sha256)
        row.status, row.headers, row.body = 0, {}, b""
        session.add(row)
        try:
            session.flush()
        except IntegrityError as err:
            raise AnsweredMeanwhileError from err

    def run(self, endpoint: Callable[[], Answer]) -> Answer | StoredAnswer:
        """Return the answer of an endpoint, kept in the transaction in which it takes effect.

        An error of the endpoint takes all back that it wrote. An answer without a body is not kept.
        """
        while True:
            try:
                with self.repo.database.act(self._begin) as act:
                    answer = endpoint()
                    if hasattr(answer, "body") and answer.status_code < 500:
                        with self.repo.database.write() as session:
                            self._write(session, answer.status_code, answer.raw_headers, bytes(answer.body))
                        assert act.session is not None
                self.answered = True
                return answer
            except AnsweredBeforeError as err:
                self.answered = True
                return err.answer
            except AnsweredMeanwhileError:
                continue  # its answer is there now, or it failed and this one is the first

    def keep(self, status: int, headers: list[tuple[bytes, bytes]], body: bytes) -> StoredAnswer | None:
        """Keep an answer without effect, a refusal; return the one that was kept meanwhile, if there is one.

        Raises
        ------
        IdempotencyError
            If the key was used meanwhile with another request.
        """
        while True:
            try:
                with self.repo.database.act(self._begin), self.repo.database.write() as session:
                    self._write(session, status, headers, body)
                return None
            except AnsweredBeforeError as err:
                return err.answer
            except AnsweredMeanwhileError:
                continue

    def _write(self, session: Session, status: int, headers: list[tuple[bytes, bytes]], body: bytes) -> None:
        row = session.get_one(IdempotencyRow, (self.actor, self.key))
        row.status, row.body = status, body
        row.headers = {
            k.decode("latin-1"): v.decode("latin-1") for k, v in headers if k.lower() in _KEPT_HEADERS
        }


_KEPT_HEADERS = {b"content-type", b"location", b"etag", b"content-disposition"}


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
