"""How jobs are stored and shown."""

from __future__ import annotations

from ground.jobs.row import JobRow
from ground.jobs.value import Job
from ground.records.actor import Action
from ground.records.kind import Kind

JOB = Kind("job", "job", "jobs", JobRow, Job, Action.PLAN, unseen=frozenset({"payload"}))
