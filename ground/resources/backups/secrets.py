"""What of a repository is secret, sealed with a passphrase: hashes of passwords and of API keys.

scrypt (RFC 7914) makes the key from the passphrase, AES-256-GCM seals. n = 2**15, r = 8, p = 1 takes 32 MiB
and about 0.1 s: OWASP's Password Storage Cheat Sheet, 2024.
"""

from __future__ import annotations

import base64
import json
import os
from typing import Any

from ground.errors import ArchiveError

FORM = "backup-secrets/1"
_N, _R, _P = 2**15, 8, 1


def _key(passphrase: str, salt: bytes) -> bytes:
    from cryptography.hazmat.primitives.kdf.scrypt import Scrypt

    return Scrypt(salt=salt, length=32, n=_N, r=_R, p=_P).derive(passphrase.encode())


def seal(content: object, passphrase: str) -> bytes:
    """Return a JSON value sealed with a passphrase."""
    from cryptography.hazmat.primitives.ciphers.aead import AESGCM

    salt, nonce = os.urandom(16), os.urandom(12)
    sealed = AESGCM(_key(passphrase, salt)).encrypt(nonce, json.dumps(content).encode(), FORM.encode())
    parts = {"salt": salt, "nonce": nonce, "sealed": sealed}
    document = {"format": FORM} | {k: base64.b64encode(v).decode() for k, v in parts.items()}
    return json.dumps(document).encode()


def unseal(content: bytes, passphrase: str) -> Any:
    """Return what was sealed.

    Raises
    ------
    ArchiveError
        If the passphrase is another one, or it was altered.
    """
    from cryptography.exceptions import InvalidTag
    from cryptography.hazmat.primitives.ciphers.aead import AESGCM

    try:
        document = json.loads(content)
        salt, nonce, sealed = (base64.b64decode(document[k]) for k in ("salt", "nonce", "sealed"))
        return json.loads(AESGCM(_key(passphrase, salt)).decrypt(nonce, sealed, FORM.encode()))
    except (InvalidTag, ValueError, LookupError, TypeError) as err:
        raise ArchiveError("the secrets of the backup do not open with this passphrase") from err
