"""Errors of the forms of other tools.

GeodataError
└── MissingExtraError   a package of an extra is not installed; the message says how to get it
"""

from __future__ import annotations


class GeodataError(Exception):
    """What another tool's file or form says cannot be used, or ours cannot be said in it."""


class MissingExtraError(GeodataError):
    """A package of an extra is not installed."""
