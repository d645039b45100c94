"""Hashes of passwords: argon2id with the library's defaults (RFC 9106), one at a time: each takes 64 MiB."""

from __future__ import annotations

import secrets
import threading
from functools import cache

_ONE = threading.Lock()


def hash_of(password: str) -> str:
    """Return the hash of a password, with its salt and parameters."""
    from argon2 import PasswordHasher

    with _ONE:
        return PasswordHasher().hash(password)


def fits(hashed: str | None, password: str) -> bool:
    """Say whether a password is the one of a hash; takes as long where there is none."""
    from argon2 import PasswordHasher
    from argon2.exceptions import Argon2Error, InvalidHashError

    wanted = hashed or _nobody()
    try:
        with _ONE:
            return PasswordHasher().verify(wanted, password) and bool(hashed)
    except (Argon2Error, InvalidHashError):
        return False


@cache
def _nobody() -> str:
    """Return the hash to check against when there is no such person."""
    return hash_of(secrets.token_hex(16))
