"""What people sign of a plan, and who signed it."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime


@dataclass(frozen=True, slots=True)
class Signed:
    """What a person signed a statement as: author, verifier or approver."""

    role: str
    person: str
    key: str
    signature: str
    created_utc: datetime


@dataclass(frozen=True, slots=True)
class Statement:
    """What author, verifier and approver of a plan sign: the manifest of its package.

    The bytes to sign are `outcrop package/2 ROLE`, a line feed, and the manifest in UTF-8. A statement is
    `current` as long as plan, mission, dictionary and models are what it says and it has not expired.
    """

    id: str
    mission_id: str
    plan_id: str
    counter: int
    sha256: str
    manifest: str
    current: bool
    expires_utc: datetime
    signatures: tuple[Signed, ...]
    created_utc: datetime
