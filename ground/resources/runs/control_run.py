"""Pause, resume, step, speed up or abort a dry run that goes on."""

from __future__ import annotations

import json
import threading
from dataclasses import replace

from ground.errors import StateError
from ground.gdr.repository import Repository
from ground.jobs.row import JobRow
from ground.jobs.value import JobState
from ground.records.actor import Action, Actor
from ground.records.get_resource import find_row
from ground.resources.runs.kind import RUN
from ground.resources.runs.row import RunRow
from ground.resources.runs.value import RunControl
from ground.resources.runs.work import CONTROL, LIVE, Wish

_lock = threading.Lock()


def control_run(
    repo: Repository,
    actor: Actor,
    run_id: str,
    *,
    paused: bool | None = None,
    pace: float | None = None,
    step: bool = False,
    abort: bool = False,
) -> RunControl:
    """Return what is now asked of the run; the worker takes it up within a tenth of a second.

    While it is paused, plan time stands still; a step goes to the executive's next record. An abort is the
    operator's: the executive ends the plan as it would on the rover, and the run keeps all it has.

    Raises
    ------
    StateError
        If the run does not go on.
    """
    with repo.database.read() as session:
        row: RunRow = find_row(session, RUN, run_id)
        actor.require(Action.PLAN, row.mission_id)
        state, job_id = row.state, row.job_id
        job = session.get(JobRow, job_id) if job_id is not None else None
        first = float(job.payload["pace"]) if job is not None else 0.0
    folder = repo.run_dir(run_id)
    if state != JobState.RUNNING.value or not (folder / LIVE).exists():
        raise StateError(f"run {run_id} is {state}; only a run that goes on can be paused or aborted")
    with _lock:
        path = folder / CONTROL
        wish = Wish.read(path.read_bytes()) if path.exists() else Wish(pace=first)
        if paused is not None:
            wish = replace(wish, paused=paused)
        if pace is not None:
            wish = replace(wish, pace=pace)
        if step:
            wish = replace(wish, paused=True, steps=wish.steps + 1)
        if abort:
            wish = replace(wish, paused=False, abort=True)
        fresh = path.with_suffix(".new")
        fresh.write_text(json.dumps(wish.as_dict()), encoding="utf-8")
        fresh.replace(path)
    return RunControl(run_id=run_id, **wish.as_dict())
