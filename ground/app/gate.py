"""What every request passes: host and origin, size, identity, idempotency, safe headers, metrics."""

from __future__ import annotations

import hashlib
import logging
import time
from collections.abc import Iterable
from functools import lru_cache
from urllib.parse import urlsplit

from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from ground.api import metrics
from ground.api.context import ONCE, call, replayed
from ground.api.problems import from_anything, refusal
from ground.api.request_id import HEADER, request_id
from ground.errors import AuthenticationError, ForbiddenError, GroundError, InvalidInputError, TooLargeError
from ground.gdr.repository import Repository
from ground.logs import REQUEST_ID
from ground.records.idempotency import Once
from ground.resources.people.authentication import SAFE, Identities
from ground.resources.people.log_in_limits import address_of
from ground.settings import Authentication
from ground.tracing import begin_request

logger = logging.getLogger(__name__)

API = "/api/v1/"
SESSION = "/api/v1/session"
FIRST = "/api/v1/first-administrator"
OPEN = {SESSION, FIRST, "/api/v1/oidc/login", "/api/v1/oidc/callback", "/api/v1/openapi.json", "/api/v1/docs"}
"""Paths that need nobody in particular."""
UPLOADS = "/api/v1/uploads"
REPEATABLE = {UPLOADS, SESSION, "/api/v1/api-keys", "/api/v1/people", FIRST}
"""What takes no Idempotency-Key: bodies too large to keep, and what has secrets, of which nobody keeps a
hash that can be guessed at."""
ACCESS = ("/api/v1/people", SESSION, "/api/v1/api-keys")
"""Paths whose changes say who may come in; sessions are among them."""
COPY = "/copy"
"""How the path ends of what makes a mission of another, with its roles."""
SMALL_BODY = 8 * 2**20
IDEMPOTENT_BODY = SMALL_BODY
LOG_IN_BODY = 1 << 14
"""A name of 80 characters and a password of 1,000, each written as `\\uXXXX`, twice over."""
_LOOPBACK = {"localhost", "127.0.0.1", "::1", "[::1]", "testserver"}
SECURITY_HEADERS = [
    (b"x-content-type-options", b"nosniff"),
    (b"x-frame-options", b"DENY"),
    (b"referrer-policy", b"no-referrer"),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"cross-origin-resource-policy", b"same-origin"),
]
PAGE_POLICY = (
    "default-src 'self'; img-src 'self' data: blob:; style-src 'self' 'unsafe-inline'; script-src 'self'; "
    "connect-src 'self'; worker-src 'self' blob:; object-src 'none'; base-uri 'none'; "
    "frame-ancestors 'none'; "
    "form-action 'self'"
)

DOCS_POLICY = "default-src 'none'; style-src 'unsafe-inline'; base-uri 'none'; frame-ancestors 'none'"


@lru_cache(maxsize=256)
def _host_name(host: str) -> str:
    """Return the name in a Host header, without its port; empty if it is malformed."""
    try:
        return (urlsplit(f"//{host}").hostname or "").lower()
    except ValueError:
        return ""


def _safe_headers(given: Iterable[tuple[bytes, bytes]], path: str, kept: bool) -> list[tuple[bytes, bytes]]:
    """Return the headers of an answer with those that keep browsers from harm.

    What is `kept` may lie with the client, who asks each time whether it is still so.
    """
    headers = list(given)
    present = {name.lower(): value for name, value in headers}
    headers += SECURITY_HEADERS
    if path.startswith(API) and b"cache-control" not in present:
        headers.append((b"cache-control", b"private, no-cache" if kept else b"no-store"))
    is_page = present.get(b"content-type", b"").startswith(b"text/html")
    if is_page and b"content-security-policy" not in present:
        policy = DOCS_POLICY if path.startswith(API) else PAGE_POLICY
        headers.append((b"content-security-policy", policy.encode()))
    return headers


def _level(status: int) -> int:
    """Return how loud a request is in the log: what was refused can be found there by its id."""
    return logging.INFO if status >= 400 or not status else logging.DEBUG


async def _whole(receive: Receive, limit: int, what: str) -> bytes | None:
    """Return a body when all of it has come; None if the other side is gone before that.

    Raises
    ------
    TooLargeError
        If it is larger than the limit.
    """
    body, more = b"", True
    while more:
        try:
            message = await receive()
        except HTTPException as err:
            raise TooLargeError(str(err.detail)) from err
        if message["type"] == "http.disconnect":
            return None
        body += message.get("body", b"")
        more = message.get("more_body", False)
        if len(body) > limit:
            raise TooLargeError(f"{what} has at most {limit} bytes")
    return body


def _again(body: bytes) -> Receive:
    """Return what gives a body that was read already."""

    async def replay() -> Message:
        nonlocal body
        current, body = body, b""
        return {"type": "http.request", "body": current, "more_body": False}

    return replay


