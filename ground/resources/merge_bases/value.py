"""A merge base: the state of another mission that a mission holds."""

from __future__ import annotations

from dataclasses import dataclass

from ground.records.stored import OfMission


@dataclass(frozen=True, slots=True)
class MergeBase(OfMission):
    """What a mission took over from another, by a copy or a merge: its state behind an event."""

    from_id: str
    event: int
