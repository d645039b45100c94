"""Answers compressed on the wire (gzip), with an ETag that says so."""

from __future__ import annotations

from starlette.datastructures import Headers, MutableHeaders
from starlette.middleware.gzip import GZipResponder
from starlette.types import ASGIApp, Receive, Scope, Send

LEAST_BYTES = 1400
"""What fits into one packet gains nothing."""
LEVEL = 6
"""zlib's own: 9 takes twice the time for 1 % less."""


class Compression:
    """Compress what is worth it for whoever takes it; pictures, archives, event streams and parts stay."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request."""
        if scope["type"] == "http" and "gzip" in Headers(scope=scope).get("Accept-Encoding", ""):
            await _Responder(self._app, LEAST_BYTES, LEVEL)(scope, receive, send)
        else:
            await self._app(scope, receive, send)


class _Responder(GZipResponder):
    """Makes the ETag of a compressed file a weak one, so that no part of the plain file is put to it.

    That of JSON names a revision and stays as If-Match takes it (RFC 9110, 8.8.1 and 13.1.5).
    """

    async def apply_compression(self, body: bytes, *, more_body: bool) -> bytes:
        headers = MutableHeaders(raw=self.initial_message["headers"])
        etag = headers.get("ETag", "")
        if etag.startswith('"') and headers.get("Content-Type") != "application/json":
            headers["ETag"] = f"W/{etag}"
        return await super().apply_compression(body, more_body=more_body)
