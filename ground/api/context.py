"""What endpoints share: repository, actor, ETags, pages, and the hop to a thread."""

from __future__ import annotations

import asyncio
import re
import shutil
import tempfile
from collections.abc import AsyncIterable, AsyncIterator, Awaitable, Callable, Coroutine, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextvars import ContextVar, copy_context
from dataclasses import dataclass
from functools import partial, wraps
from pathlib import Path as FilePath
from typing import Annotated, Any, Concatenate, ParamSpec, Protocol, TypeVar

import orjson
from fastapi import APIRouter, Depends, Header, Path, Query, Request
from fastapi.dependencies.models import Dependant
from fastapi.routing import APIRoute
from pydantic.fields import FieldInfo
from sqlalchemy import Connection, select
from starlette.background import BackgroundTask
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import Headers
from starlette.responses import FileResponse, Response, StreamingResponse

from ground.api.etags import etag_of, revision_wanted
from ground.api.hub import Hub
from ground.api.parts import part_answer
from ground.api.problems import Answers, responses
from ground.api.shared_reads import RowReads
from ground.errors import GroundError, InvalidInputError
from ground.gdr.database import in_act
from ground.gdr.files import FarFile
from ground.gdr.history import SYSTEM
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.change_resource import change_resource
from ground.records.delete_resource import delete_resource
from ground.records.forms import Body
from ground.records.get_resource import get_resource, in_making, shown_to
from ground.records.idempotency import Answer, Once, StoredAnswer
from ground.records.kind import Kind
from ground.records.list_resources import list_resources

P = ParamSpec("P")
R = TypeVar("R")
PREFIX = "/api/v1"

ID = r"^[A-Za-z0-9_-]{1,40}$"
Id = Annotated[str, Path(pattern=ID)]
Limit = Annotated[int, Query(ge=1, le=1000, description="how many at most")]
Cursor = Annotated[
    str | None,
    Query(max_length=2000, pattern=r"^[A-Za-z0-9_-]+$", description="`next_cursor` of the page before"),
]
Count = Annotated[bool, Query(description="say in `total` how many there are in all")]
Crs = Annotated[
    str,
    Query(min_length=3, max_length=200, description="site, lonlat, EPSG:..., IAU_2015:...; x before y"),
]
IfMatch = Annotated[str | None, Header(description="ETag of what was seen, or `*`; its revision counts")]
SiteNumber = Annotated[int | None, Query(ge=0, le=2**31 - 1, description="frames of this site alone")]
FilterId = Annotated[str | None, Query(pattern=ID)]


async def call(function: Callable[P, R], *args: P.args, **kwargs: P.kwargs) -> R:
    """Run a service in a thread, the one hop of a request; part of an act is in its thread already."""
    if in_act():
        return function(*args, **kwargs)
    return await run_in_threadpool(function, *args, **kwargs)


_READERS = ThreadPoolExecutor(4, "read")
"""Few on purpose: with a thread for each connection a read spends its time on handing the interpreter's lock
round (64 connections: 1.3 to 1.5 times the CPU of a request). Long work has other threads and delays none."""


async def look(function: Callable[P, R], *args: P.args, **kwargs: P.kwargs) -> R:
    """Run a service that only reads a few rows in one of a few threads."""
    if in_act():
        return function(*args, **kwargs)
    work = partial(copy_context().run, function, *args, **kwargs)
    return await asyncio.get_running_loop().run_in_executor(_READERS, work)


def answer(value: Any, status: int = 200, *, headers: dict[str, str] | None = None) -> Response:
    """Return a value as JSON, with its ETag where it has a revision."""
    body = orjson.dumps(value)
    response = Response(body, status, media_type="application/json", headers=headers)
    revision = getattr(value, "revision", None)
    if revision is not None:
        response.headers["ETag"] = etag_of(revision, body)
    return response


def created(value: Any, url: str) -> Response:
    """Return a new resource with its place."""
    return answer(value, 201, headers={"Location": url})


def no_content() -> Response:
    return Response(status_code=204)


