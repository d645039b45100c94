"""Pages of a list and the opaque cursor between them."""

from __future__ import annotations

import base64
import binascii
from dataclasses import dataclass
from typing import Any

from ground.errors import InvalidInputError


@dataclass(frozen=True, slots=True)
class Page:
    """One page of a list; `next_cursor` is null on the last."""

    items: list[Any]
    next_cursor: str | None


def encode_cursor(last_id: str) -> str:
    """Return an opaque cursor that goes on behind a row."""
    return base64.urlsafe_b64encode(last_id.encode()).decode().rstrip("=")


def decode_cursor(cursor: str) -> str:
    """Return the id behind which a page begins.

    Raises
    ------
    InvalidInputError
        If the cursor was not made by `encode_cursor`.
    """
    try:
        text = base64.urlsafe_b64decode(cursor.encode("ascii") + b"=" * (-len(cursor) % 4)).decode("ascii")
    except (binascii.Error, UnicodeError, ValueError) as err:
        raise InvalidInputError("the cursor was not made here", pointer="/cursor") from err
    if not text or not all(c.isalnum() or c == "-" for c in text):
        raise InvalidInputError("the cursor was not made here", pointer="/cursor")
    return text
