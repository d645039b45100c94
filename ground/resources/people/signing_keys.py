"""Public halves of people's signing keys; the private ones never come here."""

from __future__ import annotations

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey
from sqlalchemy import select

from ground.errors import ConflictError, DamagedDataError, InvalidInputError, NotFoundError
from ground.gdr.base import utc_now
from ground.gdr.history import SYSTEM, Change, record
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.resources.people.accounts import person_named
from ground.resources.people.kind import PERSON
from ground.resources.people.row import PersonRow, SigningKeyRow
from ground.resources.people.value import SigningKey
from ground.uplink.keys import id_of
from ground.uplink.verify import message, public_key, signed_by

FORM = "signing-key/1"
"""What the owner of a key signs to show that they have it, in the role `owner`: their name in UTF-8."""


def list_signing_keys(repo: Repository, actor: Actor) -> list[SigningKey]:
    """Return everybody's public keys that the actor may know of, those that were revoked too."""
    actor.require(Action.READ)
    wanted = [PersonRow.__table__.c[name] == value for name, value in PERSON.only(actor).items()]
    with repo.database.read() as session:
        query = select(SigningKeyRow, PersonRow.name).join(PersonRow, PersonRow.id == SigningKeyRow.person_id)
        return [
            SigningKey(k.id, person, k.name, k.public, k.created_utc, k.revoked_utc)
            for k, person in session.execute(query.where(*wanted).order_by(SigningKeyRow.created_utc))
        ]


def register_signing_key(
    repo: Repository, actor: Actor, public: str, proof: str, name: str = ""
) -> SigningKey:
    """Return the actor's new signing key.

    Raises
    ------
    ForbiddenError
        If a narrowed API key asks: signatures are its owner's matter.
    InvalidInputError
        If it is not a key, or the proof is not the key's signature over the actor's name.
    ConflictError
        If the key is somebody else's, or was revoked.
    """
    actor.require_person()
    identifier = id_of(public)
    if not signed_by(public_key(public), proof, message(FORM, "owner", actor.name.encode())):
        raise InvalidInputError(f"the proof is not the key's signature for {actor.name}", pointer="/proof")
    with repo.database.write() as session:
        person = person_named(session, actor.name)
        row = session.get(SigningKeyRow, identifier)
        if row is None:
            row = SigningKeyRow(id=identifier, person_id=person.id, public=public, name=name)
            session.add(row)
            session.flush()
            after = {"public": public, "name": name}
            record(session, SYSTEM, Change(actor.name, "create", "signing_key", identifier, None, after))
        if row.person_id != person.id or row.revoked_utc is not None:
            raise ConflictError(f"the key {identifier} is somebody else's or was revoked")
        return SigningKey(row.id, actor.name, row.name, row.public, row.created_utc, row.revoked_utc)


def stored_key(identifier: str, public: str) -> Ed25519PublicKey:
    """Return a registered key; its name is its digest, so that no other can stand in its place.

    Raises
    ------
    DamagedDataError
        If the text is another key's than that of this name, or none.
    """
    try:
        if id_of(public) == identifier:
            return public_key(public)
    except InvalidInputError:
        pass
    raise DamagedDataError(f"the signing key {identifier} is not the one that was registered")


def revoke_signing_key(repo: Repository, actor: Actor, key_id: str) -> None:
    """Take back a key of one's own, or anybody's for an administrator; a trust file is another matter.

    Raises
    ------
    ForbiddenError
        If it is somebody else's, or a narrowed API key asks.
    NotFoundError
        If there is none.
    """
    actor.require_person()
    with repo.database.write() as session:
        row = session.get(SigningKeyRow, key_id)
        if row is None:
            raise NotFoundError(f"there is no signing key {key_id}")
        owner = session.get_one(PersonRow, row.person_id)
        if owner.name != actor.name:
            actor.require(Action.ADMINISTER)
        if row.revoked_utc is None:
            row.revoked_utc = utc_now()
            change = Change(actor.name, "delete", "signing_key", key_id, {"person": owner.name}, None)
            record(session, SYSTEM, change)
