"""People and the local profiles."""

from __future__ import annotations

from collections.abc import Collection

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from ground.errors import (
    DamagedDataError,
    InvalidInputError,
    NameTakenError,
    NotFoundError,
)
from ground.gdr.history import SYSTEM, ChainRow, open_chain
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
from ground.records.actor import SYSTEM_ACTOR, Action, Actor, KeyScope, Role, require_free_name
from ground.records.edit import insert
from ground.resources.people.kind import PERSON, conceal_missions
from ground.resources.people.password_hash import hash_of
from ground.resources.people.row import CredentialRow, PersonRow
from ground.resources.people.value import Person
from ground.settings import Authentication

PROFILES = (
    ("Planner", Role.PLANNER),
    ("Scientist", Role.SCIENTIST),
    ("Flight Director", Role.FLIGHT_DIRECTOR),
    ("Operator", Role.OPERATOR),
    ("Viewer", Role.VIEWER),
    ("Administrator", Role.ADMIN),
)
"""Local profiles of a new repository; who works without choosing one is the first."""


def ensure_profiles(repo: Repository) -> None:
    """Add the local profiles to a repository without people, and open the system's chain of events."""
    with repo.database.write() as session:
        if session.get(ChainRow, SYSTEM) is None:
            open_chain(session, SYSTEM)
        if session.scalar(select(func.count()).select_from(PersonRow)):
            return
        if repo.settings.auth is Authentication.PROFILES:
            for name, role in PROFILES:
                row = PersonRow(
                    id=new_id("psn"),
                    author="system",
                    name=name,
                    role=role.value,
                    mission_roles={},
                    active=True,
                )
                insert(session, SYSTEM_ACTOR, PERSON, row)


def create_person(
    repo: Repository, actor: Actor, name: str, role: Role, password: str | None = None
) -> Person:
    """Return a new person.

    Raises
    ------
    NameTakenError
        If somebody has the name.
    InvalidInputError
        If the name is not for people, or accounts are used and there is no password.
    """
    actor.require(Action.ADMINISTER)
    require_free_name(name)
    if repo.settings.auth is Authentication.ACCOUNTS and password is None:
        raise InvalidInputError("an account needs a password of 8 characters or more", pointer="/password")
    hashed = None if password is None else hash_of(password)
    with repo.database.write() as session:
        if session.scalars(select(PersonRow.id).where(PersonRow.name == name)).first():
            raise NameTakenError(f"there is somebody called {name!r} already", pointer="/name")
        row = PersonRow(
            id=new_id("psn"),
            author=actor.name,
            name=name,
            role=role.value,
            mission_roles={},
            active=True,
            password_hash=hashed,
        )
        insert(session, actor, PERSON, row)
        return PERSON.show_one(session, row)


def person_named(session: Session, name: str) -> PersonRow:
    person = session.scalars(select(PersonRow).where(PersonRow.name == name)).first()
    if person is None:
        raise NotFoundError(f"there is nobody called {name!r}")
    return person


def actor_of(person: PersonRow, scope: KeyScope | None = None) -> Actor:
    """Return a person as one who acts.

    Raises
    ------
    DamagedDataError
        If their row holds a role that there is not.
    """
    return Actor(person.name, role_of(person, person.role), dict(person.mission_roles), scope)


def role_of(row: PersonRow | CredentialRow, name: str) -> Role:
    """Return the role of a person or an API key.

    Raises
    ------
    DamagedDataError
        If there is none of that name.
    """
    try:
        return Role(name)
    except ValueError as err:
        raise DamagedDataError(f"the row {row.id} of {row.__tablename__} holds the role {name!r}") from err


def profiles(repo: Repository, names: Collection[str]) -> dict[str, Actor]:
    """Return local profiles by name, the first one for no name; none where profiles are not used."""
    if repo.settings.auth is not Authentication.PROFILES:
        return {}
    query = select(PersonRow).where(PersonRow.active)
    with repo.database.read() as session:
        named = {p.name: p for p in session.scalars(query.where(PersonRow.name.in_(names)))}
        if "" in names and (first := session.scalars(query.order_by(PersonRow.id).limit(1)).first()):
            named[""] = first
        return {name: actor_of(person) for name, person in named.items()}


def person_value(repo: Repository, actor: Actor) -> Person | None:
    """Return who the actor is, as they may see it."""
    with repo.database.read() as session:
        person = session.scalars(select(PersonRow).where(PersonRow.name == actor.name)).first()
        return None if person is None else conceal_missions(actor, PERSON.show_one(session, person))
