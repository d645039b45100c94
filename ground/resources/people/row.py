"""Tables of people, their sessions and keys."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from sqlalchemy import (
    ForeignKey,
    String,
    Text,
)
from sqlalchemy.orm import Mapped, mapped_column

from ground.gdr.base import Base, Row, utc_now


class PersonRow(Row):
    __tablename__ = "people"

    name: Mapped[str] = mapped_column(String(80), unique=True)
    role: Mapped[str] = mapped_column(String(20))
    mission_roles: Mapped[dict[str, Any]]
    active: Mapped[bool] = mapped_column(default=True)
    password_hash: Mapped[str | None] = mapped_column(Text)


class CredentialRow(Base):
    """A session or an API key; only the hash of its secret is kept."""

    __tablename__ = "credentials"

    id: Mapped[str] = mapped_column(String(40), primary_key=True)
    kind: Mapped[str] = mapped_column(String(20))
    person_id: Mapped[str] = mapped_column(ForeignKey("people.id", ondelete="CASCADE"), index=True)
    name: Mapped[str] = mapped_column(String(80), default="")
    secret_sha256: Mapped[str] = mapped_column(String(64), unique=True)
    created_utc: Mapped[datetime] = mapped_column(default=utc_now)
    expires_utc: Mapped[datetime]


class SigningKeyRow(Base):
    """The public half of a person's signing key, under the key's own name."""

    __tablename__ = "signing_keys"

    id: Mapped[str] = mapped_column(String(16), primary_key=True)
    person_id: Mapped[str] = mapped_column(ForeignKey("people.id", ondelete="CASCADE"), index=True)
    name: Mapped[str] = mapped_column(String(80), default="")
    public: Mapped[str] = mapped_column(String(44))
    created_utc: Mapped[datetime] = mapped_column(default=utc_now)
    revoked_utc: Mapped[datetime | None]


class LoginFailureRow(Base):
    """A login that failed; too many of them close the door for a while."""

    __tablename__ = "login_failures"

    id: Mapped[str] = mapped_column(String(40), primary_key=True)
    name: Mapped[str] = mapped_column(String(80), index=True)
    at_utc: Mapped[datetime] = mapped_column(default=utc_now)
