"""A run as server-sent events."""

from __future__ import annotations

from collections.abc import AsyncIterator

import anyio
from starlette.responses import StreamingResponse

from ground.api.context import call, look
from ground.api.streams import FINISHED, LOOK_S, Pulse, sse, stream
from ground.gdr.repository import Repository
from ground.records.actor import Actor
from ground.records.get_resource import get_resource
from ground.resources.runs.kind import RUN
from ground.resources.runs.read_run import live_lines


async def run_stream(
    repo: Repository, who: Actor, run_id: str, last_event_id: str | None
) -> StreamingResponse:
    """Stream a run line by line as it is written, then the finished run."""
    await look(get_resource, repo, who, RUN, run_id)

    async def events() -> AsyncIterator[bytes]:
        line = int(last_event_id or 0)
        pulse = Pulse(repo.settings.stream_seconds)
        while True:
            run = await look(get_resource, repo, who, RUN, run_id)
            parts = await call(live_lines, repo, run, line)
            for kind, data in parts:
                line += 1
                yield sse(kind, data, line)
            if run.state in FINISHED:
                yield sse("end", run, line)
                return
            if pulse.due():
                yield b": still here\n\n"
            await anyio.sleep(LOOK_S)

    return stream(events())
