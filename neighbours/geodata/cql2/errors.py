"""What is wrong with a filter.

Cql2Error    the text is not CQL2, asks for what is not there, or compares what cannot be compared
"""

from __future__ import annotations


class Cql2Error(ValueError):
    """A filter that cannot be used; `position` is the character, from 1, where the fault was seen."""

    def __init__(self, message: str, position: int | None = None) -> None:
        super().__init__(message if position is None else f"{message} (at character {position})")
        self.position = position
