"""Who does it, and what that person may do."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from ground.errors import ForbiddenError


class Role(StrEnum):
    """What a person may do is said by their role."""

    VIEWER = "viewer"
    SCIENTIST = "scientist"
    PLANNER = "planner"
    FLIGHT_DIRECTOR = "flight_director"
    OPERATOR = "operator"
    ADMIN = "admin"


class Action(StrEnum):
    """What can be allowed or not."""

    READ = "read"
    COMMENT = "comment"
    EDIT_SCIENCE = "edit_science"
    """Targets, observation requests."""
    EDIT_MISSION = "edit_mission"
    """Missions, sols, keep-outs, undo."""
    PLAN = "plan"
    """Path networks, plans, dry runs."""
    APPROVE = "approve"
    """Approval and waivers."""
    UPLINK = "uplink"
    """Uplink packages, downlink of runs."""
    ADMINISTER = "administer"
    """People, keys, deletion of missions."""


_READER = frozenset({Action.READ})
_SCIENTIST = _READER | {Action.COMMENT, Action.EDIT_SCIENCE}
_PLANNER = _SCIENTIST | {Action.EDIT_MISSION, Action.PLAN}
ALLOWED: Mapping[Role, frozenset[Action]] = {
    Role.VIEWER: _READER,
    Role.SCIENTIST: _SCIENTIST,
    Role.PLANNER: _PLANNER,
    Role.FLIGHT_DIRECTOR: _PLANNER | {Action.APPROVE, Action.UPLINK},
    Role.OPERATOR: _READER | {Action.COMMENT, Action.UPLINK},
    Role.ADMIN: frozenset(Action),
}
"""What each role may do. An administrator may do everything, but never approve a plan of their own."""


@dataclass(frozen=True, slots=True)
class KeyScope:
    """What a key is for, of all that its owner may: at most what `role` may, in `missions` alone."""

    role: Role | None = None
    missions: frozenset[str] | None = None

    def allows(self, action: Action, mission_id: str | None) -> bool:
        """Say whether the key is for it; what belongs to no mission may be read with any key."""
        if self.role is not None and action not in ALLOWED[self.role]:
            return False
        if self.missions is None or (mission_id is None and action is Action.READ):
            return True
        return mission_id in self.missions


@dataclass(frozen=True, slots=True)
class Actor:
    """A person at work; `mission_roles` replaces the role for single missions.

    With a key that is narrowed it may do what both the person and the key's `scope` allow.
    """

    name: str
    role: Role
    mission_roles: Mapping[str, str] = field(default_factory=dict)
    scope: KeyScope | None = None

    def role_in(self, mission_id: str | None) -> Role:
        """Return the role that counts for a mission."""
        given = self.mission_roles.get(mission_id or "")
        return Role(given) if given is not None else self.role

    def require(self, action: Action, mission_id: str | None = None) -> None:
        """Raise `ForbiddenError` unless this person may do it."""
        role = self.role_in(mission_id)
        if action not in ALLOWED[role]:
            raise ForbiddenError(
                f"{self.name} has the role {role.value}, which may not {action.value.replace('_', ' ')}"
            )
        if self.scope is not None and not self.scope.allows(action, mission_id):
            what = action.value.replace("_", " ")
            where = "" if mission_id is None else f" in mission {mission_id}"
            raise ForbiddenError(f"the API key of {self.name} is not for: {what}{where}")

    def require_person(self) -> None:
        """Raise `ForbiddenError` for a narrowed key: keys, sessions and passwords are its owner's matter."""
        if self.scope is not None:
            raise ForbiddenError(
                f"a narrowed API key of {self.name} may not touch keys, sessions or passwords"
            )


SYSTEM_ACTOR = Actor("system", Role.ADMIN)
"""The program itself: migrations, demo, jobs without a person."""
