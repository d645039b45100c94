"""The endpoints that all kinds of resource have: list, make, read, change, delete."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping
from enum import Enum
from inspect import Parameter, Signature
from typing import Annotated, Any

from fastapi import APIRouter, Query
from starlette.responses import Response

from ground.api.context import (
    PREFIX,
    Ask,
    Asked,
    Count,
    Crs,
    Cursor,
    FilterId,
    Id,
    IfMatch,
    Limit,
    answer,
    api_router,
    created,
)
from ground.api.jobs_answer import JOB_ANSWERS, Prefer, accepted
from ground.api.problems import responses
from ground.jobs.value import Job
from ground.records.bulk import BulkDone, bulk_form, write_many
from ground.records.forms import ONE_LINE, Body, Page
from ground.records.kind import Kind
from ground.records.scalars import largest, narrowing, sortable

Endpoint = Callable[..., Awaitable[Response]]
UseCase = Callable[..., Any]
"""What a person's form comes to: of repository, actor, mission and form it makes the resource, or the job."""


def resource_routes(
    kind: Kind[Any],
    tag: str,
    *,
    lists: str = "",
    where: Mapping[str, object] | None = None,
    limit: int = 100,
    makes: tuple[UseCase, str] | None = None,
    starts: tuple[UseCase, str] | None = None,
    reads: str = "",
    changes: str = "",
    deletes: str = "",
) -> APIRouter:
    """Return a router with those endpoints of a kind of which it is said what they are for.

    Parameters
    ----------
    where
        Conditions of a list beside the members of the kind, with the type of the parameter; None does not
        count.
    limit
        How many a list has unless it is said.
    makes, starts
        The use case by which one is made, and what it is for; the latter returns the job that computes it.
    """
    router = api_router(tag)
    key, path = f"{kind.name}_id", f"/{kind.collection}/{{{kind.name}_id}}"
    mission: dict[str, Any] = {"mission_id": Id} if "mission_id" in kind.row.__table__.c else {}
    inside = f"/missions/{{mission_id}}/{kind.collection}" if mission else f"/{kind.collection}"
    known = (404,) if mission else ()

    async def page(
        ask: Ask,
        limit: int,
        cursor: str | None,
        sort: str | None,
        count: bool,
        mission_id: str = "",
        crs: str | None = None,
        **found: Any,
    ) -> Response:
        return await ask.page(
            kind.name, mission_id or None, limit, cursor, found, sort=sort, count=count, crs=crs
        )

    async def one(ask: Ask, crs: str | None = None, **place: str) -> Response:
        return await ask.one(kind.name, place[key], crs=crs)

    async def change(ask: Ask, body: Body, if_match: str | None, **place: str) -> Response:
        return await ask.change(kind.name, place[key], body, if_match)

    async def delete(ask: Ask, if_match: str | None, **place: str) -> Response:
        return await ask.delete(kind.name, place[key], if_match)

    def add(method: str, at: str, endpoint: Endpoint, statuses: tuple[int, ...], **options: Any) -> None:
        router.add_api_route(at, endpoint, methods=[method], responses=responses(*statuses), **options)

    seen = {"if_match": (IfMatch, None)}
    located: dict[str, object] = {} if kind.locate is None else {"crs": (Crs | None, None)}
    away = () if kind.locate is None else (503,)
    if lists:
        given = {**mission, "limit": (Limit, limit), "cursor": (Cursor, None)}
        given |= {"sort": (_sort(kind), None), "count": (Count, False)}
        given |= {name: (form, None) for name, form in {**_filters(kind), **(where or {})}.items()}
        given |= located
        told = described(f"list_{kind.collection.replace('-', '_')}", lists, given, page)
        add("GET", inside, told, (*known, 422, *away), response_model=Page.__class_getitem__(kind.value))
    if makes is not None:
        told = _making(kind, mission, *makes)
        add("POST", inside, told, (400, *known, 409, 422, *away), response_model=kind.value, status_code=201)
    if starts is not None:
        start_route(router, inside, f"create_{kind.name}", kind.make, *starts)
    if reads:
        told = described(f"get_{kind.name}", reads, {key: Id, **located}, one)
        add("GET", path, told, (404, 422, *away), response_model=kind.value)
    if changes:
        told = described(f"change_{kind.name}", changes, {key: Id, "body": kind.change, **seen}, change)
        add("PATCH", path, told, (400, 404, 409, 412, 422, 428, *away), response_model=kind.value)
    if deletes:
        told = described(f"delete_{kind.name}", deletes, {key: Id, **seen}, delete)
        add("DELETE", path, told, (404, 409, 412, 422, 428), status_code=204)
    if mission and makes is not None and changes and deletes:
        told = _writing_many(kind, makes[0])
        add("POST", f"{inside}/bulk", told, (400, 404, 409, 422, *away), response_model=BulkDone)
    return router


