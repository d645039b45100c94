"""Pause, resume, step, speed up or abort a dry run that goes on."""

from __future__ import annotations

import json
import threading
from dataclasses import replace
from pathlib import Path

from executive.errors import WireError
from executive.runtime.control import ask_run
from ground.errors import StateError
from ground.gdr.repository import Repository
from ground.jobs.row import JobRow
from ground.jobs.value import JobState
from ground.records.actor import Action, Actor
from ground.records.get_resource import find_row, get_resource
from ground.resources.runs.bodies import FaultBody
from ground.resources.runs.kind import RUN
from ground.resources.runs.row import RunRow
from ground.resources.runs.value import Run, RunControl, RunKind
from ground.resources.runs.work import CONTROL, LIVE, Wish
from ground.uplink.live import stop_run

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
    stop: bool = False,
) -> RunControl:
    """Return what is now asked of the run; the worker takes it up within a tenth of a second.

    While it is paused, plan time stands still; a step goes to the executive's next record. An abort is the
    operator's: the executive ends the plan as it would on the rover, and the run keeps all it has. A live
    run is asked over its control socket: held, nothing starts and time goes on; its pace is the rover's.

    Raises
    ------
    StateError
        If the run does not go on, or is not live and is to be stopped.
    """
    with repo.database.read() as session:
        row: RunRow = find_row(session, RUN, run_id)
        actor.require(Action.PLAN, row.mission_id)
        state, job_id, live = row.state, row.job_id, row.kind == RunKind.LIVE.value
        job = session.get(JobRow, job_id) if job_id is not None else None
        first = float(job.payload["pace"]) if job is not None else 0.0
    folder = repo.run_dir(run_id)
    if state != JobState.RUNNING.value or not (folder / LIVE).exists():
        raise StateError(f"run {run_id} is {state}; only a run that goes on can be paused or aborted")
    if live:
        return _ask_live(
            run_id, folder, first or 1.0, paused=paused, pace=pace, step=step, abort=abort, stop=stop
        )
    if stop:
        raise StateError(f"run {run_id} is not live; abort it")
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


def _ask_live(
    run_id: str,
    folder: Path,
    rate: float,
    *,
    paused: bool | None,
    pace: float | None,
    step: bool,
    abort: bool,
    stop: bool,
) -> RunControl:
    if pace is not None:
        raise StateError(f"run {run_id} is live; its pace is that of its rover, {rate:g}")
    wanted = {"stop": stop, "abort": abort, "step": step, "hold": paused is True, "go": paused is False}
    try:
        for what in (name for name, asked in wanted.items() if asked):
            if what == "stop":
                stop_run(folder)
            else:
                ask_run(folder, {"m": what})
        state = {"held": False, "steps": 0, "stopped": True}
        if not (abort or stop):
            state = ask_run(folder, {"m": "state"})
    except WireError as err:
        raise StateError(str(err)) from err
    return RunControl(run_id, rate, bool(state["held"]), int(state["steps"]), bool(state["stopped"]))


def inject_fault(repo: Repository, actor: Actor, run_id: str, given: FaultBody) -> Run:
    """Let the rover of a live run suffer a fault, now or at its time or task; return the run.

    Raises
    ------
    StateError
        If the run does not go on or is not live, or the rover refuses the fault.
    """
    with repo.database.read() as session:
        row: RunRow = find_row(session, RUN, run_id)
        actor.require(Action.PLAN, row.mission_id)
        state, live = row.state, row.kind == RunKind.LIVE.value
    if state != JobState.RUNNING.value or not live:
        raise StateError(f"run {run_id} is {state}; only a live run that goes on takes faults")
    members = {"at_s": given.at_s, "task": given.task, "target": given.target_id, "amount": given.amount}
    fault = {"kind": given.kind, **{k: v for k, v in members.items() if v is not None}}
    try:
        ask_run(repo.run_dir(run_id), {"m": "inject", "fault": fault}, timeout_s=10.0)
    except WireError as err:
        raise StateError(str(err)) from err
    return get_resource(repo, actor, RUN, run_id)
