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
