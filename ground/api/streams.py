"""Server-sent events: jobs, runs, changes of a mission."""

from __future__ import annotations

import time
from collections.abc import AsyncIterator
from typing import Annotated, Any

import anyio
import orjson
from fastapi import Header
from starlette.responses import StreamingResponse

from ground.api import metrics
from ground.api.context import call, look
from ground.api.problems import Answers
from ground.gdr.repository import Repository
from ground.jobs.kind import JOB
from ground.jobs.value import JobState
from ground.records.actor import Actor
from ground.records.get_resource import get_resource
from ground.records.list_history import last_event, list_history

LastEventId = Annotated[
    str | None, Header(max_length=40, pattern=r"^[0-9]{1,18}$", description="go on behind it")
]


EVENT_STREAM: Answers = {200: {"content": {"text/event-stream": {"schema": {"type": "string"}}}}}
LOOK_S = 0.2
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


async def job_stream(
    repo: Repository, who: Actor, job_id: str, last_event_id: str | None
) -> StreamingResponse:
    """Stream a job until it is over."""
    job = await look(get_resource, repo, who, JOB, job_id)

    async def events() -> AsyncIterator[bytes]:
        current, sent = job, int(last_event_id or 0)
        pulse = Pulse(repo.settings.stream_seconds)
        while True:
            over = current.state in FINISHED
            if current.revision > sent or (over and sent == int(last_event_id or 0)):
                sent = current.revision
                yield sse("job", current, sent)
            elif pulse.due():
                yield b": still here\n\n"
            if over:
                return
            await anyio.sleep(LOOK_S)
            current = await look(get_resource, repo, who, JOB, job_id)

    return stream(events())


async def mission_stream(
    repo: Repository, who: Actor, mission_id: str, last_event_id: str | None
) -> StreamingResponse:
    """Stream the changes of a mission, from now on or from behind an event."""
    newest = await call(last_event, repo, who, mission_id)

    async def events() -> AsyncIterator[bytes]:
        after = newest if last_event_id is None else int(last_event_id)
        pulse = Pulse(repo.settings.stream_seconds)
        while True:
            page = await call(list_history, repo, who, mission_id, after=after, limit=200, newest_first=False)
            for item in page.items:
                after = item.seq
                yield sse("change", item, item.seq)
            if page.next_cursor is None:
                if pulse.due():
                    yield b": still here\n\n"
                await anyio.sleep(LOOK_S)

    return stream(events())
