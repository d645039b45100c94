"""What differs between a mission and one that it shares a past with, and what a merge of them did."""

from __future__ import annotations

from dataclasses import dataclass

from ground.resources.merge_bases.value import MergeBase


@dataclass(frozen=True, slots=True)
class MissionEdit:
    """What one side (`ours`, `theirs`) or `both` alike did since the merge base.

    `action` is added, removed or changed; `kind` that of the resource. What was added in `theirs` has its id
    of there, all else its id of here.
    """

    side: str
    action: str
    kind: str
    id: str
    name: str
    field: str
    base: str
    now: str


@dataclass(frozen=True, slots=True)
class MissionConflict:
    """One place where the edits of two missions cannot be joined: resource, field, and what each says.

    With `choosable` a side can be taken, by `kind`, `id` and `field`; else one of the missions must change.
    """

    kind: str
    resource: str
    id: str
    name: str
    field: str
    base: str
    ours: str
    theirs: str
    choosable: bool


@dataclass(frozen=True, slots=True)
class MissionDifference:
    """What a mission (`ours`) and another (`theirs`) did since the merge base: an event of one of them.

    `event` and `from_event` are the newest events of both: what a merge says that it was looked at.
    """

    mission_id: str
    from_id: str
    base_mission_id: str
    base_event: int
    event: int
    from_event: int
    edits: list[MissionEdit]
    conflicts: list[MissionConflict]


@dataclass(frozen=True, slots=True)
class MissionMerge:
    """The merge, null where conflicts are open or it was only asked whether the missions can be `joined`.

    The counts are of resources that it adds, changes and removes.
    """

    merge: MergeBase | None
    conflicts: list[MissionConflict]
    joined: bool
    event: int
    from_event: int
    added: int
    changed: int
    removed: int
