"""Errors and findings of the language.

::

    CrlError
    ├── CrlSyntaxError     the text is not a plan: code, line, column
    ├── CrlFormError       a JSON document is not the JSON form of a plan
    ├── DictionaryError    a file is not a dictionary of a rover, or contradicts itself
    └── CrlValidationError a plan was required to be valid and is not: holds the findings

What a validator says about a plan is a value, `Finding`; only a caller who *needs* a plan gets an exception.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum


class Severity(StrEnum):
    ERROR = "error"
    WARNING = "warning"


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that is wrong, or doubtful, in a plan.

    `node` is the id of the node, option, contingency or alternate concerned ("" for the plan itself or for
    the text); `line` and `column` count from 1 and are 0 when the plan was not read from text. `hint`
    proposes a remedy and may be empty. `length` is how many characters of the text the finding covers.
    """

    code: str
    severity: Severity
    message: str
    node: str = ""
    line: int = 0
    column: int = 0
    hint: str = ""
    length: int = 1

    @property
    def is_error(self) -> bool:
        return self.severity is Severity.ERROR

    def to_json(self) -> dict[str, object]:
        """Return the members that `outcrop crl check --json` prints."""
        document: dict[str, object] = {
            "code": self.code,
            "severity": self.severity.value,
            "message": self.message,
            "node": self.node,
            "line": self.line,
            "column": self.column,
        }
        if self.hint:
            document["hint"] = self.hint
        return document

    def __str__(self) -> str:
        place = f"{self.line}:{self.column}: " if self.line else ""
        return f"{place}{self.severity} {self.code}: {self.message}"


class CrlError(Exception):
    """Base class of the errors of the language."""


class CrlSyntaxError(CrlError):
    """The text is not a plan. `code` is one of section 9, `line` and `column` count from 1."""

    def __init__(
        self, message: str, *, code: str, line: int, column: int, node: str = "", hint: str = ""
    ) -> None:
        super().__init__(f"{line}:{column}: {code}: {message}")
        self.message = message
        self.code = code
        self.line = line
        self.column = column
        self.node = node
        self.hint = hint

    def finding(self) -> Finding:
        """Return the error as a finding."""
        return Finding(self.code, Severity.ERROR, self.message, self.node, self.line, self.column, self.hint)

    def __reduce__(self) -> tuple[object, ...]:
        return _rebuild_syntax_error, (self.message, self.code, self.line, self.column, self.node, self.hint)


def _rebuild_syntax_error(
    message: str, code: str, line: int, column: int, node: str, hint: str
) -> CrlSyntaxError:
    return CrlSyntaxError(message, code=code, line=line, column=column, node=node, hint=hint)


class CrlFormError(CrlError):
    """A JSON document is not the JSON form of a plan; the message names the member and its value."""


class DictionaryError(CrlError):
    """A file is not a dictionary of a rover, or contradicts itself."""


class CrlValidationError(CrlError):
    """A plan was rejected; `findings` holds everything the validator said, warnings too."""

    def __init__(self, findings: Sequence[Finding]) -> None:
        self.findings = tuple(findings)
        errors = [f for f in self.findings if f.is_error]
        more = f" (and {len(errors) - 1} more)" if len(errors) > 1 else ""
        super().__init__(f"{errors[0]}{more}" if errors else "rejected")

    def __reduce__(self) -> tuple[object, ...]:
        return CrlValidationError, (self.findings,)
