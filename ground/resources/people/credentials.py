"""Sessions and API keys: opened, listed, taken back. Of a secret only its hash is kept; none is logged."""

from __future__ import annotations

import hashlib
import hmac
import secrets
from collections.abc import Collection, Sequence
from datetime import timedelta

from sqlalchemy import delete, select

from ground.errors import NotFoundError
from ground.gdr.base import utc_now
from ground.gdr.history import SYSTEM, Change, record
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor, KeyScope, Role
from ground.resources.people.accounts import actor_of, person_named, role_of
from ground.resources.people.row import CredentialRow, PersonRow
from ground.resources.people.value import ApiKey, NewApiKey, OpenSession, Person

KEY_PREFIX = "oc_"
SESSION, API_KEY = "session", "api_key"


def digest(secret: str) -> str:
    """Return what is kept of a secret."""
    return hashlib.sha256(secret.encode()).hexdigest()


def csrf_token(session_secret: str) -> str:
    """Return the token that belongs to a session; only who can read the cookie's owner's pages knows it."""
    return hmac.new(session_secret.encode(), b"csrf", hashlib.sha256).hexdigest()[:40]


def open_session(repo: Repository, person: Person, program: str = "") -> str:
    """Return the secret of a new session of a browser or another program."""
    secret, now = secrets.token_urlsafe(32), utc_now()
    with repo.database.write() as session:
        session.execute(delete(CredentialRow).where(CredentialRow.expires_utc < now))
        session.add(
            CredentialRow(
                id=new_id("ses"),
                kind=SESSION,
                person_id=person.id,
                name="".join(c for c in program if c.isprintable())[:80],
                secret_sha256=digest(secret),
                expires_utc=now + timedelta(hours=repo.settings.session_hours),
            )
        )
        record(session, SYSTEM, Change(person.name, "log_in", "person", person.id, None, None))
    return secret


def log_out(repo: Repository, secret: str) -> None:
    """End a session."""
    with repo.database.write() as session:
        session.execute(delete(CredentialRow).where(CredentialRow.secret_sha256 == digest(secret)))


def list_sessions(
    repo: Repository, actor: Actor, secret_sha256: str, *, everyone: bool = False
) -> list[OpenSession]:
    """Return the actor's open sessions, or everybody's for an administrator, the newest first.

    The one whose secret has `secret_sha256` is marked as the current one.
    """
    return [
        OpenSession(
            row.id, person, row.name, row.created_utc, row.expires_utc, row.secret_sha256 == secret_sha256
        )
        for row, person in _listed(repo, actor, SESSION, everyone)
    ]


def list_api_keys(repo: Repository, actor: Actor, *, everyone: bool = False) -> list[ApiKey]:
    """Return the actor's API keys, or everybody's for an administrator, the newest first."""
    return [
        ApiKey(row.id, person, row.name, _role(row), row.mission_ids, row.created_utc, row.expires_utc)
        for row, person in _listed(repo, actor, API_KEY, everyone)
    ]


def _listed(repo: Repository, actor: Actor, kind: str, everyone: bool) -> list[tuple[CredentialRow, str]]:
    if everyone:
        actor.require(Action.ADMINISTER)
    actor.require_person()
    query = (
        select(CredentialRow, PersonRow.name)
        .join(PersonRow, PersonRow.id == CredentialRow.person_id)
        .where(CredentialRow.kind == kind, CredentialRow.expires_utc >= utc_now())
        .order_by(CredentialRow.created_utc.desc(), CredentialRow.id)
    )
    if not everyone:
        query = query.where(PersonRow.name == actor.name)
    with repo.database.read() as session:
        return [(row, name) for row, name in session.execute(query)]


def create_api_key(
    repo: Repository,
    actor: Actor,
    name: str,
    days: int,
    role: Role | None = None,
    mission_ids: Sequence[str] | None = None,
) -> NewApiKey:
    """Return a new API key of the actor.

    It may do what the actor may at the time, at most what `role` may, and within `mission_ids` alone where
    they are given.
    """
    actor.require_person()
    secret = KEY_PREFIX + secrets.token_urlsafe(32)
    missions = None if mission_ids is None else sorted(set(mission_ids))
    with repo.database.write() as session:
        person = person_named(session, actor.name)
        row = CredentialRow(
            id=new_id("key"),
            kind=API_KEY,
            person_id=person.id,
            name=name,
            secret_sha256=digest(secret),
            role=None if role is None else role.value,
            mission_ids=missions,
            expires_utc=utc_now() + timedelta(days=days),
        )
        session.add(row)
        session.flush()
        told = {"name": name, "days": days, "role": row.role, "mission_ids": missions}
        record(session, SYSTEM, Change(actor.name, "create", API_KEY, row.id, None, told))
        return NewApiKey(
            row.id, actor.name, name, role, missions, row.created_utc, row.expires_utc, secret=secret
        )


def delete_api_key(repo: Repository, actor: Actor, key_id: str) -> None:
    """Take back an API key of one's own, or anybody's for an administrator."""
    _take_back(repo, actor, API_KEY, key_id)


def end_session(repo: Repository, actor: Actor, session_id: str) -> None:
    """End a session of one's own, or anybody's for an administrator."""
    _take_back(repo, actor, SESSION, session_id)


def _take_back(repo: Repository, actor: Actor, kind: str, identifier: str) -> None:
    actor.require_person()
    with repo.database.write() as session:
        row = session.get(CredentialRow, identifier)
        if row is None or row.kind != kind:
            raise NotFoundError(f"there is no {kind.replace('api_', 'API ')} {identifier}")
        owner = session.get_one(PersonRow, row.person_id)
        if owner.name != actor.name:
            actor.require(Action.ADMINISTER)
        before = {"name": row.name, "person": owner.name}
        session.delete(row)
        record(session, SYSTEM, Change(actor.name, "delete", kind, identifier, before, None))


def identify(repo: Repository, secrets_given: Collection[str]) -> dict[str, Actor]:
    """Return who sessions or API keys belong to, by their secrets.

    One that is unknown or outdated, or whose owner is shut out, is not among them.
    """
    digests = {digest(secret): secret for secret in secrets_given}
    query = (
        select(CredentialRow, PersonRow)
        .join(PersonRow, PersonRow.id == CredentialRow.person_id)
        .where(CredentialRow.secret_sha256.in_(digests))
    )
    now, found = utc_now(), {}
    with repo.database.read() as session:
        for credential, person in session.execute(query):
            if credential.expires_utc < now or not person.active:
                continue
            missions = None if credential.mission_ids is None else frozenset(credential.mission_ids)
            scoped = credential.role is not None or missions is not None
            scope = KeyScope(_role(credential), missions, credential.name) if scoped else None
            found[digests[credential.secret_sha256]] = actor_of(person, scope)
    return found


def _role(row: CredentialRow) -> Role | None:
    return None if row.role is None else role_of(row, row.role)
