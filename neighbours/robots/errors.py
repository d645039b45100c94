"""Errors of this folder.

RobotFormatError
├── RecordingError       a recording that cannot be read, or a mapping that does not fit it
└── MissingExtraError    a package of the extra `mcap` is not installed
"""

from __future__ import annotations


class RobotFormatError(Exception):
    """Base of all; the message names thing, value and limit."""


class RecordingError(RobotFormatError):
    """A recording that cannot be read, or a mapping that does not fit it."""


class MissingExtraError(RobotFormatError):
    """A package of an extra is not installed."""
