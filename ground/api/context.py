"""What endpoints share: repository, actor, ETags, pages, and the hop to a thread."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, ParamSpec, TypeVar

import orjson
from fastapi import Depends, Header, Path, Query, Request
from starlette.concurrency import run_in_threadpool
from starlette.responses import Response

from ground.errors import InvalidInputError, PreconditionRequiredError
from ground.gdr.repository import Repository
from ground.services.actor import Actor

P = ParamSpec("P")
R = TypeVar("R")

Id = Annotated[str, Path(pattern=r"^[A-Za-z0-9_-]{1,40}$")]
Limit = Annotated[int, Query(ge=1, le=1000, description="how many at most")]
Cursor = Annotated[
    str | None,
    Query(max_length=200, pattern=r"^[A-Za-z0-9_-]+$", description="`next_cursor` of the page before"),
]
IfMatch = Annotated[str | None, Header(description="ETag of the revision that was seen, or `*`")]
FilterId = Annotated[str | None, Query(pattern=r"^[A-Za-z0-9_-]{1,40}$")]


async def repository(request: Request) -> Repository:
    """Return the repository of the application."""
    repo: Repository = request.app.state.repository
    return repo


async def actor(request: Request) -> Actor:
    """Return who makes the request, as the authentication middleware found."""
    who: Actor = request.state.actor
    return who


Repo = Annotated[Repository, Depends(repository)]
Who = Annotated[Actor, Depends(actor)]


async def call(function: Callable[P, R], *args: P.args, **kwargs: P.kwargs) -> R:
    """Run a service in a thread: the one hop of a request."""
    return await run_in_threadpool(function, *args, **kwargs)


def answer(value: Any, status: int = 200, *, headers: dict[str, str] | None = None) -> Response:
    """Return a value as JSON, with its ETag where it has a revision."""
    response = Response(orjson.dumps(value), status, media_type="application/json", headers=headers)
    revision = getattr(value, "revision", None)
    if revision is not None:
        response.headers["ETag"] = f'"{revision}"'
    return response


def created(value: Any, url: str) -> Response:
    """Return a new resource with its place."""
    return answer(value, 201, headers={"Location": url})


def no_content() -> Response:
    return Response(status_code=204)


def revision_wanted(if_match: str | None) -> int | None:
    """Return the revision in an If-Match header; None for `*`.

    Raises
    ------
    PreconditionRequiredError
        If there is no header.
    InvalidInputError
        If it is not one of our ETags.
    """
    if if_match is None:
        raise PreconditionRequiredError(
            "send the ETag that was read as If-Match, or * to change whatever stands there"
        )
    text = if_match.strip()
    if text == "*":
        return None
    if len(text) > 2 and text[0] == text[-1] == '"' and text[1:-1].isascii() and text[1:-1].isdigit():
        return int(text[1:-1][:18])
    raise InvalidInputError(
        f'If-Match has to be one strong ETag such as "3", not {text[:40]!r}', pointer="If-Match"
    )
