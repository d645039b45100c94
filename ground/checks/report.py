"""What a check of a plan found, the format `plan-check/1`."""

from __future__ import annotations

from enum import StrEnum

from ground.errors import InvalidInputError
from ground.versions.difference import PlanDifference
from mission.codec import Codec
from mission.values import value


class Mark(StrEnum):
    """How an item stands; only `failed` fails the report."""

    PASSED = "passed"
    FAILED = "failed"
    UNDECIDED = "undecided"
    NOTE = "note"


@value
class Item:
    """One thing that was checked against the plan: stage, name, how it stands, and what to say."""

    stage: str
    name: str
    mark: Mark
    said: str


@value
class PlanCheck:
    """A plan, what was checked against it, and the processor seconds of each stage.

    `passed` holds if no item failed. An undecided item is one whose facts were not given.
    """

    plan: str
    crl_sha256: str
    passed: bool
    items: tuple[Item, ...]
    seconds: dict[str, float]
    difference: PlanDifference | None = None

    def count(self, mark: Mark) -> int:
        """Return how many items stand so."""
        return sum(item.mark is mark for item in self.items)


CHECKED = Codec(PlanCheck, "plan-check/1", "plan check", error=InvalidInputError)
