"""The answer to a request for long work: 202 and the job, or 200 when it was done in the time preferred."""

from __future__ import annotations

import re
from functools import partial
from typing import Annotated

import anyio
import orjson
from fastapi import Header
from starlette.responses import Response

from ground.api.context import Queued, answer, look
from ground.api.etags import etag_of
from ground.api.problems import Answers, responses
from ground.errors import InvalidInputError
from ground.gdr.database import in_act
from ground.gdr.repository import Repository
from ground.jobs.kind import JOB
from ground.jobs.value import Job, JobState
from ground.records.actor import Actor
from ground.records.get_resource import get_resource

Prefer = Annotated[
    str | None, Header(max_length=100, description="`wait=N`: answer 200 if done in N seconds")
]
JOB_ANSWERS: Answers = {
    200: {"model": Job, "description": "Done in the time given by Prefer"},
    **responses(400, 404, 409, 422),
}
MAX_WAIT_S = 60.0
FINISHED = {JobState.SUCCEEDED, JobState.FAILED, JobState.CANCELLED}


def wait_wanted(prefer: str | None) -> float:
    """Return the seconds in `Prefer: wait=N`, at most 60; 0 without one.

    Raises
    ------
    InvalidInputError
        If N is not a number.
    """
    if prefer is None:
        return 0.0
    for part in prefer.split(","):
        name, _, value = part.strip().partition("=")
        if name.strip().lower() == "wait":
            if not re.fullmatch(r"\s*[0-9]{1,6}\s*", value, re.ASCII):
                raise InvalidInputError(
                    f"Prefer: wait={value[:20]}: whole seconds are needed", pointer="Prefer"
                )
            return min(float(value), MAX_WAIT_S)
    return 0.0


async def accepted(repo: Repository, who: Actor, job: Job, prefer: str | None) -> Response:
    """Return the job with its place, after waiting for it if that was preferred."""
    wait = wait_wanted(prefer)
    headers = {"Location": f"/api/v1/jobs/{job.id}"}
    if in_act():  # nobody sees the job before the answer is kept
        body = orjson.dumps(job)
        queued = Queued(body, 202, headers, "application/json")
        queued.headers["ETag"] = etag_of(job.revision, body)
        queued.later = partial(accepted, repo, who, job, prefer)
        return queued
    with anyio.move_on_after(wait):
        while wait and job.state not in FINISHED:
            await anyio.sleep(0.05)
            job = await look(get_resource, repo, who, JOB, job.id)
    done = job.state in FINISHED and wait > 0
    if wait:
        headers["Preference-Applied"] = f"wait={wait:.0f}"
    return answer(job, 200 if done else 202, headers=headers)
