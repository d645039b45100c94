"""What a run needs but its seed: a plan, a world, a rover."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any

from mission.codec import Document

if TYPE_CHECKING:
    from executive.crl import Plan


def sha256_of(*texts: str) -> str:
    """Return the SHA-256 of texts, each ended by a zero byte."""
    digest = hashlib.sha256()
    for text in texts:
        digest.update(text.encode() + b"\0")
    return digest.hexdigest()


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
    def world(self) -> Document:
        """Return the world's document."""
        found: dict[str, Any] = json.loads(self.world_text)
        return found

    @property
    def problem(self) -> Document:
        """Return the planning problem of the world; empty where it has none."""
        found: Document = self.world.get("problem") or {}
        return found

    def plan(self) -> Plan:
        """Return the plan as CRL's value."""
        return _parsed(self.crl_text)


Cases = Mapping[str, Case]
"""Cases by the name of their series."""


@lru_cache(maxsize=16)
def _parsed(crl_text: str) -> Plan:
    from executive.crl.reader import parse

    return parse(crl_text)


def world_text(document: Document) -> str:
    """Return a world as canonical JSON."""
    return json.dumps(document, sort_keys=True, separators=(",", ":"))
