"""A draft: what an assistant or a sentence proposes for a mission, until a person decides on it."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum
from typing import Any

from ground.records.stored import OfMission


class DraftState(StrEnum):
    """Open until a person takes it over or rejects it."""

    OPEN = "open"
    ACCEPTED = "accepted"
    REJECTED = "rejected"


@dataclass(frozen=True, slots=True)
class Draft(OfMission):
    """A proposal that changes nothing by itself.

    `drafted_by` is the name of the key that drafted it, or of the person; `drafted_for` its owner. `form` is
    what a person would have filled in. Once accepted, `made_kind` and `made_id` say what was made or changed.
    """

    kind: str
    form: dict[str, Any]
    drafted_by: str
    drafted_for: str
    note: str
    state: str
    reason: str
    decided_by: str
    decided_utc: datetime | None
    made_kind: str
    made_id: str


@dataclass(frozen=True, slots=True)
class SentenceAnswer:
    """What was understood of a sentence. With `questions` there is no form and nothing can be drafted."""

    understood: bool
    questions: list[str]
    in_words: str
    """What accepting would do, in full."""
    assumed: list[str]
    """What the sentence did not say and the form has to."""
    kind: str
    form: dict[str, Any]
