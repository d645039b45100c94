"""Parts of files that lie in an object store (RFC 9110, section 14), passed through."""

from __future__ import annotations

import re
from collections.abc import Mapping

from starlette.responses import Response, StreamingResponse

from ground.gdr.files import FarFile

_ONE = re.compile(r"bytes=(\d*)-(\d*)$")


def wants_part(headers: Mapping[str, str]) -> bool:
    """Return whether a request asks for one part of a file; who asks for several gets the whole."""
    return _ONE.match(headers.get("range", "").strip()) is not None


def part_answer(far: FarFile, asked: Mapping[str, str], headers: Mapping[str, str], media: str) -> Response:
    """Answer with the part of a file that `asked`, a request's headers, names; `headers` go with it.

    With an `If-Range` that is not the file's ETag it is the whole.
    """
    size = far.size_bytes
    start, stop = 0, size
    found = _ONE.match(asked.get("range", "").strip())
    whole = found is None or asked.get("if-range", headers["ETag"]) != headers["ETag"]
    if found is not None and not whole:
        first, last = found.groups()
        if first:
            start, stop = int(first), min(size, int(last) + 1 if last else size)
        elif last:
            start = max(0, size - int(last))
        if start >= stop or not (first or last):
            return Response(status_code=416, headers={"Content-Range": f"bytes */{size}"})
    told = {
        **headers,
        "Accept-Ranges": "bytes",
        "Content-Disposition": "inline",
        "Content-Length": str(stop - start),
    }
    if not whole:
        told["Content-Range"] = f"bytes {start}-{stop - 1}/{size}"
    status = 200 if whole else 206
    return StreamingResponse(far.part(start, stop), status, media_type=media, headers=told)
