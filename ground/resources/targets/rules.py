"""Rules of targets: each has a name of its own."""

from __future__ import annotations

from typing import Protocol

from ground.errors import NameTakenError


class Names(Protocol):
    """Names that are taken."""

    def __len__(self) -> int: ...

    def __contains__(self, name: object) -> bool: ...


def free_name(taken: Names, wanted: str | None) -> str:
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
