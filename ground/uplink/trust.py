"""Make and change trust files, `trust/1`: who may sign what, by the word of the root keys."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TypedDict

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from ground.errors import ArchiveError, InvalidInputError
from ground.uplink.keys import id_of, public_text, sign
from ground.uplink.verify import OLD_PACKAGE, SIGNERS, TRUST, RefusedError, Trust, read_trust

LIFE = timedelta(days=365)
"""How long a version is good for unless asked otherwise; who withholds newer ones gains no more than this."""

ROLES = ("root", *SIGNERS, OLD_PACKAGE)


class KeyHolder(TypedDict):
    """A public key and the person whose it is."""

    person: str
    public: str


class RoleRule(TypedDict):
    """How many people have to sign for a role, and by which keys, by their names."""

    threshold: int
    keys: list[str]


class TrustDocument(TypedDict):
    """One version as it is signed; `docs/formats/trust-1.schema.json` describes it."""

    rover: str
    version: int
    training: bool
    missions: list[str]
    expires_utc: str
    keys: dict[str, KeyHolder]
    roles: dict[str, RoleRule]


def new_trust(
    rover: str,
    roots: Mapping[str, Ed25519PrivateKey],
    *,
    missions: Iterable[str] = (),
    training: bool = False,
    life: timedelta = LIFE,
) -> TrustDocument:
    """Return the first version of a trust file, with nobody in it but the people of the root keys."""
    keys = {id_of(public_text(k)): KeyHolder(person=p, public=public_text(k)) for p, k in roots.items()}
    return {
        "rover": rover,
        "version": 1,
        "training": training,
        "missions": sorted(missions),
        "expires_utc": (datetime.now(UTC) + life).isoformat(timespec="seconds"),
        "keys": keys,
        "roles": {
            role: {"threshold": 1, "keys": sorted(keys) if role == "root" else []} for role in ROLES[:4]
        },
    }


def allow(document: TrustDocument, person: str, public: str, roles: Iterable[str]) -> None:
    """Let the key of a person count for roles.

    Raises
    ------
    InvalidInputError
        If a role is not known, or the key belongs to somebody else.
    """
    name = id_of(public)
    holder = document["keys"].setdefault(name, {"person": person, "public": public})["person"]
    if holder != person:
        raise InvalidInputError(f"the key {name} is that of {holder}; one key is one person's")
    for role in roles:
        if role not in ROLES:
            raise InvalidInputError(f"there is no role {role!r}; there are {', '.join(ROLES)}")
        rule = document["roles"].setdefault(role, {"threshold": 1, "keys": []})
        rule["keys"] = sorted({*rule["keys"], name})


def revoke(document: TrustDocument, name: str) -> None:
    """Take a key out of every role.

    Raises
    ------
    InvalidInputError
        If it is not in the trust file.
    """
    if name not in document["keys"]:
        raise InvalidInputError(f"there is no key {name}; there are {', '.join(document['keys'])}")
    del document["keys"][name]
    for role, rule in list(document["roles"].items()):
        rule["keys"] = [k for k in rule["keys"] if k != name]
        if role == OLD_PACKAGE and not rule["keys"]:
            del document["roles"][role]


def require(document: TrustDocument, role: str, threshold: int) -> None:
    """Say how many people have to sign for a role."""
    if role not in document["roles"]:
        raise InvalidInputError(f"there is no role {role!r}; there are {', '.join(document['roles'])}")
    document["roles"][role]["threshold"] = threshold


def write_trust(
    document: Mapping[str, object], roots: Iterable[Ed25519PrivateKey], earlier: bytes = b""
) -> bytes:
    """Return a trust file that ends in a version signed by the root keys given.

    Raises
    ------
    InvalidInputError
        If the root keys given are too few, those of the version before and of this one.
    """
    text = json.dumps(document, sort_keys=True, ensure_ascii=False)
    signatures = [
        {"key": id_of(public_text(key)), "signature": sign(key, TRUST, "root", text.encode())}
        for key in roots
    ]
    versions = json.loads(earlier)["versions"] if earlier else []
    whole = {"format": TRUST, "versions": [*versions, {"signed": text, "signatures": signatures}]}
    content = json.dumps(whole, indent=1, ensure_ascii=False).encode() + b"\n"
    try:
        read_trust(content)
    except RefusedError as err:
        raise InvalidInputError(str(err)) from err
    return content


def change_trust(
    earlier: bytes,
    roots: Iterable[Ed25519PrivateKey],
    edit: Callable[[TrustDocument], None],
    life: timedelta = LIFE,
) -> bytes:
    """Return a trust file with one more version, made by `edit` and signed by the root keys given."""
    checked(earlier)
    document: TrustDocument = json.loads(json.loads(earlier)["versions"][-1]["signed"])
    document["version"] += 1
    document["expires_utc"] = (datetime.now(UTC) + life).isoformat(timespec="seconds")
    edit(document)
    return write_trust(document, roots, earlier)


@contextlib.contextmanager
def refusals() -> Iterator[None]:
    """Raise what the verifier refuses as an `ArchiveError`."""
    try:
        yield
    except RefusedError as err:
        raise ArchiveError(str(err)) from err


def checked(content: bytes, *, pinned: str | None = None) -> Trust:
    """Return what a trust file says.

    Raises
    ------
    ArchiveError
        If it does not hold together, or does not hold the pinned version.
    """
    with refusals():
        return read_trust(content, pinned=pinned)


def read_file(path: Path, what: str) -> bytes:
    """Return the content of a file.

    Raises
    ------
    ArchiveError
        If it cannot be read.
    """
    try:
        return path.read_bytes()
    except OSError as err:
        raise ArchiveError(f"{what} {path} cannot be read: {err.strerror}") from err
