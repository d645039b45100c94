"""The id of the request that is being answered: in its answer, in its problem document, in each log line."""

from __future__ import annotations

import re
import secrets

HEADER = "X-Request-Id"
_TAKEN = re.compile(r"[A-Za-z0-9._-]{8,64}", re.ASCII)


def request_id(sent: str | None) -> str:
    """Return the id that the client or a proxy gave its request, if it can be one, else a new one."""
    if sent is not None and _TAKEN.fullmatch(sent):
        return sent
    return secrets.token_hex(8)
