"""What the framework leaves out of the OpenAPI document: headers, ways to say who one is, examples."""

from __future__ import annotations

from ground.api.etags import etag_of
from ground.api.openapi_form import Answer, OpenApi, Operation, Schema
from ground.api.problems import BASE, MEDIA, STATUS
from ground.api.request_id import HEADER
from ground.app.examples import Examples
from ground.app.gate import API, OPEN, REPEATABLE
from ground.resources.people.authentication import COOKIE, CSRF_HEADER, PROFILE_HEADER, SAFE

SCHEMES = {
    "key": {"type": "http", "scheme": "bearer", "description": "An API key"},
    "session": {
        "type": "apiKey",
        "in": "cookie",
        "name": COOKIE,
        "description": "Set by `POST /api/v1/session`; a change needs the token of the session too",
    },
    "token": {
        "type": "apiKey",
        "in": "header",
        "name": CSRF_HEADER,
        "description": "`csrf_token` of the session",
    },
    "profile": {
        "type": "apiKey",
        "in": "header",
        "name": PROFILE_HEADER,
        "description": "Name of a local profile, where the server uses profiles",
    },
}
_TEXT = {"type": "string"}
_ETAG: Schema = {"type": "string", "pattern": '^(W/)?"[^"]+"$', "examples": [etag_of(3, b"")]}
_ID: Schema = {"type": "string", "pattern": "^[A-Za-z0-9._-]{8,64}$", "examples": ["0a1b2c3d4e5f6071"]}
HEADERS = {
    HEADER: {
        "description": "Id of the request: what was sent, or a new one; problem and log name it",
        "required": True,
        "schema": _ID,
    },
    "ETag": {
        "description": "For If-None-Match; that of a resource for If-Match too",
        "required": True,
        "schema": _ETAG,
    },
    "Location": {
        "description": "Where the new resource or job is",
        "required": True,
        "schema": {"type": "string", "pattern": f"^{API}"},
    },
    "Idempotent-Replay": {
        "description": "`true` where the answer was given before to this Idempotency-Key",
        "schema": {"type": "string", "enum": ["true"]},
    },
    "Preference-Applied": {"description": "The wait of Prefer that was kept", "schema": _TEXT},
    "Retry-After": {
        "description": "Seconds after which to try again",
        "schema": {"type": "integer", "minimum": 1},
    },
    "WWW-Authenticate": {"description": "How to say who one is", "required": True, "schema": _TEXT},
    "Content-Range": {"description": "Which bytes of how many these are", "schema": _TEXT},
    "Content-Disposition": {"description": "The name of the file", "schema": _TEXT},
    "Set-Cookie": {"description": f"`{COOKIE}`: the secret of the session", "schema": _TEXT},
}
PARAMETERS: dict[str, dict[str, object]] = {
    "If-None-Match": {
        "description": "ETags of what the client has, or `*`: 304 if what it would get is among them",
        "schema": {"type": "string", "maxLength": 1000},
        "example": etag_of(3, b""),
    },
    "Idempotency-Key": {
        "description": "What is sent again with the same key within 24 hours is done once",
        "schema": {"type": "string", "pattern": "^[ -~]{1,255}$"},
        "example": "d0e7c1f6-uplink-sol-12",
    },
    HEADER: {
        "description": "A name for the request that its answer repeats; one of another form is passed over",
        "schema": {"type": "string", "maxLength": 200},
        "example": _ID["examples"][0],
    },
    "Range": {
        "description": "The part of the file that is wanted",
        "schema": {"type": "string", "maxLength": 200},
        "example": "bytes=0-1023",
    },
}
"""Headers that requests of many operations take."""

SENT = {"if-match": etag_of(3, b""), "prefer": "wait=30", "last-event-id": "7"}
"""Examples of headers that single operations take."""
NOWHERE = {
    "create_api_key",
    "create_session",
    "create_signing_key",
    "create_waiver",
    "import_frames",
    "import_geometry",
}
"""Operations that make what has no place of its own, or many things."""
OF_PROBLEM = {401: ["WWW-Authenticate"], 412: ["ETag"], 429: ["Retry-After"], 503: ["Retry-After"]}
NOT_MODIFIED = "Not-modified"


