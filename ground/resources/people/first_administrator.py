"""The first administrator of a new service: whoever reads a one-time token in the server's log.

The first visitor of the page is nobody in particular; who reads the log owns the machine.
"""

from __future__ import annotations

import secrets
from datetime import timedelta

from sqlalchemy import delete, select, text
from sqlalchemy.orm import Session

from ground.errors import AuthenticationError, ConflictError, NameTakenError
from ground.gdr.base import utc_now
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
from ground.records.actor import FIRST_ADMINISTRATOR, SYSTEM_ACTOR, Role, require_free_name
from ground.records.edit import insert
from ground.resources.people.credentials import digest
from ground.resources.people.kind import PERSON
from ground.resources.people.password_hash import hash_of
from ground.resources.people.row import InvitationRow, PersonRow
from ground.resources.people.value import Person
from ground.settings import Authentication

VALID = timedelta(hours=24)
"""A server that is started again says a new one."""


def has_administrator(session: Session) -> bool:
    """Say whether somebody may administer and can log in."""
    query = select(PersonRow.id).where(PersonRow.role == Role.ADMIN.value, PersonRow.active)
    enters = PersonRow.password_hash.is_not(None) | PersonRow.external_sha256.is_not(None)
    return session.scalars(query.where(enters)).first() is not None


def wants_administrator(repo: Repository) -> bool:
    """Say whether the service is one with accounts and nobody to administer it."""
    if repo.settings.auth is not Authentication.ACCOUNTS:
        return False
    with repo.database.read() as session:
        return not has_administrator(session)


def invite(repo: Repository) -> str | None:
    """Return a one-time token for the first administrator; None if there is one, or accounts are not used.

    Only its hash is kept. Several servers of a database may each give one: the first that is used ends all.
    """
    if not wants_administrator(repo):
        return None
    token, now = secrets.token_urlsafe(24), utc_now()
    with repo.database.write() as session:
        session.execute(delete(InvitationRow).where(InvitationRow.expires_utc < now))
        row = InvitationRow(id=new_id("inv"), secret_sha256=digest(token), expires_utc=now + VALID)
        session.add(row)
    return token


def make_first_administrator(repo: Repository, token: str, name: str, password: str) -> Person:
    """Return the first administrator, whose token is used up then.

    Raises
    ------
    ConflictError
        If there is an administrator already.
    AuthenticationError
        If the token is not one that this service gave, or is outdated.
    InvalidInputError
        If the name is not for people.
    NameTakenError
        If somebody without administration has the name.
    """
    with repo.database.read() as session:
        _require_invited(session, token)
    require_free_name(name)
    hashed = hash_of(password)
    with repo.database.write() as session:
        if not repo.database.is_sqlite:  # two at the same time: one after the other
            session.execute(text("SELECT pg_advisory_xact_lock(hashtext('first administrator'))"))
        _require_invited(session, token)
        if session.scalars(select(PersonRow.id).where(PersonRow.name == name)).first():
            raise NameTakenError(f"there is somebody called {name!r} already", pointer="/name")
        row = PersonRow(
            id=new_id("psn"),
            author=FIRST_ADMINISTRATOR,
            name=name,
            role=Role.ADMIN.value,
            mission_roles={},
            active=True,
            password_hash=hashed,
        )
        insert(session, SYSTEM_ACTOR, PERSON, row)
        session.execute(delete(InvitationRow))
        return PERSON.show_one(session, row)


def _require_invited(session: Session, token: str) -> None:
    if has_administrator(session):
        raise ConflictError("there is an administrator already; log in, or ask them for an account")
    wanted = InvitationRow.secret_sha256 == digest(token)
    row = session.scalars(select(InvitationRow).where(wanted)).first()
    if row is None or row.expires_utc < utc_now():
        raise AuthenticationError("the token is not the one of the server's log, or is older than a day")
