"""Who does it, and what that person may do."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from ground.errors import ForbiddenError, InvalidInputError, NarrowedKeyError, NotFoundError


class Role(StrEnum):
    """What a person may do is said by their role."""

    NONE = "none"
    """Sees nothing: as a role for one mission it hides that mission; in general, all but those named."""
    VIEWER = "viewer"
    ASSISTANT = "assistant"
    """Reads and drafts: for keys of programs that propose, whose drafts people take over or reject."""
    SCIENTIST = "scientist"
    PLANNER = "planner"
    FLIGHT_DIRECTOR = "flight_director"
    OPERATOR = "operator"
    ADMIN = "admin"


class Action(StrEnum):
    """What can be allowed or not."""

    READ = "read"
    COMMENT = "comment"
    DRAFT = "draft"
    """Propose what changes nothing until a person takes it over."""
    EDIT_SCIENCE = "edit_science"
    """Targets, observation requests."""
    EDIT_MISSION = "edit_mission"
    """Missions, sols, keep-outs, undo."""
    PLAN = "plan"
    """Path networks, plans, dry runs."""
    STOP = "stop"
    """Stop a live run and its rover at once: whoever may plan and run, approve, or execute."""
    APPROVE = "approve"
    """Approval and waivers."""
    UPLINK = "uplink"
    """Uplink packages, downlink of runs."""
    ADMINISTER = "administer"
    """People, keys, deletion of missions."""


_READER = frozenset({Action.READ})
_SCIENTIST = _READER | {Action.COMMENT, Action.DRAFT, Action.EDIT_SCIENCE}
_PLANNER = _SCIENTIST | {Action.EDIT_MISSION, Action.PLAN, Action.STOP}
ALLOWED: Mapping[Role, frozenset[Action]] = {
    Role.NONE: frozenset(),
    Role.VIEWER: _READER,
    Role.ASSISTANT: _READER | {Action.DRAFT},
    Role.SCIENTIST: _SCIENTIST,
    Role.PLANNER: _PLANNER,
    Role.FLIGHT_DIRECTOR: _PLANNER | {Action.APPROVE, Action.UPLINK},
    Role.OPERATOR: _READER | {Action.COMMENT, Action.UPLINK, Action.STOP},
    Role.ADMIN: frozenset(Action),
}
"""What each role may do. An administrator may do everything, but never approve a plan of their own."""


@dataclass(frozen=True, slots=True)
class KeyScope:
    """What a key is for, of all that its owner may: at most what `role` may, in `missions` alone."""

    role: Role | None = None
    missions: frozenset[str] | None = None
    name: str = ""
    """Of the key: under it drafts are filed."""

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
        """Return the role that counts for a mission; none outside those that a narrowed key is for."""
        only = None if self.scope is None else self.scope.missions
        if mission_id is not None and only is not None and mission_id not in only:
            return Role.NONE
        given = self.mission_roles.get(mission_id or "")
        return Role(given) if given is not None else self.role

    def require(self, action: Action, mission_id: str | None = None) -> None:
        """Raise `ForbiddenError` unless this person may do it.

        Raises
        ------
        NotFoundError
            If it is in a mission that they may not see. What belongs to no mission may be read by all.
        """
        role = self.role_in(mission_id)
        if mission_id is None and action is Action.READ:
            return
        if mission_id is not None and role is Role.NONE:
            raise NotFoundError(f"there is no mission {mission_id}")
        if action not in ALLOWED[role]:
            raise ForbiddenError(
                f"{self.name} has the role {role.value}, which may not {action.value.replace('_', ' ')}"
            )
        if self.scope is not None and not self.scope.allows(action, mission_id):
            what = action.value.replace("_", " ")
            where = "" if mission_id is None else f" in mission {mission_id}"
            raise ForbiddenError(f"the API key of {self.name} is not for: {what}{where}")

    def may(self, action: Action, mission_id: str | None = None) -> bool:
        """Say whether `require` lets this person do it."""
        try:
            self.require(action, mission_id)
        except (ForbiddenError, NotFoundError):
            return False
        return True

    def may_somewhere(self, action: Action) -> bool:
        """Say whether this person may do it in general or in some mission."""
        missions = [m for m in self.mission_roles if self.sees(m)]
        roles = {self.role_in(mission_id) for mission_id in [None, *missions]}
        narrowed = None if self.scope is None else self.scope.role
        allowed = frozenset(Action) if narrowed is None else ALLOWED[narrowed]
        return any(action in ALLOWED[role] & allowed for role in roles)

    def require_somewhere(self, action: Action) -> None:
        """Raise `ForbiddenError` unless this person may do it in general or in some mission."""
        if not self.may_somewhere(action):
            self.require(action)
            raise ForbiddenError(f"{self.name} may not {action.value.replace('_', ' ')}")

    def sees(self, mission_id: str) -> bool:
        """Say whether a mission is there for this person."""
        return self.role_in(mission_id) is not Role.NONE

    @property
    def rights(self) -> str:
        """What the person may do, as one word: the same as long as it is the same."""
        scope = self.scope
        narrowed = (
            "" if scope is None else f"{scope.role} {sorted(scope.missions or ())} {scope.missions is None}"
        )
        return f"{self.role.value} {sorted(self.mission_roles.items())} {narrowed}\n"

    @property
    def sees_all(self) -> bool:
        """Whether no mission is hidden."""
        narrowed = self.scope is not None and self.scope.missions is not None
        return not narrowed and self.role is not Role.NONE and Role.NONE not in self.mission_roles.values()

    def visible_missions(self) -> tuple[frozenset[str] | None, frozenset[str]]:
        """Return the missions alone that this person sees, None for all; and those that are hidden."""
        named = frozenset(self.mission_roles)
        hidden = frozenset(m for m in named if not self.sees(m))
        if self.scope is not None and self.scope.missions is not None:
            return frozenset(m for m in self.scope.missions if self.sees(m)), hidden
        return (named - hidden if self.role is Role.NONE else None), hidden

    def require_person(self) -> None:
        """Raise `NarrowedKeyError` for a narrowed key: keys and sessions are its owner's matter."""
        if self.scope is not None:
            raise NarrowedKeyError(
                f"a narrowed API key of {self.name} may not touch keys, sessions or passwords"
            )


FIRST_ADMINISTRATOR, PROVIDER = "first administrator", "provider"
"""Who made a person, where no person did: the token of the log, and the OpenID Connect provider."""
ELSEWHERE = " (elsewhere)"
"""Behind the name of a person who did something in another repository."""


def require_free_name(name: str) -> None:
    """Raise `InvalidInputError` for a name under which something other than a person here acts."""
    plain = name.strip().casefold()
    if plain in {SYSTEM_ACTOR.name, FIRST_ADMINISTRATOR, PROVIDER}:
        raise InvalidInputError(f"nobody may be called {name!r}: the program acts under it", pointer="/name")
    if plain.endswith(ELSEWHERE.strip()):
        raise InvalidInputError(
            f"nobody may be called {name!r}: names that end in {ELSEWHERE.strip()!r} are of people of other "
            f"repositories",
            pointer="/name",
        )


SYSTEM_ACTOR = Actor("system", Role.ADMIN)
"""The program itself: migrations, demo, jobs without a person."""
