"""Short ids that sort by the time they were made."""

from __future__ import annotations

import secrets
import threading
import time

_ALPHABET = "0123456789abcdefghjkmnpqrstvwxyz"
_EPOCH_MS = 1_735_689_600_000  # 2025-01-01T00:00:00Z
_lock = threading.Lock()
_last_ms = 0


def _base32(number: int, digits: int) -> str:
    out = ""
    for _ in range(digits):
        number, digit = divmod(number, 32)
        out = _ALPHABET[digit] + out
    return out


def new_id(prefix: str) -> str:
    """Return `prefix-` and 13 characters: 8 of milliseconds since 2025, 5 of chance.

    Ids of one process ascend strictly, so lists are kept in order of the id.
    """
    global _last_ms
    with _lock:
        _last_ms = max(_last_ms + 1, time.time_ns() // 1_000_000 - _EPOCH_MS)
        moment = _last_ms
    return f"{prefix}-{_base32(moment, 8)}{_base32(secrets.randbits(25), 5)}"
