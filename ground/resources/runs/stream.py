"""A run as server-sent events."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import aclosing

from starlette.responses import StreamingResponse

from ground.api.context import call, look
from ground.api.hub import Hub, Part
from ground.api.streams import FINISHED, follow, sse, stream
from ground.gdr.repository import Repository
from ground.records.actor import SYSTEM_ACTOR, Actor
from ground.records.get_resource import get_resource
from ground.resources.runs.kind import RUN
from ground.resources.runs.read_run import LiveLines
from ground.resources.runs.value import Run


class _Reader:
    """Reads a run on: its lines, and the run itself when it is over, as the part behind the last line."""

    def __init__(self, repo: Repository, run: Run) -> None:
        self._repo, self._run_id = repo, run.id
        self.lines = LiveLines(repo, run)

    def read(self, after: int) -> list[Part]:
        """Return some parts behind a number; whether it is over is asked first, so no line is missed."""
        run = get_resource(self._repo, SYSTEM_ACTOR, RUN, self._run_id)
        found = self.lines.behind(after)
        if found or run.state not in FINISHED:
            return [Part(number, sse(kind, data, number)) for number, kind, data in found]
        count = self.lines.to_the_end()
        return [Part(max(after, count) + 1, sse("end", run, count), last=True)]


async def run_stream(
    repo: Repository, hub: Hub, who: Actor, run_id: str, last_event_id: str | None
) -> StreamingResponse:
    """Stream a run line by line as it is written, then the finished run; all who follow share one reader."""
    run = await look(get_resource, repo, who, RUN, run_id)
    own = _Reader(repo, run)

    async def events() -> AsyncIterator[bytes]:
        after = int(last_event_id or 0)
        if run.state in FINISHED:
            while not (parts := await call(own.read, after))[-1].last:
                after = parts[-1].number
                yield b"".join(part.text for part in parts)
            yield parts[-1].text
            return
        shared = _Reader(repo, run)
        seen = hub.seen(run_id)
        if seen is None:
            seen = await call(shared.lines.to_the_end)
        going = follow(hub, run_id, seen, after, own.read, shared=shared.read, probe=shared.lines.grown)
        async with aclosing(going) as parts_of_all:
            async for part in parts_of_all:
                yield part

    return stream(events())
