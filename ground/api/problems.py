"""Problem documents (RFC 9457): one place where errors become answers."""

from __future__ import annotations

import errno
import logging
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, cast

import orjson
from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from pydantic import BaseModel, Field
from sqlalchemy.exc import DBAPIError
from starlette.exceptions import HTTPException
from starlette.responses import Response

from ground import errors
from ground.api.etags import etag_of
from ground.api.openapi_form import Answer, Media, OpenApi, Schema
from ground.extras import missing_extra
from ground.logs import REQUEST_ID
from ground.records.forms import MEMBER_FAULT

logger = logging.getLogger(__name__)

MEDIA = "application/problem+json"
BASE = "urn:outcrop:problem:"
Answers = dict[int | str, dict[str, object]]
"""Answers of an operation by their status, as the framework takes them."""

STATUS: dict[type[errors.GroundError], tuple[int, str, str]] = {
    errors.NotFoundError: (404, "not-found", "There is no such thing"),
    errors.InvalidInputError: (422, "invalid-input", "The request cannot be used"),
    errors.UnusableQueryError: (400, "unusable-query", "The parameters cannot be used"),
    errors.OutsideTerrainError: (422, "outside-terrain", "The point is off the terrain"),
    errors.UnobservedGroundError: (422, "unobserved-ground", "The ground there was never observed"),
    errors.UnreachableError: (422, "target-unreachable", "No observation point reaches the target"),
    errors.TerrainFileError: (422, "terrain-unusable", "The terrain cannot be read"),
    errors.ArchiveError: (422, "archive-unusable", "The archive cannot be used"),
    errors.ConflictError: (409, "conflict", "The request does not fit the present state"),
    errors.StateError: (409, "wrong-state", "The state does not allow this step"),
    errors.NameTakenError: (409, "name-taken", "The name is in use"),
    errors.AlreadyExecutedError: (409, "already-executed", "It was taken in before"),
    errors.StaleRevisionError: (412, "stale-revision", "Somebody else changed it in between"),
    errors.PreconditionRequiredError: (428, "precondition-required", "If-Match is needed"),
    errors.IdempotencyError: (422, "idempotency-key-reused", "The key was used for another request"),
    errors.NarrowedKeyError: (403, "narrowed-key", "A narrowed API key may not do that"),
    errors.ForbiddenError: (403, "forbidden", "This role may not do that"),
    errors.AuthenticationError: (401, "not-authenticated", "Say who you are"),
    errors.TooManyAttemptsError: (429, "too-many-attempts", "Too many attempts"),
    errors.TooLargeError: (413, "too-large", "The body is too large"),
    errors.UnavailableError: (503, "unavailable", "A part that is needed is not there"),
    errors.BusyError: (503, "unavailable", "A part that is needed is not there"),
    errors.OtherProgramError: (503, "unavailable", "A part that is needed is not there"),
    errors.StoreAwayError: (503, "unavailable", "A part that is needed is not there"),
    errors.DamagedDataError: (503, "data-damaged", "What is stored is damaged"),
    errors.DamagedFileError: (503, "data-damaged", "What is stored is damaged"),
    errors.JobFailedError: (422, "job-failed", "The work ended without a result"),
}
"""Status, stable type and title of each error class."""

_BY_STATUS = {
    400: ("malformed-request", "The request cannot be read"),
    404: ("not-found", "There is no such thing"),
    405: ("method-not-allowed", "The resource does not take this method"),
    413: ("too-large", "The body is too large"),
    415: ("unsupported-media-type", "The body has another media type"),
    500: ("internal-error", "Something broke here"),
}


class ProblemError(BaseModel):
    """One member that is wrong."""

    detail: str
    pointer: str | None = Field(description="JSON pointer into the body, or the name of the parameter")


class ProblemDocument(BaseModel):
    """Why a request was not done (RFC 9457)."""

    type: str = Field(description="Stable name of the kind of problem")
    title: str
    status: int
    detail: str
    instance: str = ""
    request_id: str = Field(default="", description="That of X-Request-Id; the server's log names it")
    errors: list[ProblemError] = []
    current: dict[str, Any] | None = Field(default=None, description="The present resource, with status 412")


def problem(
    status: int,
    kind: str,
    title: str,
    detail: str,
    *,
    instance: str = "",
    wrong: Sequence[Mapping[str, object]] = (),
    headers: dict[str, str] | None = None,
    **extra: Any,
) -> Response:
    """Return a problem document."""
    content = {
        "type": BASE + kind,
        "title": title,
        "status": status,
        "detail": detail,
        "instance": instance,
        "request_id": REQUEST_ID.get(),
        "errors": wrong,
        **extra,
    }
    return Response(orjson.dumps(content, default=str), status, media_type=MEDIA, headers=headers)


def refusal(error: errors.GroundError, path: str) -> Response:
    """Return the answer to a request that is refused."""
    status, kind, title = next(STATUS[c] for c in type(error).__mro__ if c in STATUS)
    wrong = [{"detail": error.message, "pointer": error.pointer}] if error.pointer else []
    headers, extra = {}, {"wrong": wrong, **error.extra}
    if status == 401:
        headers["WWW-Authenticate"] = "Bearer"
    if status == 429:
        headers["Retry-After"] = str(extra.pop("retry_after_s", 60))
    current = extra.get("current")
    if status == 412 and current is not None:
        headers["ETag"] = etag_of(current.revision, orjson.dumps(current))
    return problem(status, kind, title, error.message, instance=path, headers=headers, **extra)


