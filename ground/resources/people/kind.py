"""How people are stored and shown."""

from __future__ import annotations

from ground.records.actor import Action
from ground.records.kind import Kind
from ground.resources.people.bodies import PersonChange, PersonCreate
from ground.resources.people.row import PersonRow
from ground.resources.people.value import Person

PERSON = Kind(
    "person",
    "psn",
    "people",
    PersonRow,
    Person,
    Action.ADMINISTER,
    make=PersonCreate,
    change=PersonChange,
    unseen=frozenset({"password_hash"}),
)
