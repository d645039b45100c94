"""A person with a role."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

from ground.records.actor import Role


@dataclass(frozen=True, slots=True)
class Person:
    """Somebody with a role; `mission_roles` overrides it for one mission."""

    id: str
    name: str
    role: Role
    mission_roles: dict[str, str]
    active: bool
    revision: int


@dataclass(frozen=True, slots=True)
class SigningKey:
    """The public half of a person's key, base64, under the name that trust files give it."""

    id: str
    person: str
    name: str
    public: str
    created_utc: datetime
    revoked_utc: datetime | None


@dataclass(frozen=True, slots=True)
class OpenSession:
    """A log-in that has not ended: of whom, with which program, and whether it is the one that asks."""

    id: str
    person: str
    program: str
    created_utc: datetime
    expires_utc: datetime
    current: bool


@dataclass(frozen=True, slots=True)
class ApiKey:
    """A key of a program: it may do what its owner may, at most what `role` may, in `mission_ids` alone.

    A role or missions that are None narrow nothing.
    """

    id: str
    person: str
    name: str
    role: Role | None
    mission_ids: list[str] | None
    created_utc: datetime
    expires_utc: datetime


@dataclass(frozen=True, slots=True)
class NewApiKey(ApiKey):
    """An API key with the one sight of its secret."""

    secret: str