def _from_ground(request: Request, error: Exception) -> Response:
    assert isinstance(error, errors.GroundError)
    return refusal(error, request.url.path)


def _from_validation(request: Request, error: Exception) -> Response:
    assert isinstance(error, RequestValidationError)
    wrong: list[dict[str, str | None]] = []
    malformed = False
    for item in error.errors():
        where = list(item["loc"])
        if item["type"] == MEMBER_FAULT:
            where.append(item["ctx"]["member"])
        malformed |= item["type"] == "json_invalid"
        if where and where[0] == "body":
            pointer = "".join(f"/{part}" for part in where[1:]) if item["type"] != "json_invalid" else None
        else:
            pointer = str(where[-1]) if where else None
        message = str(item["msg"]).removeprefix("Value error, ")
        wrong.append({"detail": message, "pointer": pointer})
    first = wrong[0] if wrong else {"detail": "", "pointer": None}
    detail = f"{first['pointer']}: {first['detail']}" if first["pointer"] else str(first["detail"])
    if malformed:
        text = str(error.errors()[0].get("ctx", {}).get("error", ""))
        return problem(
            400,
            "malformed-json",
            "The body is not JSON",
            f"the body is not JSON: {text}",
            instance=request.url.path,
            wrong=wrong,
        )
    return problem(
        422, "invalid-input", "The request cannot be used", detail, instance=request.url.path, wrong=wrong
    )


def _from_http(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    kind, title = _BY_STATUS.get(error.status_code, ("http-error", "The request was not done"))
    headers = dict(error.headers or {})
    return problem(
        error.status_code, kind, title, str(error.detail), instance=request.url.path, headers=headers
    )


def from_anything(path: str, error: Exception) -> Response:
    """Return the answer to a request that broke something here; only the log holds what it was."""
    if isinstance(error, ModuleNotFoundError) and (told := missing_extra(error)):
        return problem(503, "unavailable", "A part that is needed is not there", told, instance=path)
    logger.error("request failed", exc_info=error, extra={"path": path})
    if any(_is_full(cause) for cause in _causes(error)):
        return problem(
            507,
            "storage-full",
            "There is no room left",
            "the disk of the server is full; nothing of this request was kept",
            instance=path,
        )
    if any(isinstance(cause, DBAPIError) and cause.connection_invalidated for cause in _causes(error)):
        return problem(
            503,
            "unavailable",
            "A part that is needed is not there",
            "the database closed the connection, and whether this was kept is not known; with its "
            "Idempotency-Key a request can be sent again",
            instance=path,
            headers={"Retry-After": "1"},
        )
    return problem(
        500, "internal-error", "Something broke here", "the server's log has the details", instance=path
    )


def _causes(error: BaseException | None) -> Iterator[BaseException]:
    """Yield an error and what it came from, the driver's own below that of the database layer too."""
    while error is not None:
        yield error
        original = getattr(error, "orig", None)
        error = original if isinstance(original, BaseException) else error.__cause__ or error.__context__


def _is_full(error: BaseException) -> bool:
    """Return whether an error of the system, of SQLite or of PostgreSQL says that there is no room."""
    if isinstance(error, OSError):
        return error.errno in {errno.ENOSPC, errno.EDQUOT}
    return (
        getattr(error, "sqlite_errorname", "") == "SQLITE_FULL" or getattr(error, "sqlstate", "") == "53100"
    )


def install(app: FastAPI) -> None:
    """Make every error of the application a problem document."""
    app.add_exception_handler(errors.GroundError, _from_ground)
    app.add_exception_handler(RequestValidationError, _from_validation)
    app.add_exception_handler(HTTPException, _from_http)


_TITLES = {
    400: "Malformed request",
    401: "Not authenticated",
    403: "Forbidden",
    404: "Not found",
    409: "Conflict",
    412: "Stale revision",
    413: "Too large",
    415: "Unsupported media type",
    422: "Unusable request",
    428: "If-Match missing",
    429: "Too many attempts",
    503: "Unavailable",
}


def responses(*statuses: int) -> Answers:
    """Return the documentation of problem answers, for a router's `responses`."""
    return {status: dict(_answer(status)) for status in statuses}


def _answer(status: int) -> Answer:
    content: dict[str, Media] = {MEDIA: {"schema": {"$ref": "#/components/schemas/ProblemDocument"}}}
    return {"description": _TITLES[status], "content": content}


def state_once(document: OpenApi) -> None:
    """Put the problem answers of an OpenAPI document under its components; the operations refer to them.

    Whatever takes a body refuses one that is too large (`ground.app.gate`), so that is stated here for all.
    """
    components = document.setdefault("components", {})
    schemas = components.setdefault("schemas", {})
    made = ProblemDocument.model_json_schema(ref_template="#/components/schemas/{model}")
    schemas.update(made.pop("$defs", {}))
    schemas["ProblemDocument"] = cast("Schema", made)
    for name in ("HTTPValidationError", "ValidationError"):
        schemas.pop(name, None)
    stated = components.setdefault("responses", {})
    for path in document["paths"].values():
        for operation in path.values():
            answers = operation["responses"]
            if "requestBody" in operation:
                answers.setdefault("413", _answer(413))
            if "application/json" in answers.get("422", {}).get("content", {}):  # the framework's own form
                answers["422"] = _answer(422)
            for status, answer in answers.items():
                if MEDIA in answer.get("content", {}):
                    name = answer["description"].replace(" ", "-")
                    stated[name] = answer
                    answers[status] = {"$ref": f"#/components/responses/{name}"}
