"""What a run needs but its seed: a plan, a world, a rover."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, TypedDict, cast

if TYPE_CHECKING:
    from executive.crl import Plan
    from planner.problem_document import ObservationDocument, ProblemDocument, TargetDocument


def sha256_of(*texts: str) -> str:
    """Return the SHA-256 of texts, each ended by a zero byte."""
    digest = hashlib.sha256()
    for text in texts:
        digest.update(text.encode() + b"\0")
    return digest.hexdigest()


class World(TypedDict, total=False):
    """What the ground itself reads of a `world/1` document; paths are absolute."""

    format: str
    name: str
    terrain: str
    profile: str
    battery_j: float
    sun: Mapping[str, float]
    problem: ProblemDocument


@dataclass(frozen=True)
class Case:
    """A plan that is to be flown in a world by a rover, as texts: hashable, and small enough to be sent.

    Parameters
    ----------
    crl_text
        The plan, canonical.
    world_text
        A `world/1` document as canonical JSON: problem inside, paths absolute.
    rover
        Name of a rover of `outcrop.rovers`.
    """

    crl_text: str
    world_text: str
    rover: str

    @cached_property
    def digest(self) -> str:
        """Return the SHA-256 of all of it."""
        return sha256_of(self.crl_text, self.world_text, self.rover)

    @cached_property
    def world(self) -> World:
        """Return the world's document."""
        found: World = json.loads(self.world_text)
        return found

    @property
    def problem(self) -> ProblemDocument:
        """Return the planning problem of the world; empty where it has none."""
        return cast("ProblemDocument", self.world.get("problem") or {})

    def plan(self) -> Plan:
        """Return the plan as CRL's value."""
        return _parsed(self.crl_text)


Cases = Mapping[str, Case]
"""Cases by the name of their series."""


@lru_cache(maxsize=16)
def _parsed(crl_text: str) -> Plan:
    from executive.crl.reader import parse

    return parse(crl_text)


def observations_of(target: TargetDocument) -> Sequence[ObservationDocument]:
    """Return the observations of a target; in a `contingency/1` document it is its only one itself."""
    return target["observations"] if "observations" in target else [cast("ObservationDocument", target)]


def world_text(document: Mapping[str, object]) -> str:
    """Return a world as canonical JSON."""
    return json.dumps(document, sort_keys=True, separators=(",", ":"))
