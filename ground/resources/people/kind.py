"""How people, their sessions and keys are stored and shown."""

from __future__ import annotations

from collections.abc import Sequence

from ground.records.actor import Action, Role
from ground.records.kind import Kind
from ground.records.show import value_of
from ground.resources.people.bodies import PersonChange, PersonCreate
from ground.resources.people.row import PersonRow
from ground.resources.people.value import Person


def show_people(_session: object, rows: Sequence[PersonRow]) -> list[Person]:
    return [value_of(Person, r, role=Role(r.role)) for r in rows]


PERSON = Kind(
    "person",
    "person",
    "psn",
    "people",
    PersonRow,
    show_people,
    Action.ADMINISTER,
    make=PersonCreate,
    change=PersonChange,
    unseen=frozenset({"password_hash"}),
)