def _writing_many(kind: Kind[Any], use_case: UseCase) -> Endpoint:
    async def write(ask: Ask, mission_id: str, body: Body) -> Response:
        return answer(await ask.do(write_many, ask.kinds[kind.name], mission_id, use_case, body))

    about = f"Delete, change and make many {kind.title}s as one act: all of the rows, or none of them."
    given = {"mission_id": Id, "body": bulk_form(kind)}
    return described(f"bulk_{kind.collection.replace('-', '_')}", about, given, write)


def _sort(kind: Kind[Any]) -> object:
    """Return the type of the parameter by which a list is sorted."""
    names = ", ".join(f"`{name}`" for name in sortable(kind))
    about = f"{names}; with `-` in front the largest first, what has none last. Else as they were made"
    words = "|".join(sortable(kind))
    told = {"pattern": f"^-?({words})$"}
    return Annotated[str | None, Query(max_length=60, description=about, json_schema_extra=told)]


def _filters(kind: Kind[Any]) -> dict[str, object]:
    """Return the parameters by which a list is narrowed, each with its type."""
    found: dict[str, object] = {}
    for name, form in narrowing(kind).items():
        if issubclass(form, Enum) or form is bool:
            found[name] = form | None
        elif form is int:
            most = largest(sortable(kind)[name])
            found[name] = Annotated[int | None, Query(ge=-most - 1, le=most)]
        elif name.endswith("_id"):
            found[name] = FilterId
        else:
            found[name] = Annotated[str | None, Query(max_length=300, pattern=ONE_LINE)]
    return found


def _making(kind: Kind[Any], mission: Mapping[str, Any], use_case: UseCase, about: str) -> Endpoint:
    async def make(ask: Ask, body: Body, **place: str) -> Response:
        value = await ask.do(lambda repo, who: use_case(repo, who, *place.values(), body))
        return created(value, f"{PREFIX}/{kind.collection}/{value.id}")

    return described(f"create_{kind.name}", about, {**mission, "body": kind.make}, make)


def start_route(
    router: APIRouter, path: str, name: str, form: type[Body] | None, use_case: UseCase, about: str
) -> None:
    """Add the endpoint that starts long work on a mission: 202 with the job, or 200 if it was soon done."""

    async def start(ask: Ask, mission_id: str, body: Body, prefer: str | None) -> Response:
        job = await ask.do(lambda repo, who: use_case(repo, who, mission_id, body))
        return await accepted(ask.repo, ask.who, job, prefer)

    told = described(name, about, {"mission_id": Id, "body": form, "prefer": (Prefer, None)}, start)
    router.add_api_route(
        path, told, methods=["POST"], response_model=Job, status_code=202, responses=JOB_ANSWERS
    )


def described(name: str, about: str, given: Mapping[str, object], endpoint: Endpoint) -> Endpoint:
    """Return an endpoint with the name, the docstring and the parameters by which its route is described.

    `given` holds the type of each parameter beside `ask`, or that and its default.
    """

    async def told(**found: Any) -> Response:
        return await endpoint(**found)

    parameters = [Parameter("ask", Parameter.KEYWORD_ONLY, annotation=Asked)]
    for word, form in given.items():
        kind, default = form if isinstance(form, tuple) else (form, Parameter.empty)
        parameters.append(Parameter(word, Parameter.KEYWORD_ONLY, default=default, annotation=kind))
    told.__name__, told.__doc__ = name, about
    told.__signature__ = Signature(parameters)  # type: ignore[attr-defined] # what the framework reads
    return told
