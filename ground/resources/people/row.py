"""Tables of people, their sessions and keys."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from sqlalchemy import ForeignKey, String
from sqlalchemy.orm import Mapped, mapped_column

from ground.gdr.base import Base, Long, Row, Sha256, Text20, Text40, Text80, utc_now


class PersonRow(Row):
    __tablename__ = "people"

    name: Mapped[Text80] = mapped_column(unique=True)
    role: Mapped[Text20]
    mission_roles: Mapped[dict[str, Any]]
    active: Mapped[bool] = mapped_column(default=True)
    password_hash: Mapped[Long | None]
    external_sha256: Mapped[Sha256 | None] = mapped_column(index=True, unique=True)
    """Of issuer and subject, where the person comes by an OpenID Connect provider."""


class CredentialRow(Base):
    """A session or an API key; only the hash of its secret is kept. A session's name is its program."""

    __tablename__ = "credentials"

    id: Mapped[Text40] = mapped_column(primary_key=True)
    kind: Mapped[Text20]
    person_id: Mapped[str] = mapped_column(ForeignKey("people.id", ondelete="CASCADE"), index=True)
    name: Mapped[Text80] = mapped_column(default="")
    secret_sha256: Mapped[Sha256] = mapped_column(unique=True)
    role: Mapped[Text20 | None]
    """What an API key may do at most; none where it may do all that its owner may."""
    mission_ids: Mapped[list[Any] | None]
    """Missions that an API key is for; none where it is for all of its owner's."""
    created_utc: Mapped[datetime] = mapped_column(default=utc_now)
    expires_utc: Mapped[datetime]


class SigningKeyRow(Base):
    """The public half of a person's signing key, under the key's own name."""

    __tablename__ = "signing_keys"

    id: Mapped[str] = mapped_column(String(16), primary_key=True)
    person_id: Mapped[str] = mapped_column(ForeignKey("people.id", ondelete="CASCADE"), index=True)
    name: Mapped[Text80] = mapped_column(default="")
    public: Mapped[str] = mapped_column(String(44))
    created_utc: Mapped[datetime] = mapped_column(default=utc_now)
    revoked_utc: Mapped[datetime | None]


class InvitationRow(Base):
    """A token by which the first administrator is made; only its hash is kept."""

    __tablename__ = "invitations"

    id: Mapped[Text40] = mapped_column(primary_key=True)
    secret_sha256: Mapped[Sha256] = mapped_column(unique=True)
    expires_utc: Mapped[datetime]


class LoginFailureRow(Base):
    """A login that failed; too many of them close the door for a while."""

    __tablename__ = "login_failures"

    id: Mapped[Text40] = mapped_column(primary_key=True)
    name: Mapped[Text80] = mapped_column(index=True)
    at_utc: Mapped[datetime] = mapped_column(default=utc_now)
