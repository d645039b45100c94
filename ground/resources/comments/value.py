"""A comment: a remark on any resource of a mission."""

from __future__ import annotations

from dataclasses import dataclass

from ground.records.stored import OfMission


@dataclass(frozen=True, slots=True)
class Comment(OfMission):
    """A remark on any resource of a mission; on a step of a plan, `part` is the step: its line and number."""

    subject_kind: str
    subject_id: str
    text: str
    part: str | None
