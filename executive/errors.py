"""Errors of running a plan.

::

    ExecutiveError
    ├── JournalError     a journal cannot be read or written: names the file, the record and what is wrong
    ├── ScenarioError    a scenario file is broken: names the file and the member
    ├── MisuseError      a run is driven in a way that makes no sense (started twice, ...)
    └── WireError        a line to a rover, or what came over it, cannot be used: names the address or frame

A rejected plan is a `CrlValidationError` of the language (`executive.crl.errors`).
"""

from __future__ import annotations


class ExecutiveError(Exception):
    """Base class of the errors of running a plan."""


class JournalError(ExecutiveError):
    """A journal cannot be read or written."""


class ScenarioError(ExecutiveError):
    """A scenario file is broken."""


class MisuseError(ExecutiveError):
    """A run is driven in a way that makes no sense."""


class WireError(ExecutiveError):
    """A line to a rover, or what came over it, cannot be used."""
