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


_PAIRS = [first + second for first in _ALPHABET for second in _ALPHABET]
"""Two digits of every number below 1024."""


def new_ids(prefix: str, count: int) -> list[str]:
    """Return as many ids as `new_id` would, in ascending order, at a fraction of the cost."""
    global _last_ms
    with _lock:
        first = max(_last_ms + 1, time.time_ns() // 1_000_000 - _EPOCH_MS)
        _last_ms = first + count - 1
    chance = memoryview(secrets.token_bytes(4 * count)).cast("I")
    two, last = _PAIRS, first + count
    made: list[str] = []
    while first < last:  # a second at a time, whose ids begin alike
        end = min(last, (first | 1023) + 1)
        begin = f"{prefix}-{two[first >> 30 & 1023]}{two[first >> 20 & 1023]}{two[first >> 10 & 1023]}"
        made += [
            f"{begin}{two[ms & 1023]}{two[c >> 15 & 1023]}{two[c >> 5 & 1023]}{_ALPHABET[c & 31]}"
            for ms, c in zip(range(first, end), chance[len(made) :], strict=False)
        ]
        first = end
    return made


def new_id(prefix: str) -> str:
    """Return `prefix-` and 13 characters: 8 of milliseconds since 2025, 5 of chance.

    Ids of one process ascend strictly, so lists are kept in order of the id.
    """
    global _last_ms
    with _lock:
        _last_ms = max(_last_ms + 1, time.time_ns() // 1_000_000 - _EPOCH_MS)
        moment = _last_ms
    return f"{prefix}-{_base32(moment, 8)}{_base32(secrets.randbits(25), 5)}"
