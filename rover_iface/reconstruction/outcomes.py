"""What became of a picture or a pair that was not used: a name that stays, and a sentence."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from rover_iface.errors import RoverError


class Reason(StrEnum):
    """Why a picture or a pair is not used."""

    UNREADABLE = "unreadable"
    NO_PICTURE = "no-picture"
    NO_POSE = "no-pose"
    LABEL_CONTRADICTION = "label-contradiction"
    OTHER_SITE = "other-site"
    NO_PARTNER = "no-partner"
    SIZE_DIFFERS = "size-differs"
    PICTURE_LOST = "picture-lost"
    FEW_MATCHES = "few-matches"
    SIDES_SWAPPED = "sides-swapped"
    ROWS_APART = "rows-apart"
    NO_DEPTH = "no-depth"
    SURFACES_APART = "surfaces-apart"


@dataclass(frozen=True, slots=True)
class Refusal:
    """One picture or pair, `subject`, that was left out, and why."""

    reason: Reason
    subject: str
    text: str

    def __str__(self) -> str:
        return f"{self.subject}: {self.reason}: {self.text}"


class RefusedError(RoverError):
    """A picture or a pair cannot be used; `refusal` says why. It does not leave this package."""

    def __init__(self, reason: Reason, subject: str, text: str) -> None:
        self.refusal = Refusal(reason, subject, text)
        super().__init__(str(self.refusal))
