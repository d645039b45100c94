"""A key to sign with: a file of one's own, or the socket of a process that holds it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from ground.uplink.keys import load_key, public_text, sign
from ground.uplink.signer import RemoteKey, is_signer


class SigningKey(Protocol):
    """Signs content in a role of a form; signatures and public keys are base64."""

    def public_text(self) -> str:
        """Return the public half."""

    def sign(self, form: str, role: str, content: bytes) -> str:
        """Return the signature over content in a role."""


@dataclass(frozen=True, slots=True)
class _FileKey:
    key: Ed25519PrivateKey

    def public_text(self) -> str:
        return public_text(self.key)

    def sign(self, form: str, role: str, content: bytes) -> str:
        return sign(self.key, form, role, content)


def open_key(path: Path) -> SigningKey:
    """Return the key of a file, or of the signer whose socket it is.

    Raises
    ------
    UnavailableError
        If there is none, or others may use it.
    """
    return RemoteKey(path) if is_signer(path) else _FileKey(load_key(path))
