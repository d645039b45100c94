"""How people are stored and shown."""

from __future__ import annotations

from dataclasses import replace

from ground.records.actor import Action, Actor
from ground.records.kind import Kind
from ground.resources.people.bodies import PersonChange, PersonCreate
from ground.resources.people.row import PersonRow
from ground.resources.people.value import Person


def conceal_missions(actor: Actor, person: Person) -> Person:
    """Return a person without their roles in missions that the actor may not see."""
    if actor.sees_all:
        return person
    seen = {mission: role for mission, role in person.mission_roles.items() if actor.sees(mission)}
    return replace(person, mission_roles=seen)


def themselves(actor: Actor) -> dict[str, object]:
    """Let who may see nothing yet, a newcomer say, see nobody but themselves."""
    return {} if actor.may_somewhere(Action.READ) else {"name": actor.name}


PERSON = Kind(
    "person",
    "psn",
    "people",
    PersonRow,
    Person,
    Action.ADMINISTER,
    make=PersonCreate,
    change=PersonChange,
    conceal=conceal_missions,
    only=themselves,
    unseen=frozenset({"password_hash", "external_sha256"}),
)