@dataclass(frozen=True, slots=True)
class Ask:
    """One request: the repository it is made to, who makes it, and what all kinds of resource share."""

    repo: Repository
    who: Actor
    kinds: Mapping[str, Kind[Any]]
    again: Callable[[], Awaitable[Actor]]
    """Find anew who asks: for answers that go on after a role was changed or a session ended."""
    hub: Hub
    reads: RowReads

    async def do(
        self,
        service: Callable[Concatenate[Repository, Actor, P], R],
        *args: P.args,
        **kwargs: P.kwargs,
    ) -> R:
        """Run a service for who asks."""
        return await call(service, self.repo, self.who, *args, **kwargs)

    async def one(self, kind: str, identifier: str, *, crs: str | None = None) -> Response:
        """Answer with one resource and its ETag.

        A row of SQLite by its key is there in about 50 microseconds, half of what a hop to a thread costs,
        and no writer ever makes a reader wait (write-ahead log): it is read where the request is. Of
        PostgreSQL the rows that are asked for at the same time share a statement and a hop.
        """
        found = self.kinds[kind]
        if self.repo.database.is_sqlite:
            return answer(get_resource(self.repo, self.who, found, identifier, crs=crs))
        if found.related is None and crs is None and not in_act():
            row = await self.reads.row(found, identifier)
            return answer(shown_to(self.who, found, identifier, row))
        return answer(await look(get_resource, self.repo, self.who, self.kinds[kind], identifier, crs=crs))

    async def page(
        self,
        kind: str,
        mission_id: str | None,
        limit: int,
        cursor: str | None,
        where: Mapping[str, object] | None = None,
        *,
        sort: str | None = None,
        count: bool = False,
        crs: str | None = None,
    ) -> Response:
        """Answer with one page of a list; conditions that are None do not count."""
        return answer(
            await look(
                list_resources,
                self.repo,
                self.who,
                self.kinds[kind],
                mission_id,
                limit=limit,
                cursor=cursor,
                where=where,
                sort=sort,
                count=count,
                crs=crs,
            )
        )

    async def change(self, kind: str, identifier: str, body: Body, if_match: str | None) -> Response:
        """Set the members that the body names, if the resource is still the one that was seen."""
        return answer(
            await self.do(change_resource, self.kinds[kind], identifier, body, revision_wanted(if_match))
        )

    async def delete(self, kind: str, identifier: str, if_match: str | None) -> Response:
        """Delete a resource, if it is still the one that was seen."""
        await self.do(delete_resource, self.kinds[kind], identifier, revision_wanted(if_match))
        return no_content()


async def ask(request: Request) -> Ask:
    """Return what an endpoint works with; the gate has found who asks."""
    state = request.app.state
    again = partial(state.identities.actor_of, "GET", request.headers)
    return Ask(state.repository, request.state.actor, state.kinds, again, state.hub, state.reads)


async def repository(request: Request) -> Repository:
    """Return the repository of the application, for what needs nobody in particular."""
    repo: Repository = request.app.state.repository
    return repo


def operation_id(route: APIRoute) -> str:
    """Return the name of an operation in the OpenAPI document: that of its function."""
    return route.name


def replayed(stored: StoredAnswer) -> Response:
    """Return an answer that was kept, marked as a repeat."""
    return Response(stored.body, stored.status, headers={**stored.headers, "Idempotent-Replay": "true"})


class Queued(Response):
    """The answer to a request for long work; `later` gives the one after the wait that was preferred."""

    later: Callable[[], Awaitable[Response]]


ONCE: ContextVar[Once | None] = ContextVar("once", default=None)
"""The key of the request that is being answered, where it has one."""


ABSENT = "~"
"""Put before an id makes one that nothing has: ids are letters, digits, `_` and `-`."""
OTHER_NAMES = {"other_id": "plan", "request_id": "observation_request"}
"""Parameters that name a resource by another word than its kind."""


def _missions_of(reader: Connection, ask: Ask, given: Mapping[str, object]) -> dict[str, tuple[str, str]]:
    """Return the parameters that name what belongs to a mission, each with its value and the mission."""
    found = {}
    for name, value in given.items():
        kind = ask.kinds.get(OTHER_NAMES.get(name) or name.removesuffix("_id"))
        if kind is None or not isinstance(value, str) or not name.endswith("_id"):
            continue
        column = kind.row.__table__.c
        if kind.row.mission_key not in column:
            continue
        mission = reader.scalar(select(column[kind.row.mission_key]).where(column.id == value))
        if mission is not None:
            found[name] = (value, mission)
    return found


