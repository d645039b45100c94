"""Errors of this folder."""

from __future__ import annotations


class PlanningFormatError(Exception):
    """A problem that has no form in the language, or a plan that is not one of it; the message names the
    thing, its value and the limit.
    """
