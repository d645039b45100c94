"""Look into the executive of a run, at any record of its journal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ground.errors import InvalidInputError, StateError
from ground.gdr.packed import is_kept, read_kept
from ground.gdr.repository import Repository
from ground.jobs.value import JobState
from ground.records.actor import Action, Actor
from ground.records.get_resource import find_row
from ground.resources.runs.kind import RUN
from ground.resources.runs.trace_value import CommandState, ContingencyState, NodeState, RunSnapshot
from mission.codec import Document

JOURNAL = "journal.jsonl"
OVER = {JobState.SUCCEEDED, JobState.FAILED, JobState.CANCELLED}


def read_snapshot(
    repo: Repository, actor: Actor, run_id: str, *, seq: int | None = None, t_s: float | None = None
) -> RunSnapshot:
    """Return the executive's state after the macro step of record `seq`, or of the last record up to `t_s`.

    Without either it is the newest record. A run that goes on is read as far as its journal has whole lines.

    Raises
    ------
    InvalidInputError
        If both are given, or the journal has no such record.
    StateError
        If the run has no journal (yet), or it cannot be read.
    """
    from executive.errors import ExecutiveError
    from executive.runtime.journal import JournalFile
    from executive.runtime.recovery import state_at

    if seq is not None and t_s is not None:
        raise InvalidInputError("give seq or t_s, not both", pointer="t_s")
    with repo.database.read() as session:
        row = find_row(session, RUN, run_id)
        actor.require(Action.READ, row.mission_id)
        complete = JobState(row.state) in OVER
    path = repo.run_dir(run_id) / JOURNAL
    if not is_kept(path):
        raise StateError(f"run {run_id} is {row.state} and has no journal here")
    try:
        records = JournalFile(path, read_kept(path)).records
        last = len(records) - 1
        if t_s is not None:
            seq = _last_until(records, round(t_s * 1000))
        if seq is not None and seq > last:
            raise InvalidInputError(
                f"the journal of run {run_id} has records 0 to {last}, there is no {seq}", pointer="seq"
            )
        wanted = last if seq is None else seq
        picture = state_at(records, wanted)
    except (ExecutiveError, OSError) as err:
        raise StateError(f"the journal of run {run_id} cannot be read: {err}") from err
    return _value_of(run_id, picture, wanted, last, complete)


def _last_until(records: Sequence[Mapping[str, Any]], t_ms: int) -> int:
    """Return the number of the last record that was written up to a time; times never go back."""
    found = 0
    for number, record in enumerate(records):
        if record.get("t", record.get("start", 0)) > t_ms:
            break
        found = number
    return found


def _seconds(t_ms: int | None) -> float | None:
    return None if t_ms is None else t_ms / 1000


def _value_of(run_id: str, picture: Document, seq: int, last: int, complete: bool) -> RunSnapshot:
    nodes = [
        NodeState(
            id=node["id"],
            kind=node["kind"],
            parent=node["parent"],
            state=node["state"],
            outcome=node["outcome"],
            reason=node["reason"],
            start_s=_seconds(node["start"]),
            end_s=_seconds(node["end"]),
            window_s=[_seconds(bound) for bound in node["window"]],
            attempts=node["attempts"],
            chosen=node["chosen"],
            action=node["action"],
            held=node["held"],
        )
        for node in picture["nodes"]
    ]
    return RunSnapshot(
        run_id=run_id,
        seq=seq,
        last_seq=last,
        complete=complete,
        t_s=picture["t"] / 1000,
        trace_count=picture["sequence"],
        paused=picture["paused"],
        over=picture["over"],
        outcome=picture["outcome"],
        next_wakeup_s=_seconds(picture["next_wakeup"]),
        reward=picture["reward"],
        nodes=nodes,
        commands=[CommandState(**command) for command in picture["commands"]],
        contingencies=[ContingencyState(**item) for item in picture["contingencies"]],
        watched=picture["watched"],
        pending_events=picture["pending_events"],
        resources=picture["resources"],
        database=picture["database"],
    )