def _hidden(ask: Ask, given: Mapping[str, object], who: Actor) -> dict[str, str]:
    """Return the parameters that name what belongs to a mission that a person may not see.

    A copy that is not whole yet is there for nobody, nor is what belongs to it.
    """
    with ask.repo.database.connection() as reader:
        named = _missions_of(reader, ask, given)
        return {
            name: value
            for name, (value, mission) in named.items()
            if not who.sees(mission) or in_making(reader, mission)
        }


def _missions(ask: Ask, given: Mapping[str, object]) -> list[str]:
    """Return the missions that what is named belongs to."""
    with ask.repo.database.connection() as reader:
        return [mission for _, mission in _missions_of(reader, ask, given).values()]


async def _hidden_from(ask: Ask, given: Mapping[str, object]) -> dict[str, str]:
    """Return what `_hidden` does, at no cost to reads by key of those from whom no mission is hidden.

    What reads a row by its key looks itself whether that belongs to a copy that is not whole.
    """
    if ask.who.sees_all:
        given = {name: value for name, value in given.items() if name == "mission_id"}
        if not given:
            return {}
    if ask.repo.database.is_sqlite:  # as `Ask.one`: the hop would take longer than the row
        return _hidden(ask, given, ask.who)
    return await look(_hidden, ask, given, ask.who)


async def _as_if_absent(endpoint: Callable[..., Any], given: dict[str, Any]) -> Any:
    """Answer as if what the person may not see were not there: with ids that nothing has.

    So every route says the same as for a thing that never was, in the same order of checks.
    """
    ask = given.get("ask")
    if not isinstance(ask, Ask):
        return await endpoint(**given)
    hidden = await _hidden_from(ask, given)
    try:
        answer = await endpoint(**{**given, **{name: ABSENT + value for name, value in hidden.items()}})
    except GroundError as err:
        for value in hidden.values():
            err.message = err.message.replace(ABSENT + value, value)
        raise
    if isinstance(answer, StreamingResponse) and answer.media_type == "text/event-stream":
        answer.body_iterator = _while_seen(answer.body_iterator, ask, given)
    return answer


async def _while_seen(parts: AsyncIterable[Any], ask: Ask, given: Mapping[str, object]) -> AsyncIterator[Any]:
    """Give the parts of a stream until who listens may not see it any more, or is nobody any more.

    That is asked before each part. A thing stays in its mission, so only the person is asked for anew; those
    of all who listen are read together.
    """
    missions: list[str] | None = None
    async for part in parts:
        try:
            who = await ask.again()
        except GroundError:
            return
        if not who.sees_all:
            if missions is None:
                missions = await look(_missions, ask, given)
            if not all(who.sees(mission) for mission in missions):
                return
        if given.get("mission_id") == SYSTEM and not who.may(Action.ADMINISTER):
            return
        yield part


class Route(APIRoute):
    """A route whose endpoint runs in one thread and one transaction where the request carries a key."""

    def __init__(self, path: str, endpoint: Callable[..., Any], **options: Any) -> None:
        @wraps(endpoint)
        async def seen(**given: Any) -> Any:
            return await _as_if_absent(endpoint, given)

        @wraps(endpoint)
        async def once(**given: Any) -> Any:
            kept = ONCE.get()
            if kept is None:
                return await seen(**given)
            answer = await run_in_threadpool(kept.run, lambda: _at_once(seen(**given)))
            if isinstance(answer, StoredAnswer):
                return replayed(answer)
            return await answer.later() if isinstance(answer, Queued) else answer

        super().__init__(path, once, **options)

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """Return what answers a request; one with a parameter that nobody asked for is refused by its name.

        A mistyped filter would else give everything.
        """
        handle = super().get_route_handler()
        known = set(_query_of(self.dependant))
        defaults, endpoint = _defaults_of_read(self), self.endpoint

        async def careful(request: Request) -> Response:
            if not request.scope["query_string"]:
                place = request.path_params
                if defaults is not None and all(_is_id(value) for value in place.values()):
                    found: Response = await endpoint(ask=await ask(request), **place, **defaults)
                    return found
            else:
                strange = next((name for name in request.query_params if name not in known), None)
                if strange is not None:
                    there = f"there are {', '.join(sorted(known))}" if known else "it takes none"
                    raise InvalidInputError(f"no parameter {strange[:40]!r}; {there}", pointer=strange[:40])
            return await handle(request)

        return careful


