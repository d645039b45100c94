"""Moments of a filter."""

from __future__ import annotations

import re
from datetime import UTC, datetime

from neighbours.geodata.cql2.errors import Cql2Error
from neighbours.geodata.cql2.expression import Instant

_DAY = re.compile(r"\d{4}-\d{2}-\d{2}")
_MOMENT = re.compile(r"\d{4}-\d{2}-\d{2}T\d{2}:\d{2}:\d{2}(\.\d{1,9})?(Z|[+-]\d{2}:\d{2})", re.IGNORECASE)


def instant(text: str, position: int | None = None, *, day: bool = False) -> Instant:
    """Return a day (`2026-11-22`) or a moment with its zone (`2026-11-22T10:00:00Z`).

    Raises
    ------
    Cql2Error
        If it is none, or a moment without a zone.
    """
    form = _DAY if day else _MOMENT
    if not form.fullmatch(text):
        if not day and _MOMENT.fullmatch(f"{text}Z"):
            raise Cql2Error(f"{text[:40]!r} has no zone; UTC is {text}Z", position)
        wanted = "a date such as 2026-11-22" if day else "a moment such as 2026-11-22T10:00:00Z"
        raise Cql2Error(f"{text[:40]!r} is not {wanted}", position)
    try:
        found = datetime.fromisoformat(re.sub(r"(\.\d{6})\d+", r"\1", text.upper()))
    except ValueError as err:
        raise Cql2Error(f"{text[:40]!r} is not a date of the calendar", position) from err
    try:
        return Instant(found.replace(tzinfo=UTC) if day else found.astimezone(UTC), day)
    except OverflowError as err:
        raise Cql2Error(f"{text[:40]!r} lies outside the years 1 to 9999 in UTC", position) from err
