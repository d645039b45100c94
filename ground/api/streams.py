"""Server-sent events: jobs, runs, changes of a mission."""

from __future__ import annotations

import time
from collections.abc import AsyncGenerator, AsyncIterator
from contextlib import aclosing
from typing import Annotated, Any

import orjson
from fastapi import Header
from starlette.responses import StreamingResponse

from ground.api import metrics
from ground.api.context import call, look
from ground.api.hub import Hub, Listener, Part
from ground.api.problems import Answers
from ground.gdr.repository import Repository
from ground.jobs.kind import JOB
from ground.jobs.value import Job, JobState
from ground.records.actor import SYSTEM_ACTOR, Actor
from ground.records.get_resource import get_resource
from ground.records.list_history import last_event, list_history

LastEventId = Annotated[
    str | None, Header(max_length=40, pattern=r"^[0-9]{1,18}$", description="go on behind it")
]


EVENT_STREAM: Answers = {200: {"content": {"text/event-stream": {"schema": {"type": "string"}}}}}
LOOK_S = 0.2
PAGE = 200
FINISHED = {JobState.SUCCEEDED, JobState.FAILED, JobState.CANCELLED}


def sse(event: str, data: Any, event_id: int | None = None) -> bytes:
    """Return one event in the form of text/event-stream."""
    head = f"event: {event}\n" if event_id is None else f"id: {event_id}\nevent: {event}\n"
    return head.encode() + b"data: " + orjson.dumps(data) + b"\n\n"


def stream(source: AsyncIterator[bytes]) -> StreamingResponse:
    """Return the answer that sends `source` as events."""

    async def counted() -> AsyncIterator[bytes]:
        metrics.STREAMS.inc()
        try:
            yield b"retry: 1000\n\n"
            async for part in source:
                yield part
        finally:
            metrics.STREAMS.dec()

    headers = {"Cache-Control": "no-cache", "X-Accel-Buffering": "no"}
    return StreamingResponse(counted(), media_type="text/event-stream", headers=headers)


class Pulse:
    """Says when a silent stream needs a comment to stay open."""

    def __init__(self, every_s: float) -> None:
        self._every, self._last = every_s, time.monotonic()

    def due(self) -> bool:
        if time.monotonic() - self._last < self._every:
            return False
        self._last = time.monotonic()
        return True


async def _follow(hub: Hub, topic: str, listener: Listener, after: int) -> AsyncGenerator[Part | None, None]:
    """Yield what comes to a listener behind a number; None where a sign of life is due."""
    try:
        while True:
            parts = await listener.queue.get()
            if parts is None:
                return
            if not parts:
                yield None
            for number, part in parts:
                if number > after:
                    after = number
                    yield number, part
    finally:
        hub.leave(topic, listener)


ALIVE = b": still here\n\n"


async def job_stream(
    repo: Repository, hub: Hub, who: Actor, job_id: str, last_event_id: str | None
) -> StreamingResponse:
    """Stream a job until it is over; all who follow it share one reader."""
    job: Job = await look(get_resource, repo, who, JOB, job_id)

    def read(after: int) -> list[Part]:
        found: Job = get_resource(repo, who, JOB, job_id)
        return [(found.revision, sse("job", found, found.revision))] if found.revision > after else []

    async def events() -> AsyncIterator[bytes]:
        sent = int(last_event_id or 0)
        over = job.state in FINISHED
        if job.revision > sent or over:
            sent = job.revision
            yield sse("job", job, job.revision)
        if over:
            return
        listener = hub.join(job_id, job.revision, read)
        follow = _follow(hub, job_id, listener, sent)
        async with aclosing(follow):
            async for part in follow:
                yield ALIVE if part is None else part[1]
                if part is not None and _over(part[1]):
                    return

    return stream(events())


def _over(part: bytes) -> bool:
    """Return whether an event shows a job that is over."""
    shown = orjson.loads(part.partition(b"data: ")[2])
    return shown["state"] in FINISHED


async def mission_stream(
    repo: Repository, hub: Hub, who: Actor, mission_id: str, last_event_id: str | None
) -> StreamingResponse:
    """Stream the changes of a mission, from now on or from behind an event."""
    newest = await call(last_event, repo, who, mission_id)

    def read(after: int) -> list[Part]:
        found = list_history(repo, SYSTEM_ACTOR, mission_id, after=after, limit=PAGE, newest_first=False)
        return [(item.seq, sse("change", item, item.seq)) for item in found.items]

    async def events() -> AsyncIterator[bytes]:
        after = newest if last_event_id is None else int(last_event_id)
        listener = hub.join(mission_id, newest, read)
        try:
            while after < listener.since and (missed := await call(read, after)):
                for _, part in missed:
                    yield part
                after = missed[-1][0]
            follow = _follow(hub, mission_id, listener, max(after, listener.since))
            async with aclosing(follow):
                async for found in follow:
                    yield ALIVE if found is None else found[1]
        finally:  # also of who leaves while what was missed is sent
            hub.leave(mission_id, listener)

    return stream(events())
