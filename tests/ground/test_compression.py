"""What the server sends is compressed for whoever takes it, and its ETag is true."""

from __future__ import annotations

import gzip
import itertools
import math
from pathlib import Path
from typing import Any

import anyio
import brotli
import httpx
import pytest
from starlette.applications import Starlette
from starlette.responses import FileResponse, JSONResponse, Response, StreamingResponse
from starlette.routing import Route

from ground.app.compression import Compression, coding_wanted
from tests.ground.conftest import Api, yard

TEXT = b"outcrop " * 1000


def _answers(path: Path) -> Any:
    async def file(_: Any) -> Response:
        return FileResponse(path, headers={"ETag": '"abc"'})

    async def row(_: Any) -> Response:
        return JSONResponse({"notes": "x" * 5000}, headers={"ETag": '"3"'})

    async def small(_: Any) -> Response:
        return JSONResponse({"notes": "x"})

    async def events(_: Any) -> Response:
        return StreamingResponse(iter([TEXT]), media_type="text/event-stream")

    async def picture(_: Any) -> Response:
        return Response(TEXT, media_type="image/jpeg")

    app = Starlette(routes=[Route(f"/{f.__name__}", f) for f in (file, row, small, events, picture)])
    app.add_middleware(Compression)
    return app


@pytest.fixture
def ask(tmp_path: Path) -> Any:
    path = tmp_path / "file.txt"
    path.write_bytes(TEXT)

    def get(name: str, **headers: str) -> tuple[httpx.Headers, bytes]:
        async def send() -> tuple[httpx.Headers, bytes]:
            transport = httpx.ASGITransport(app=_answers(path))
            async with (
                httpx.AsyncClient(transport=transport, base_url="http://nowhere") as client,
                client.stream("GET", f"/{name}", headers=headers) as answer,
            ):
                return answer.headers, b"".join([part async for part in answer.aiter_raw()])

        return anyio.run(send)

    return get


DECODERS = {"gzip": gzip.decompress, "br": brotli.decompress}


def test_files_and_rows_are_compressed_where_that_is_taken(ask: Any) -> None:
    for name, coding in itertools.product(("file", "row"), DECODERS):
        headers, sent = ask(name, **{"Accept-Encoding": coding})
        plain_headers, plain = ask(name, **{"Accept-Encoding": "identity"})
        assert headers["content-encoding"] == coding
        assert "accept-encoding" in headers["vary"].lower()
        assert DECODERS[coding](sent) == plain
        assert len(sent) < len(plain) / 10
        assert "content-encoding" not in plain_headers


@pytest.mark.parametrize(
    ("accepted", "coding"),
    [
        ("gzip, deflate, br", "br"),
        ("gzip", "gzip"),
        ("GZIP;q=0.5", "gzip"),
        ("br;q=0.2, gzip;q=0.8", "gzip"),
        ("br;q=0, gzip;q=0", ""),
        ("gzip;q=0", ""),
        ("*", "br"),
        ("*;q=0", ""),
        ("br;q=much", ""),
        ("", ""),
    ],
)
def test_the_coding_is_one_that_the_client_takes(accepted: str, coding: str) -> None:
    assert coding_wanted(accepted) == coding


def test_the_etag_of_a_compressed_file_is_weak_and_that_of_a_row_is_its_revision(ask: Any) -> None:
    assert ask("file", **{"Accept-Encoding": "gzip"})[0]["etag"] == 'W/"abc"'
    assert ask("file", **{"Accept-Encoding": "identity"})[0]["etag"] == '"abc"'
    assert ask("row", **{"Accept-Encoding": "gzip"})[0]["etag"] == '"3"'


def test_parts_small_answers_pictures_and_events_stay_as_they_are(ask: Any) -> None:
    headers, part = ask("file", **{"Accept-Encoding": "gzip", "Range": "bytes=0-6"})
    assert (part, headers["etag"]) == (b"outcrop", '"abc"')
    assert "content-encoding" not in headers
    for name in ("small", "picture", "events"):
        assert "content-encoding" not in ask(name, **{"Accept-Encoding": "gzip"})[0]


def test_the_service_compresses_and_a_change_takes_the_etag_it_read(
    sqlite_api: Api, terrain_folder: Path
) -> None:
    mission = yard(sqlite_api.repo, terrain_folder)
    url = f"/missions/{mission.id}"
    sqlite_api("PATCH", url, {"notes": "dusty " * 500}, headers={"If-Match": "*"})
    read = sqlite_api("GET", url, headers={"Accept-Encoding": "gzip"})
    assert read.headers["content-encoding"] == "gzip"
    changed = sqlite_api("PATCH", url, {"notes": "clear"}, headers={"If-Match": read.headers["etag"]})
    assert changed.status_code == 200
    heights = sqlite_api("GET", f"{url}/terrain/heights", headers={"Accept-Encoding": "gzip"})
    shape = [int(heights.headers[name]) for name in ("X-Rows", "X-Columns") if name in heights.headers]
    assert heights.headers["content-encoding"] == "gzip"
    assert not shape or len(heights.content) == 4 * math.prod(shape)
