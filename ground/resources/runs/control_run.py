"""Pause, resume, step, speed up, abort or stop a run that goes on, and let a live one suffer a fault."""

from __future__ import annotations

import json
import logging
import threading
from contextlib import suppress
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from executive.errors import WireError
from executive.runtime.control import ask_run
from executive.runtime.wire.messages import mapping, whole
from ground.errors import StateError
from ground.gdr.base import utc_now
from ground.gdr.repository import Repository
from ground.jobs.row import JobRow
from ground.jobs.value import JobState
from ground.records.actor import Action, Actor
from ground.records.edit import update
from ground.records.get_resource import find_row, get_resource
from ground.resources.runs.bodies import FaultBody
from ground.resources.runs.kind import RUN
from ground.resources.runs.row import RunRow
from ground.resources.runs.value import Run, RunControl, RunKind
from ground.resources.runs.work import CONTROL, LIVE, Wish
from ground.uplink.live import stop_run

logger = logging.getLogger(__name__)
NOTES_MOST = 20_000
"""Characters of a run's notes, as forms allow; the oldest go."""
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
    run is asked over its control socket: held, nothing starts and time goes on; its pace is the rover's. A
    stop, and nothing else, is open to all who may stop; who stopped or aborted it, and when, is noted.

    Raises
    ------
    StateError
        If the run does not go on, or is not live and is to be stopped.
    """
    with repo.database.read() as session:
        row: RunRow = find_row(session, RUN, run_id)
        only_stops = stop and paused is None and pace is None and not (step or abort)
        actor.require(Action.STOP if only_stops else Action.PLAN, row.mission_id)
        state, job_id, live = row.state, row.job_id, row.kind == RunKind.LIVE.value
        job = session.get(JobRow, job_id) if job_id is not None else None
        first = float(job.payload["pace"]) if job is not None else 0.0
        state = state if job is None else job.state  # a run says that it goes on half a second later
    folder = repo.run_dir(run_id)
    if state != JobState.RUNNING.value or not (folder / LIVE).exists():
        raise StateError(f"run {run_id} is {state}; only a run that goes on can be paused or aborted")
    if live:
        now = _ask_live(
            run_id,
            folder,
            first or 1.0,
            by=actor.name,
            paused=paused,
            pace=pace,
            step=step,
            abort=abort,
            stop=stop,
        )
        if abort or stop:
            _note_end(repo, actor, run_id, "stop" if stop else "abort")
        return now
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
        fresh.write_text(json.dumps(asdict(wish)), encoding="utf-8")
        fresh.replace(path)
    return RunControl(run_id=run_id, **asdict(wish))


def _ask_live(
    run_id: str,
    folder: Path,
    rate: float,
    *,
    by: str,
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
                stop_run(folder, by=by)
            else:
                ask_run(folder, {"m": what, "by": by})
        if abort or stop:
            return RunControl(run_id, rate, False, 0, True)
        state = ask_run(folder, {"m": "state"})
        return RunControl(run_id, rate, bool(state["held"]), whole(state, "steps"), bool(state["stopped"]))
    except WireError as err:
        raise StateError(str(err)) from err


def inject_fault(repo: Repository, actor: Actor, run_id: str, given: FaultBody) -> Run:
    """Let the rover of a live run suffer a fault, now or at its time or task; return the run, which keeps it.

    A fault that comes now is kept with the time of the plan that it came at.

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
    folder = repo.run_dir(run_id)
    members = {"at_s": given.at_s, "task": given.task, "target": given.target_id, "amount": given.amount}
    fault = {"kind": given.kind, **{k: v for k, v in members.items() if v is not None}}
    try:
        ask_run(folder, {"m": "inject", "fault": fault, "by": actor.name}, timeout_s=10.0)
    except WireError as err:
        raise StateError(str(err)) from err
    kept = given.value()
    if kept.at_s is None and kept.task is None:
        kept = replace(kept, at_s=_plan_time(folder))
    when = f"when {kept.task} starts" if kept.task is not None else f"at {kept.at_s or 0.0:.0f} s"
    line = f"fault {kept.kind} {when}, injected by {actor.name}"
    _keep(repo, actor, run_id, "inject", line, [asdict(kept)])
    return get_resource(repo, actor, RUN, run_id)


def _plan_time(folder: Path) -> float:
    """Return how far the plan of a live run is, seconds; 0 for one that has just ended."""
    with suppress(WireError):
        t_s = mapping(ask_run(folder, {"m": "state"}), "link").get("t_s")
        return t_s if isinstance(t_s, float) else 0.0
    return 0.0


def _note_end(repo: Repository, actor: Actor, run_id: str, action: str) -> None:
    """Keep with the run who stopped or aborted it; what is done is done, also where that cannot be kept."""
    try:
        _keep(repo, actor, run_id, action, f"{'STOP' if action == 'stop' else 'aborted'} by {actor.name}", [])
    except Exception:
        logger.exception("who ended a live run is not kept with it", extra={"run_id": run_id})


def _keep(
    repo: Repository, actor: Actor, run_id: str, action: str, line: str, faults: list[dict[str, Any]]
) -> None:
    """Add a line with the time of the clock to a run's notes, and faults to those it has."""
    with repo.database.write() as session:
        row: RunRow = find_row(session, RUN, run_id, lock=True)
        told = f"{utc_now():%Y-%m-%d %H:%M:%S} UTC: {line}"
        notes = "\n".join(part for part in (row.notes, told) if part)[-NOTES_MOST:]
        update(session, actor, RUN, row, {"notes": notes, "faults": [*row.faults, *faults]}, action=action)
