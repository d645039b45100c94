"""Server-sent events: jobs, runs, changes of a mission."""

from __future__ import annotations

from collections.abc import AsyncGenerator, AsyncIterator, Sequence
from contextlib import aclosing
from typing import Annotated, Any

import orjson
from fastapi import Header
from starlette.responses import StreamingResponse

from ground.api import metrics
from ground.api.context import call, look
from ground.api.hub import Hub, Part, Probe, Read, lookers_topic
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


ALIVE = b": still here\n\n"


async def follow(
    hub: Hub,
    topic: str,
    seen: int,
    after: int,
    read: Read,
    *,
    shared: Read | None = None,
    probe: Probe | None = None,
    beside: tuple[str, int, Read] | None = None,
) -> AsyncGenerator[bytes, None]:
    """Yield what comes to a topic behind a number, and a sign of life where one is due, until its last part.

    What is missing up to where the others are is read for this listener alone, with `read`, some at a time;
    from there on all who follow the topic share one reader (`shared`, else `read`). What comes `beside`, on a
    second topic whose newest number and reader are given, is sent as it comes.
    """
    listener = hub.join(topic, seen, shared or read, probe)
    if beside is not None:
        hub.join_beside(*beside, listener)
    try:
        while after < listener.since and (missed := await call(read, after)):
            after = missed[-1].number
            yield _text(missed)
            if missed[-1].last:
                return
        after = max(after, listener.since)
        while (parts := await listener.next()) is not None:
            new = [part for part in parts if part.aside or part.number > after]
            if new:
                after = max([after, *(part.number for part in new if not part.aside)])
                yield _text(new)
                if new[-1].last:
                    return
            elif not parts:
                yield ALIVE
    finally:
        hub.leave(topic, listener)
        if beside is not None:
            hub.leave(beside[0], listener)


def _text(parts: Sequence[Part]) -> bytes:
    return parts[0].text if len(parts) == 1 else b"".join(part.text for part in parts)


async def job_stream(
    repo: Repository, hub: Hub, who: Actor, job_id: str, last_event_id: str | None
) -> StreamingResponse:
    """Stream a job until it is over; all who follow it share one reader."""
    job: Job = await look(get_resource, repo, who, JOB, job_id)

    def told(found: Job) -> Part:
        return Part(found.revision, sse("job", found, found.revision), found.state in FINISHED)

    def read(after: int) -> list[Part]:
        found: Job = get_resource(repo, SYSTEM_ACTOR, JOB, job_id)
        return [told(found)] if found.revision > after else []

    async def events() -> AsyncIterator[bytes]:
        sent = int(last_event_id or 0)
        now = told(job)
        if job.revision > sent or now.last:
            sent = job.revision
            yield now.text
        if now.last:
            return
        async with aclosing(follow(hub, job_id, job.revision, sent, read)) as parts:
            async for part in parts:
                yield part

    return stream(events())


async def mission_stream(
    repo: Repository, hub: Hub, who: Actor, mission_id: str, last_event_id: str | None
) -> StreamingResponse:
    """Stream the changes of a mission, from now on or from behind an event."""
    newest = await call(last_event, repo, who, mission_id)

    def read(after: int) -> list[Part]:
        found = list_history(repo, SYSTEM_ACTOR, mission_id, after=after, limit=PAGE, newest_first=False)
        return [Part(item.seq, sse("change", item, item.seq)) for item in found.items]

    lookers = hub.lookers

    def who_looks(after: int) -> list[Part]:
        number = lookers.number(mission_id)
        here = lookers.of(mission_id)
        return [Part(number, sse("presence", here), aside=True)] if number > after else []

    after = newest if last_event_id is None else int(last_event_id)
    beside = (lookers_topic(mission_id), lookers.number(mission_id), who_looks)

    async def parts() -> AsyncGenerator[bytes, None]:
        # Without data this is no event, but who loses the connection before the first one goes on from here.
        yield f"id: {after}\n\n".encode()
        async with aclosing(follow(hub, mission_id, newest, after, read, beside=beside)) as following:
            async for part in following:
                yield part

    return stream(parts())
