"""People, passwords, sessions and API keys. Of a secret only its hash is kept; none is ever logged."""

from __future__ import annotations

import hashlib
import hmac
import secrets
from dataclasses import dataclass
from datetime import datetime, timedelta

from sqlalchemy import delete, func, select
from sqlalchemy.orm import Session

from ground.errors import (
    InvalidInputError,
    NameTakenError,
    NotFoundError,
)
from ground.gdr.base import utc_now
from ground.gdr.history import SYSTEM, ChainRow, Change, open_chain, record
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
from ground.records.actor import SYSTEM_ACTOR, Action, Actor, Role
from ground.records.edit import insert
from ground.resources.people.kind import PERSON
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

KEY_PREFIX = "oc_"


def _digest(secret: str) -> str:
    return hashlib.sha256(secret.encode()).hexdigest()


def csrf_token(session_secret: str) -> str:
    """Return the token that belongs to a session; only who can read the cookie's owner's pages knows it."""
    return hmac.new(session_secret.encode(), b"csrf", hashlib.sha256).hexdigest()[:40]


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
        If accounts are used and there is no password.
    """
    actor.require(Action.ADMINISTER)
    if repo.settings.auth is Authentication.ACCOUNTS and password is None:
        raise InvalidInputError("an account needs a password of 8 characters or more", pointer="/password")
    hashed = None if password is None else _hasher().hash(password)
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


def set_password(repo: Repository, actor: Actor, name: str, password: str) -> None:
    """Give somebody a password; whoever was logged in as them is not any more.

    Raises
    ------
    NotFoundError
        If nobody has the name.
    """
    actor.require(Action.ADMINISTER)
    hashed = _hasher().hash(password)
    with repo.database.write() as session:
        person = person_named(session, name)
        person.password_hash = hashed
        mine = (CredentialRow.person_id == person.id) & (CredentialRow.kind == "session")
        session.execute(delete(CredentialRow).where(mine))
        record(session, SYSTEM, Change(actor.name, "set_password", "person", person.id, None, None))


def _hasher() -> _Hasher:
    return _Hasher()


class _Hasher:
    """argon2id with the library's defaults."""

    def hash(self, password: str) -> str:
        from argon2 import PasswordHasher

        return PasswordHasher().hash(password)

    def matches(self, hashed: str, password: str) -> bool:
        from argon2 import PasswordHasher
        from argon2.exceptions import Argon2Error, InvalidHashError

        try:
            return PasswordHasher().verify(hashed, password)
        except (Argon2Error, InvalidHashError):
            return False


_NOBODY_HASH = ""


def _nobody_hash() -> str:
    """Return a hash to check against when there is no such person, so that both take the same time."""
    global _NOBODY_HASH
    if not _NOBODY_HASH:
        _NOBODY_HASH = _hasher().hash(secrets.token_hex(16))
    return _NOBODY_HASH


def may_enter(repo: Repository, name: str, password: str) -> Person | None:
    """Return the person whose name and password fit, or None; takes the same time for a name nobody has."""
    with repo.database.read() as session:
        person = session.scalars(select(PersonRow).where(PersonRow.name == name)).first()
        fits = person is not None and person.active
        if repo.settings.auth is Authentication.ACCOUNTS:
            hashed = person.password_hash if person is not None and person.password_hash else _nobody_hash()
            fits = _hasher().matches(hashed, password) and fits
        return None if person is None or not fits else PERSON.show_one(session, person)


def open_session(repo: Repository, person: Person) -> str:
    """Return the secret of a new session."""
    secret, now = secrets.token_urlsafe(32), utc_now()
    with repo.database.write() as session:
        session.execute(delete(CredentialRow).where(CredentialRow.expires_utc < now))
        session.add(
            CredentialRow(
                id=new_id("ses"),
                kind="session",
                person_id=person.id,
                secret_sha256=_digest(secret),
                expires_utc=now + timedelta(hours=repo.settings.session_hours),
            )
        )
        record(session, SYSTEM, Change(person.name, "log_in", "person", person.id, None, None))
    return secret


def log_out(repo: Repository, secret: str) -> None:
    """End a session."""
    with repo.database.write() as session:
        session.execute(delete(CredentialRow).where(CredentialRow.secret_sha256 == _digest(secret)))


@dataclass(frozen=True, slots=True)
class NewKey:
    """An API key with the one sight of its secret."""

    id: str
    name: str
    secret: str
    expires_utc: datetime


def create_api_key(repo: Repository, actor: Actor, name: str, days: int) -> NewKey:
    """Return a new API key of the actor."""
    secret = KEY_PREFIX + secrets.token_urlsafe(32)
    with repo.database.write() as session:
        person = person_named(session, actor.name)
        row = CredentialRow(
            id=new_id("key"),
            kind="api_key",
            person_id=person.id,
            name=name,
            secret_sha256=_digest(secret),
            expires_utc=utc_now() + timedelta(days=days),
        )
        session.add(row)
        record(
            session,
            SYSTEM,
            Change(actor.name, "create", "api_key", row.id, None, {"name": name, "days": days}),
        )
        return NewKey(row.id, name, secret, row.expires_utc)


def delete_api_key(repo: Repository, actor: Actor, key_id: str) -> None:
    """Take back an API key of one's own, or anybody's for an administrator."""
    with repo.database.write() as session:
        row = session.get(CredentialRow, key_id)
        if row is None or row.kind != "api_key":
            raise NotFoundError(f"there is no API key {key_id}")
        owner = session.get(PersonRow, row.person_id)
        if owner is None or owner.name != actor.name:
            actor.require(Action.ADMINISTER)
        session.delete(row)
        record(session, SYSTEM, Change(actor.name, "delete", "api_key", key_id, {"name": row.name}, None))


def person_named(session: Session, name: str) -> PersonRow:
    person = session.scalars(select(PersonRow).where(PersonRow.name == name)).first()
    if person is None:
        raise NotFoundError(f"there is nobody called {name!r}")
    return person


def actor_of(person: PersonRow) -> Actor:
    return Actor(person.name, Role(person.role), dict(person.mission_roles))


def identify(repo: Repository, secret: str) -> Actor | None:
    """Return who a session or API key belongs to; None if it is unknown, outdated or its owner shut out."""
    with repo.database.read() as session:
        found = session.execute(
            select(CredentialRow, PersonRow)
            .join(PersonRow, PersonRow.id == CredentialRow.person_id)
            .where(CredentialRow.secret_sha256 == _digest(secret))
        ).first()
        if found is None:
            return None
        credential, person = found
        if credential.expires_utc < utc_now() or not person.active:
            return None
        return actor_of(person)


def default_actor(repo: Repository, name: str | None) -> Actor | None:
    """Return a local profile by name, or the first one; None if there is none or profiles are not used."""
    if repo.settings.auth is not Authentication.PROFILES:
        return None
    with repo.database.read() as session:
        query = select(PersonRow).where(PersonRow.active).order_by(PersonRow.id)
        if name is not None:
            query = query.where(PersonRow.name == name)
        person = session.scalars(query.limit(1)).first()
        return None if person is None else actor_of(person)


def person_value(repo: Repository, name: str) -> Person | None:
    """Return a person by name."""
    with repo.database.read() as session:
        person = session.scalars(select(PersonRow).where(PersonRow.name == name)).first()
        return None if person is None else PERSON.show_one(session, person)
