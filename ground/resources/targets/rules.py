"""Rules of targets: each has a name of its own."""

from __future__ import annotations

from collections.abc import Set

from ground.errors import NameTakenError


def free_name(taken: Set[str], wanted: str | None) -> str:
    """Return a target's name: the one wanted, or the next of T1, T2, ...

    Raises
    ------
    NameTakenError
        If it is among those taken.
    """
    if wanted is None:
        number = len(taken) + 1
        while f"T{number}" in taken:
            number += 1
        return f"T{number}"
    if wanted in taken:
        raise NameTakenError(f"there is a target {wanted!r} already", pointer="/name")
    return wanted
