"""304 for whoever has the present answer already (If-None-Match), and an ETag on each whole answer."""

from __future__ import annotations

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from ground.api.etags import digest_of, is_known

KEPT = {b"cache-control", b"content-location", b"date", b"etag", b"expires", b"vary", b"x-request-id"}
"""Headers of a 304: those that a cache updates (RFC 9110, 15.4.5), and the id of the request."""


class Conditional:
    """Answer a GET with 304 and no body where the client names the ETag of what it would get.

    An answer that names no ETag and comes in one piece gets one of its content; event streams get none.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request."""
        if scope["type"] == "http" and scope["method"] in {"GET", "HEAD"}:
            known = Headers(scope=scope).get("if-none-match")
            await self._app(scope, receive, _Answer(known, send).send)
        else:
            await self._app(scope, receive, send)


class _Answer:
    """One answer on its way out; its start is held back until its ETag is known."""

    def __init__(self, known: str | None, send: Send) -> None:
        self._known, self._send = known, send
        self._start: Message | None = None
        self._over = False

    async def send(self, message: Message) -> None:
        if self._over:  # the rest of what the client has
            return
        if message["type"] == "http.response.start":
            if message["status"] != 200:
                await self._send(message)
                return
            headers = MutableHeaders(raw=message["headers"])
            etag = headers.get("etag")
            if etag is None and not headers.get("content-type", "").startswith("text/event-stream"):
                self._start = message
                return
            await self._begin(message, etag)
            return
        start, self._start = self._start, None
        if start is not None:
            etag = None
            if message["type"] == "http.response.body" and not message.get("more_body", False):
                etag = f'W/"{digest_of(message.get("body", b""))}"'
                MutableHeaders(raw=start["headers"])["ETag"] = etag
            await self._begin(start, etag)
        if not self._over:
            await self._send(message)

    async def _begin(self, start: Message, etag: str | None) -> None:
        if etag is not None and self._known is not None and is_known(etag, self._known):
            self._over = True
            headers = [pair for pair in start["headers"] if pair[0].lower() in KEPT]
            await self._send({"type": "http.response.start", "status": 304, "headers": headers})
            await self._send({"type": "http.response.body", "body": b""})
        else:
            await self._send(start)
