"""Merge a mission into another that it shares a past with: one act, or conflicts and nothing done."""

from __future__ import annotations

from sqlalchemy.orm import Session

from ground.errors import InvalidInputError, StateError
from ground.gdr.history import batched, hold_chain
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.edit import insert
from ground.records.get_resource import require_mission
from ground.resources.merge_bases.kind import MERGE_BASE
from ground.resources.merge_bases.row import MergeBaseRow
from ground.resources.merge_bases.value import MergeBase
from ground.resources.mission_merges.apply_merge import Applied, Plan, Writer, plan_of
from ground.resources.mission_merges.bodies import MissionMergeCreate
from ground.resources.mission_merges.compared import schema_of
from ground.resources.mission_merges.read_sides import Sides, head_of, read_sides, snapshot, told
from ground.resources.mission_merges.value import MissionMerge
from ground.resources.missions.row import MissionRow
from ground.versions.merge import Take
from ground.versions.rows import MergedRows, RowConflict, merge_rows


class _NotKeptError(Exception):
    """Ends a merge that was only to be looked at, or that the rules of the mission refuse."""


def merge_missions(
    repo: Repository, actor: Actor, mission_id: str, given: MissionMergeCreate
) -> MissionMerge:
    """Return what was merged, or the conflicts that leave everything as it is.

    Sols, targets, requests, keep-outs and what the mission rests on are merged. Plans, runs, approvals,
    signatures and comments stay where they are.

    Raises
    ------
    InvalidInputError
        If the missions have no merge base, or a choice is of no conflict.
    StateError
        If one of the missions moved on since it was looked at.
    ForbiddenError
        If a change needs a right that the actor does not have in the mission.
    """
    actor.require(Action.EDIT_SCIENCE, mission_id)
    actor.require(Action.READ, given.from_id)
    if not given.preview and (given.event is None or given.from_event is None):
        member = "event" if given.event is None else "from_event"
        raise InvalidInputError(
            "say which state of both missions was looked at: their newest events, as a preview tells them",
            pointer=f"/{member}",
        )
    with repo.database.read() as session:
        snapshot(session)
        for one in (mission_id, given.from_id):
            require_mission(session, one)
        sides = read_sides(session, mission_id, given.from_id)
        _require_still(given, sides.event, sides.from_event)
        schema = schema_of(sides.ours, sides.theirs, sides.base)
        choices = {(str(c.kind), c.id, c.field): Take(c.take) for c in given.choices}
        take = None if given.take is None else Take(given.take)
        try:
            found = merge_rows(sides.base, sides.ours, sides.theirs, schema, take, choices)
        except InvalidInputError as err:
            raise InvalidInputError(err.message, pointer="/choices") from err
        if found.rows is None:
            return _answer(sides, found.conflicts, None, None)
        plan = plan_of(repo, actor, session, sides, found.rows)
    done, base = Applied(), None
    try:
        with repo.database.whole() as session, batched(session, reason=_reason(session, sides, found)):
            for one in sorted((mission_id, given.from_id)):
                hold_chain(session, one)
            _require_still(given, head_of(session, mission_id), head_of(session, given.from_id), sides)
            writer = Writer(repo, actor, session, sides, found.rows, schema, plan, done)
            writer.write()
            base = _note(session, actor, sides, done)
            if done.wrong or given.preview:
                raise _NotKeptError
    except _NotKeptError:
        base = None
    conflicts = (*found.conflicts, *done.wrong)
    return _answer(sides, conflicts, None if done.wrong else plan, base)


def _require_still(
    given: MissionMergeCreate, event: int, from_event: int, sides: Sides | None = None
) -> None:
    """Raise unless both missions are as they were looked at.

    Raises
    ------
    StateError
        It names the mission that moved on.
    """
    seen = (given.event, given.from_event) if sides is None else (sides.event, sides.from_event)
    for word, before, now in (("the mission", seen[0], event), (given.from_id, seen[1], from_event)):
        if before is not None and before != now:
            raise StateError(
                f"{word} moved on: it is at event {now}, and was looked at as of {before}; look again",
                event=event,
                from_event=from_event,
            )


def _reason(session: Session, sides: Sides, found: MergedRows) -> str:
    """Return what the events of a merge say of where they come from."""
    name = session.get_one(MissionRow, sides.from_id).name
    taken = f"; {len(found.conflicts)} conflicts decided" if found.conflicts else ""
    return f"merged from {name} ({sides.from_id}) as of event {sides.from_event}{taken}"


def _note(session: Session, actor: Actor, sides: Sides, done: Applied) -> MergeBase:
    """Write down what both missions have in common now; undo of the merge takes it back too."""
    theirs_of = {our: their for their, our in sides.ours_of.items()}
    row = MergeBaseRow(
        id=new_id(MERGE_BASE.prefix),
        author=actor.name,
        mission_id=sides.mission_id,
        from_id=sides.from_id,
        event=sides.from_event,
        pairs=[[theirs_of.get(known, known), made] for known, made in done.ids.items()],
    )
    insert(session, actor, MERGE_BASE, row)
    return MERGE_BASE.show_one(session, row)


def _answer(
    sides: Sides, conflicts: tuple[RowConflict, ...], plan: Plan | None, base: MergeBase | None
) -> MissionMerge:
    counts = (0, 0, 0) if plan is None else (len(plan.added), len(plan.changed), len(plan.removed))
    return MissionMerge(
        base, [told(c) for c in conflicts], plan is not None, sides.event, sides.from_event, *counts
    )
