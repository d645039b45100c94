"""A person with a role."""

from __future__ import annotations

from dataclasses import dataclass

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