class Gate:
    """ASGI middleware round the whole application."""

    def __init__(self, app: ASGIApp, repo: Repository, identities: Identities) -> None:
        self.app, self.repo, self.identities = app, repo, identities
        names = [n.strip().lower() for n in repo.settings.public_hosts.split(",")]
        self._hosts = _LOOPBACK | {n for n in names if n}
        self._any_host = not repo.settings.is_loopback and not self._hosts - _LOOPBACK
        self._limit = int(repo.settings.max_body_mib * 2**20)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        began = time.perf_counter()
        headers = Headers(scope=scope)
        method, path = scope["method"], scope["path"]
        status = 0
        name = request_id(headers.get(HEADER))
        mark = REQUEST_ID.set(name)
        span = begin_request(method, headers.get("traceparent"))

        async def safe_send(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
                kept = method in SAFE and status == 200 and path not in OPEN
                message["headers"] = _safe_headers(message["headers"], path, kept)
                message["headers"].append((b"x-request-id", name.encode()))
            await send(message)

        try:
            try:
                await self._pass(scope, receive, safe_send, headers, method, path)
            except Exception as err:
                if status:
                    raise
                answer = refusal(err, path) if isinstance(err, GroundError) else from_anything(path, err)
                await answer(scope, receive, safe_send)
        finally:
            route = scope.get("route")
            place = getattr(route, "path_format", None) or getattr(route, "path", None) or "other"
            took_s = time.perf_counter() - began
            metrics.observe(method, place, status, took_s)
            if logger.isEnabledFor(_level(status)):
                told = {"method": method, "path": path, "status": status, "took_s": round(took_s, 4)}
                logger.log(_level(status), "answered", extra=told)
            if span is not None:
                span.end(method, place, status)
            REQUEST_ID.reset(mark)

    async def _pass(
        self, scope: Scope, receive: Receive, send: Send, headers: Headers, method: str, path: str
    ) -> None:
        self._check_host(headers)
        if method not in SAFE:
            self._check_origin(headers)
        if path.startswith(API):
            state = scope.setdefault("state", {})
            try:
                state["actor"] = await self.identities.actor_of(method, headers)
            except (AuthenticationError, ForbiddenError):
                if path not in OPEN:
                    raise
                state["actor"] = None
        limit = self._limit if path == UPLOADS else min(self._limit, SMALL_BODY)
        length = headers.get("content-length", "")
        if length.isdigit() and int(length) > limit:
            raise TooLargeError(f"the body has {length} bytes; {limit} are allowed here")
        taken = 0

        async def counted() -> Message:
            nonlocal taken
            message = await receive()
            if message["type"] == "http.request":
                taken += len(message.get("body", b""))
                if taken > limit:  # reading a body passes only this kind of error on as it is
                    raise HTTPException(413, f"the body has more than {limit} bytes")
            return message

        # roles may be others then; whoever has the answer may rely on it
        changes_access = method not in SAFE and (path.startswith(ACCESS) or path.endswith(COPY))

        async def told(message: Message) -> None:
            if changes_access and message["type"] == "http.response.start":
                self.identities.forget()
            await send(message)

        key = headers.get("idempotency-key") if method == "POST" and path not in REPEATABLE else None
        if method == "POST" and path in {SESSION, FIRST}:
            await self._log_in(scope, counted, told)
        elif key is None:
            await self.app(scope, counted, told)
        else:
            await self._once(scope, counted, told, key)

    def _check_host(self, headers: Headers) -> None:
        """Refuse names under which we do not serve: what a page gets by rebinding its own name to
        loopback.
        """
        host = headers.get("host", "")
        name = _host_name(host)
        if not self._any_host and name not in self._hosts and name != self.repo.settings.host:
            raise InvalidInputError(
                f"the host {host[:100]!r} is not served here (OUTCROP_PUBLIC_HOSTS)", pointer="Host"
            )

    def _check_origin(self, headers: Headers) -> None:
        origin = headers.get("origin")
        if origin is not None and origin != "null":
            try:
                name = (urlsplit(origin).netloc or "").lower()
            except ValueError:
                name = ""
            if name == headers.get("host", "").lower():
                return
            raise ForbiddenError(f"a page of {origin[:100]!r} may not change anything here")
        if origin == "null" or headers.get("sec-fetch-site") in {"cross-site", "same-site"}:
            raise ForbiddenError("a page of another site may not change anything here")

    async def _log_in(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let a log-in in to a place, if there is one: what waits outside costs its connection alone."""
        body = await _whole(receive, LOG_IN_BODY, "a log-in")
        if body is None:
            return
        if self.repo.settings.auth is Authentication.PROFILES:
            await self.app(scope, _again(body), send)
            return
        client = scope.get("client")
        with scope["app"].state.limits.place(address_of(client[0] if client else None)):
            await self.app(scope, _again(body), send)

    async def _once(self, scope: Scope, receive: Receive, send: Send, key: str) -> None:
        """Answer a repeated POST with what was answered the first time."""
        if not 0 < len(key) <= 255 or not key.isprintable() or not key.isascii():
            raise InvalidInputError(
                "an Idempotency-Key has 1 to 255 printable characters", pointer="Idempotency-Key"
            )
        body = await _whole(receive, IDEMPOTENT_BODY, "with an Idempotency-Key a body")
        if body is None:
            return
        actor = scope["state"].get("actor")
        line = f"{scope['path']}?{scope['query_string'].decode('latin-1')}\n"
        if actor is not None:  # an answer is not given again to who may do less by now, or has a narrower key
            line += actor.rights
        digest = hashlib.sha256(line.encode() + body).hexdigest()
        once = Once(self.repo, "" if actor is None else actor.name, key, digest)
        stored = await call(once.find)
        if stored is not None:
            await replayed(stored)(scope, receive, send)
            return
        held: list[Message] = []

        async def hold(message: Message) -> None:
            """Send what was kept with its effect, and hold a refusal: who has it may use the key again."""
            if once.answered:
                await send(message)
            else:
                held.append(message)

        mark = ONCE.set(once)
        try:
            await self.app(scope, _again(body), hold)
        finally:
            ONCE.reset(mark)
        if held and held[0]["status"] < 500:
            content = b"".join(message.get("body", b"") for message in held[1:])
            stored = await call(once.keep, held[0]["status"], list(held[0]["headers"]), content)
            if stored is not None:
                await replayed(stored)(scope, receive, send)
                return
        for message in held:
            await send(message)