def describe(document: OpenApi) -> None:
    """Add them to a document whose problem answers are stated."""
    components = document["components"]
    components["securitySchemes"] = SCHEMES
    components["headers"] = HEADERS
    components["parameters"] = {
        name: {"name": name, "in": "header", **told} for name, told in PARAMETERS.items()
    }
    examples = Examples(components["schemas"])
    statuses = _statuses(document)
    for name, stated in components["responses"].items():
        stated["headers"] = _headers([HEADER, *OF_PROBLEM.get(statuses[name], [])])
        stated["content"][MEDIA]["example"] = _problem(statuses[name])
    components["responses"][NOT_MODIFIED] = {
        "description": "What the client has, as If-None-Match says, is what it would get",
        "headers": _headers([HEADER, "ETag"]),
    }
    for path, ways in document["paths"].items():
        for method, operation in ways.items():
            _describe(path, method, operation, examples)
    components["examples"] = examples.stated


def _statuses(document: OpenApi) -> dict[str, int]:
    """Return the status with which each stated answer is given."""
    return {
        answer["$ref"].rpartition("/")[2]: int(status)
        for ways in document["paths"].values()
        for operation in ways.values()
        for status, answer in operation["responses"].items()
        if "$ref" in answer
    }


def _problem(status: int) -> dict[str, object]:
    """Return the problem document of a status."""
    known = ((kind, title) for of, kind, title in STATUS.values() if of == status)
    kind, title = next(known, ("malformed-request", "The request cannot be read"))
    return {"type": f"{BASE}{kind}", "title": title, "status": status, "detail": title}


def _describe(path: str, method: str, operation: Operation, examples: Examples) -> None:
    if path in OPEN or not path.startswith(API):
        operation["security"] = [{}]
    else:
        names = ("session",) if method.upper() in SAFE else ("session", "token")
        operation["security"] = [{"key": []}, {name: [] for name in names}, {"profile": []}]
    name, answers = operation["operationId"], operation["responses"]
    parameters = operation.setdefault("parameters", [])
    for parameter in parameters:
        if parameter["in"] == "path" or parameter.get("required"):
            parameter.setdefault("example", examples.of(parameter["schema"], parameter["name"]))
        elif parameter["in"] == "header":
            parameter["example"] = SENT[parameter["name"]]
    taken = _taken(path, method, answers)
    parameters += [{"$ref": f"#/components/parameters/{header}"} for header in taken]
    for media, content in operation.get("requestBody", {}).get("content", {}).items():
        examples.show(name, media, content)
    for status, answer in answers.items():
        if "$ref" not in answer:
            told = _headers(_given(method, status, operation, answer, examples))
            answer["headers"] = {**told, **answer.get("headers", {})}
            for media, content in answer.get("content", {}).items():
                examples.show(name, media, content)
    if "If-None-Match" in taken:
        answers["304"] = {"$ref": f"#/components/responses/{NOT_MODIFIED}"}


def _taken(path: str, method: str, answers: dict[str, Answer]) -> list[str]:
    """Return the names of the headers that many operations take and this one too."""
    names = [HEADER]
    if method == "post" and path.startswith(API) and path not in REPEATABLE:
        names.append("Idempotency-Key")
    if method == "get" and _ends(answers.get("200", {})):
        names.append("If-None-Match")
    if "206" in answers:
        names.append("Range")
    return names


def _ends(answer: Answer) -> bool:
    """Return whether an answer can be kept as a whole: a stream has no end."""
    return "text/event-stream" not in answer.get("content", {})


def _given(method: str, status: str, operation: Operation, answer: Answer, examples: Examples) -> list[str]:
    """Return the names of the headers that an answer has, or may have."""
    name, names = operation["operationId"], [HEADER]
    content = answer.get("content", {})
    whole = method == "get" and status == "200" and _ends(answer)
    if whole or status == "206" or examples.has(content.get("application/json", {}), "revision"):
        names.append("ETag")
    if status in {"206", "416"}:
        names.append("Content-Range")
    if status in {"201", "202"} and name not in NOWHERE:
        names.append("Location")
    sent = {parameter.get("name", parameter.get("$ref", "")) for parameter in operation["parameters"]}
    if "prefer" in sent and status in {"200", "202"}:
        names.append("Preference-Applied")
    if "#/components/parameters/Idempotency-Key" in sent and status.startswith("2"):
        names.append("Idempotent-Replay")
    if "application/zip" in content:
        names.append("Content-Disposition")
    if name in {"create_session", "delete_session"}:
        names.append("Set-Cookie")
    return names


def _headers(names: list[str]) -> dict[str, dict[str, str]]:
    return {name: {"$ref": f"#/components/headers/{name}"} for name in names}
