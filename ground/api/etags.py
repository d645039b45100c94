"""ETags of resources: which revision was seen, and whether an answer is still the one that was kept."""

from __future__ import annotations

import re
from hashlib import blake2b

from ground.errors import InvalidInputError, PreconditionRequiredError

_OURS = re.compile(r'"([0-9]{1,18})(?:-[0-9a-f]{12})?"', re.ASCII)


def digest_of(body: bytes) -> str:
    """Return what tells one body from another."""
    return blake2b(body, digest_size=6).hexdigest()


def etag_of(revision: int, body: bytes) -> str:
    """Return the ETag of a resource that is shown by a body.

    A resource shows things that follow from others (counts, whether a plan is stale), so the revision alone
    would not say whether it looks the same.
    """
    return f'"{revision}-{digest_of(body)}"'


def revision_wanted(if_match: str | None) -> int | None:
    """Return the revision in an If-Match header; None for `*`.

    Raises
    ------
    PreconditionRequiredError
        If there is no header.
    InvalidInputError
        If it is not one of our ETags.
    """
    if if_match is None:
        raise PreconditionRequiredError(
            "send the ETag that was read as If-Match, or * to change whatever stands there"
        )
    text = if_match.strip()
    if text == "*":
        return None
    ours = _OURS.fullmatch(text)
    if ours is None:
        raise InvalidInputError(
            f'If-Match has to be one strong ETag such as "3" or "3-0a1b2c3d4e5f", not {text[:40]!r}',
            pointer="If-Match",
        )
    return int(ours[1])


def is_known(etag: str, if_none_match: str) -> bool:
    """Return whether an ETag is among those of an If-None-Match header (weak comparison, RFC 9110)."""
    if if_none_match.strip() == "*":
        return True
    wanted = etag.removeprefix("W/")
    return any(part.strip().removeprefix("W/") == wanted for part in if_none_match.split(","))
