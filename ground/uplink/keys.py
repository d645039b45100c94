"""Key pairs of people, Ed25519: a private key is a file that only its owner reads; no server has it."""

from __future__ import annotations

import base64
import os
import stat
from pathlib import Path

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey
from cryptography.hazmat.primitives.serialization import (
    Encoding,
    NoEncryption,
    PrivateFormat,
    PublicFormat,
    load_pem_private_key,
    load_pem_public_key,
)

from ground.errors import ConflictError, InvalidInputError, UnavailableError
from ground.uplink.verify import key_id, message, public_key


def public_text(key: Ed25519PrivateKey | Ed25519PublicKey) -> str:
    """Return the raw bytes of a public key in base64, as trust files and the server hold it."""
    public = key.public_key() if isinstance(key, Ed25519PrivateKey) else key
    return base64.b64encode(public.public_bytes(Encoding.Raw, PublicFormat.Raw)).decode()


def id_of(public: str) -> str:
    """Return the name of a public key given in base64.

    Raises
    ------
    InvalidInputError
        If the text is not a public key.
    """
    try:
        public_key(public)
    except ValueError as err:
        raise InvalidInputError(
            "that is not an Ed25519 public key, 32 bytes in base64", pointer="/public"
        ) from err
    return key_id(base64.b64decode(public))


def sign(key: Ed25519PrivateKey, form: str, role: str, content: bytes) -> str:
    """Return the signature, base64, of a person over content that they sign in a role."""
    return base64.b64encode(key.sign(message(form, role, content))).decode()


def make_key(path: Path) -> Ed25519PrivateKey:
    """Write a new private key into a file that only its owner reads, and return it.

    Raises
    ------
    ConflictError
        If there is such a file: what was signed with a lost key cannot be signed again.
    """
    key = Ed25519PrivateKey.generate()
    path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    try:
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    except FileExistsError as err:
        raise ConflictError(f"{path} is there already; a key is never overwritten") from err
    except OSError as err:
        raise UnavailableError(f"the key {path} cannot be written: {err.strerror}") from err
    with os.fdopen(descriptor, "wb") as file:
        file.write(key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()))
    return key


def load_key(path: Path) -> Ed25519PrivateKey:
    """Return the private key of a file.

    Raises
    ------
    UnavailableError
        If there is none, others may read it, or it is not an Ed25519 key.
    """
    try:
        mode = stat.S_IMODE(path.stat().st_mode)
        if mode & 0o077:
            raise UnavailableError(f"others may read the key {path} (mode {mode:03o}); `chmod 600` it")
        key = load_pem_private_key(path.read_bytes(), None)
    except FileNotFoundError as err:
        raise UnavailableError(f"there is no key {path}; make one with `outcrop keys make`") from err
    except (OSError, ValueError, TypeError) as err:
        raise UnavailableError(f"the key {path} cannot be read") from err
    if not isinstance(key, Ed25519PrivateKey):
        raise UnavailableError(f"{path} is not an Ed25519 key")
    return key


def load_public(text: str) -> str:
    """Return a public key in base64, given so or as a file: base64 or PEM.

    Raises
    ------
    InvalidInputError
        If it is none of these.
    """
    path = Path(text)
    try:
        content = path.read_bytes() if path.is_file() else text.encode()
        if content.startswith(b"-----BEGIN PUBLIC"):
            key = load_pem_public_key(content)
            content = public_text(key).encode() if isinstance(key, Ed25519PublicKey) else b""
    except (OSError, ValueError) as err:
        raise InvalidInputError(f"{text[:80]} cannot be read as a public key") from err
    public = content.decode("ascii", "replace").strip()
    id_of(public)
    return public
