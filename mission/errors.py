"""Errors of the shared values.

MissionError
    FormatError     a document that cannot be read as the value it claims to be
    PluginError     an implementation that is not known, or a package's that cannot be loaded
"""

from __future__ import annotations


class MissionError(ValueError):
    """A value of a day contradicts itself; the message names the thing, its value and the limit."""


class FormatError(MissionError):
    """A document cannot be read; `members` is the way to the member at fault, outermost first."""

    def __init__(self, message: str, members: tuple[str | int, ...] = ()) -> None:
        super().__init__(message)
        self.members = members


class PluginError(MissionError):
    """A name stands for no implementation, or for one that cannot be loaded."""
