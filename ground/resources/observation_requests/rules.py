"""Rules of observation requests: time windows, and the order among them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ground.errors import InvalidInputError


def require_window(window_s: Sequence[float] | None) -> None:
    """Raise unless a time window ends after it begins."""
    if window_s is not None and not window_s[0] < window_s[1]:
        raise InvalidInputError(
            f"the window ends at {window_s[1]:g} s and begins at {window_s[0]:g} s", pointer="/window_s"
        )


def require_order(before: Mapping[str, Sequence[str]], request_id: str | None, after: Sequence[str]) -> None:
    """Raise unless the requests to be done before exist in the mission and make no circle.

    `before` holds for each request of the mission those to be done before it; `request_id` is None for a new
    one.

    Raises
    ------
    InvalidInputError
        If one is not there, or the request would have to come before itself.
    """
    for index, other in enumerate(after):
        if other not in before or other == request_id:
            raise InvalidInputError(
                f"there is no other observation request {other} in the mission", pointer=f"/after/{index}"
            )
    seen: set[str] = set()
    stack = list(after)
    while stack:
        current = stack.pop()
        if current == request_id:
            raise InvalidInputError(f"{request_id} would have to come before itself", pointer="/after")
        if current not in seen:
            seen.add(current)
            stack.extend(before.get(current, ()))
