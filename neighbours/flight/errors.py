"""Errors of the forms of flight projects.

::

    FlightError
    |-- ForeignDictionaryError   a dictionary cannot be read, or parts of it contradict each other
    `-- SequenceError            a plan has what a sequence cannot say, or says it wrong for the dictionary
"""

from __future__ import annotations


class FlightError(Exception):
    """Base of all errors of this folder; the message names the thing, its value and the limit."""


class ForeignDictionaryError(FlightError):
    """A dictionary of another program cannot be used; `findings` holds each reason by itself."""

    def __init__(self, where: str, findings: tuple[str, ...]) -> None:
        self.findings = findings
        count = "" if len(findings) == 1 else f"{len(findings)} findings: "
        super().__init__(f"{where}: {count}" + "; ".join(findings))


class SequenceError(FlightError):
    """A plan cannot be written as a sequence; `unsaid` holds what a sequence cannot say, each by name."""

    def __init__(self, message: str, unsaid: tuple[str, ...] = ()) -> None:
        self.unsaid = unsaid
        super().__init__(message)
