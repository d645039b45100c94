"""How jobs are stored and shown."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime

from ground.jobs.row import JobRow
from ground.jobs.value import Job, JobState, LogLine
from ground.records.actor import Action
from ground.records.kind import Kind
from ground.records.show import value_of


def show_jobs(_session: object, rows: Sequence[JobRow]) -> list[Job]:
    return [
        value_of(
            Job,
            r,
            state=JobState(r.state),
            log=[LogLine(datetime.fromisoformat(line["at_utc"]), line["text"]) for line in r.log],
        )
        for r in rows
    ]


JOB = Kind("job", "job", "job", "jobs", JobRow, show_jobs, Action.PLAN, unseen=frozenset({"payload"}))
