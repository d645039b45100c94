"""Passwords: checked at log-in, changed by their owner, set anew by an administrator."""

from __future__ import annotations

from sqlalchemy import delete, select
from sqlalchemy.orm import Session

from ground.errors import ConflictError, ForbiddenError, InvalidInputError, NotFoundError
from ground.gdr.history import SYSTEM, Change, record
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.resources.people.accounts import person_named
from ground.resources.people.kind import PERSON
from ground.resources.people.password_hash import fits, hash_of
from ground.resources.people.row import CredentialRow, PersonRow
from ground.resources.people.value import Person
from ground.settings import Authentication


def may_enter(repo: Repository, name: str, password: str) -> Person | None:
    """Return the person whose name and password fit, or None; takes the same time for a name nobody has."""
    with repo.database.read() as session:
        person = session.scalars(select(PersonRow).where(PersonRow.name == name)).first()
        enters = person is not None and person.active
        if repo.settings.auth is Authentication.ACCOUNTS:
            enters = fits(None if person is None else person.password_hash, password) and enters
        return None if person is None or not enters else PERSON.show_one(session, person)


def change_password(repo: Repository, actor: Actor, old: str, new: str, kept_sha256: str) -> None:
    """Give oneself a new password; all sessions of one's own end but the one whose secret has `kept_sha256`.

    Raises
    ------
    InvalidInputError
        If the old one is not the person's.
    ConflictError
        If the old one is somebody else's way in: with profiles nobody has a password.
    """
    actor.require_person()
    _require_accounts(repo)
    with repo.database.read() as session:
        known = person_named(session, actor.name).password_hash
    if not fits(known, old):
        raise InvalidInputError("this is not your password", pointer="/old")
    hashed = hash_of(new)
    with repo.database.write() as session:
        person = person_named(session, actor.name)
        if person.password_hash != known:
            raise ConflictError("your password was changed at the same time; log in anew")
        _set(session, actor, person, hashed, kept_sha256)


def reset_password(repo: Repository, actor: Actor, person_id: str, password: str) -> None:
    """Give somebody else a password; whoever was logged in as them is not any more.

    Raises
    ------
    ForbiddenError
        If it is one's own: that takes the old one, which a stolen session does not have.
    NotFoundError
        If there is no such person.
    """
    actor.require(Action.ADMINISTER)
    actor.require_person()
    _require_accounts(repo)
    hashed = hash_of(password)
    with repo.database.write() as session:
        person = session.get(PersonRow, person_id)
        if person is None:
            raise NotFoundError(f"there is no person {person_id}")
        if person.name == actor.name:
            raise ForbiddenError("your own password is changed with the old one (PUT /session/password)")
        _set(session, actor, person, hashed, "")


def set_password(repo: Repository, actor: Actor, name: str, password: str) -> None:
    """Give somebody a password, on the machine itself; whoever was logged in as them is not any more.

    Raises
    ------
    NotFoundError
        If nobody has the name.
    """
    actor.require(Action.ADMINISTER)
    hashed = hash_of(password)
    with repo.database.write() as session:
        _set(session, actor, person_named(session, name), hashed, "")


def _require_accounts(repo: Repository) -> None:
    if repo.settings.auth is not Authentication.ACCOUNTS:
        raise ConflictError("profiles have no passwords (OUTCROP_AUTH=accounts)")


def _set(session: Session, actor: Actor, person: PersonRow, hashed: str, kept_sha256: str) -> None:
    person.password_hash = hashed
    theirs = (CredentialRow.person_id == person.id) & (CredentialRow.kind == "session")
    session.execute(delete(CredentialRow).where(theirs, CredentialRow.secret_sha256 != kept_sha256))
    record(session, SYSTEM, Change(actor.name, "set_password", "person", person.id, None, None))
