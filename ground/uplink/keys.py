"""Ed25519 keys that sign uplink packages; private ones are files that only their owner reads."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey
from cryptography.hazmat.primitives.serialization import (
    Encoding,
    NoEncryption,
    PrivateFormat,
    PublicFormat,
    load_pem_private_key,
    load_pem_public_key,
)

from ground.errors import ArchiveError, ConflictError, UnavailableError

PRIVATE, PUBLIC = "uplink.key", "uplink.pub"


def key_id(key: Ed25519PublicKey) -> str:
    """Return the name of a key: 16 hexadecimal digits of the SHA-256 of its raw bytes."""
    return hashlib.sha256(key.public_bytes(Encoding.Raw, PublicFormat.Raw)).hexdigest()[:16]


def make_keys(folder: Path, *, replace: bool = False) -> tuple[Path, Path, str]:
    """Write a new pair of keys into a folder; return both files and the key's name.

    Raises
    ------
    ConflictError
        If there is a pair already and it is not to be replaced.
    """
    folder.mkdir(parents=True, exist_ok=True)
    private, public = folder / PRIVATE, folder / PUBLIC
    if private.exists() and not replace:
        raise ConflictError(f"{private} is there already; packages signed with it would lose their key")
    key = Ed25519PrivateKey.generate()
    private.unlink(missing_ok=True)
    descriptor = os.open(private, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(descriptor, "wb") as file:
        file.write(key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()))
    public.write_bytes(key.public_key().public_bytes(Encoding.PEM, PublicFormat.SubjectPublicKeyInfo))
    return private, public, key_id(key.public_key())


def load_private(folder: Path) -> Ed25519PrivateKey:
    """Return the private key of a folder.

    Raises
    ------
    UnavailableError
        If there is none, or it is no Ed25519 key.
    """
    path = folder / PRIVATE
    try:
        key = load_pem_private_key(path.read_bytes(), None)
    except FileNotFoundError as err:
        raise UnavailableError(f"there is no signing key {path}; make one with `outcrop keys new`") from err
    except (OSError, ValueError, TypeError) as err:
        raise UnavailableError(f"the signing key {path} cannot be read") from err
    if not isinstance(key, Ed25519PrivateKey):
        raise UnavailableError(f"{path} is no Ed25519 key")
    return key


def load_public(path: Path) -> Ed25519PublicKey:
    """Return a public key.

    Raises
    ------
    ArchiveError
        If the file holds none.
    """
    try:
        key = load_pem_public_key(path.read_bytes())
    except (OSError, ValueError, TypeError) as err:
        raise ArchiveError(f"{path} holds no public key") from err
    if not isinstance(key, Ed25519PublicKey):
        raise ArchiveError(f"{path} is no Ed25519 key")
    return key


def verified(key: Ed25519PublicKey, signature: bytes, content: bytes) -> bool:
    """Return whether a signature is that of the key over the content."""
    try:
        key.verify(signature, content)
    except InvalidSignature:
        return False
    return True