_is_id = re.compile(ID, re.ASCII).fullmatch


def _defaults_of_read(route: APIRoute) -> dict[str, object] | None:
    """Return what a GET takes beside the ids in its path where nothing is asked for; None if it takes more.

    Such a request needs no more of the framework than that its ids are ids: the general way through its
    dependencies and parameters costs a third of a read by key.
    """
    takes = route.dependant
    more = (takes.header_params, takes.cookie_params, takes.body_params)
    if route.methods != {"GET"} or any(more) or [part.call for part in takes.dependencies] != [ask]:
        return None
    if takes.dependencies[0].name != "ask" or takes.request_param_name or takes.response_param_name:
        return None
    if any(_pattern_of(field.field_info) != ID for field in takes.path_params):
        return None
    if any(field.field_info.is_required() for field in takes.query_params):
        return None
    return {field.name: field.get_default() for field in takes.query_params}


def _pattern_of(field: FieldInfo) -> str | None:
    """Return the pattern of a parameter that has no other rule."""
    rules = field.metadata
    return getattr(rules[0], "pattern", None) if len(rules) == 1 and field.annotation is str else None


def _query_of(dependant: Dependant) -> Iterator[str]:
    """Yield the names of the parameters that an endpoint and what it depends on take behind the `?`."""
    yield from (parameter.alias for parameter in dependant.query_params)
    for part in dependant.dependencies:
        yield from _query_of(part)


def _at_once(endpoint: Coroutine[Any, Any, Answer]) -> Answer:
    """Return what an endpoint answers whose use cases run where they are called: it waits for nothing."""
    try:
        endpoint.send(None)
    except StopIteration as end:
        answer: Answer = end.value
        return answer
    endpoint.close()
    raise RuntimeError("an endpoint that waits cannot be one transaction")


def api_router(tag: str, route_class: type[Route] = Route) -> APIRouter:
    """Return the router of one kind of resource; its routes are whole, so that none is looked for twice."""
    return APIRouter(
        prefix=PREFIX,
        tags=[tag],
        responses=responses(401, 403),
        generate_unique_id_function=operation_id,
        route_class=route_class,
    )


Asked = Annotated[Ask, Depends(ask)]
Repo = Annotated[Repository, Depends(repository)]


SEALED = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; sandbox"


def media_answers(*media: str) -> Answers:
    return {
        200: {
            "content": {
                kind: {"schema": {"type": "object" if kind.endswith("json") else "string"}} for kind in media
            }
        }
    }


def attachment(name: str) -> dict[str, str]:
    return {"Content-Disposition": f'attachment; filename="{name}"'}


PRODUCT_FILE: Answers = {
    200: {"content": {"application/octet-stream": {}}},
    206: {"description": "A part, as asked for with Range"},
    416: {"description": "There is no such part"},
}


ZIP: Answers = {200: {"content": {"application/zip": {"schema": {"type": "string", "format": "binary"}}}}}


async def archive(name: str, write: Callable[[FilePath], Awaitable[None]]) -> FileResponse:
    """Answer with an archive that is written for this one answer, under a name."""
    folder = FilePath(tempfile.mkdtemp(prefix="outcrop-archive-"))
    try:
        await write(folder / name)
    except BaseException:
        shutil.rmtree(folder)
        raise
    tidy = BackgroundTask(shutil.rmtree, folder)
    return FileResponse(folder / name, media_type="application/zip", filename=name, background=tidy)


class StoredProduct(Protocol):
    """What is needed of a data product to send its file."""

    @property
    def sha256(self) -> str: ...

    @property
    def media(self) -> str: ...

    @property
    def file_name(self) -> str: ...


def product_file(asked: Headers, product: StoredProduct, file: FilePath | FarFile) -> Response:
    """Answer with the file of a data product, or the part asked for; its ETag is the SHA-256 of all of it."""
    headers = {"ETag": f'"{product.sha256}"', "Cache-Control": "private, max-age=31536000, immutable"}
    headers["Content-Security-Policy"] = "default-src 'none'; sandbox"
    if isinstance(file, FarFile):
        return part_answer(file, asked, headers, product.media)
    return FileResponse(
        file,
        media_type=product.media,
        filename=product.file_name.rsplit("/", 1)[-1],
        content_disposition_type="inline",
        headers=headers,
    )
