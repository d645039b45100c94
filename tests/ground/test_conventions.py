"""What holds for every operation: 304, ids of requests, parameters that are known."""

from __future__ import annotations

import json
import logging
from pathlib import Path
from typing import Any

import pytest

from ground.logs import JsonFormatter, TextFormatter
from tests.ground.conftest import Api, yard

TARGET = {"name": "Rock1", "east_m": 4.0, "north_m": 1.0}


def know(api: Api, url: str) -> tuple[str, Any]:
    read = api("GET", url)
    return read.headers["etag"], api("GET", url, headers={"If-None-Match": read.headers["etag"]})


@pytest.fixture
def url(sqlite_api: Api, terrain_folder: Path) -> str:
    return f"/missions/{yard(sqlite_api.repo, terrain_folder).id}"


def test_what_the_client_has_is_not_sent_again(sqlite_api: Api, url: str) -> None:
    target = sqlite_api.post(f"{url}/targets", TARGET)
    for path in (
        f"/targets/{target['id']}",
        f"{url}/targets",
        f"{url}/terrain/heights",
        f"{url}/terrain/ortho",
        f"{url}/geometry",
        "/openapi.json",
    ):
        etag, again = know(sqlite_api, path)
        assert (again.status_code, again.content) == (304, b""), path
        assert again.headers["etag"] == etag
        assert "content-type" not in again.headers
        other = sqlite_api("GET", path, headers={"If-None-Match": '"0", W/"0-000000000000"'})
        assert other.status_code == 200
        weak = f'"0", W/{etag.removeprefix("W/")}'
        assert sqlite_api("GET", path, headers={"If-None-Match": weak}).status_code == 304
        assert sqlite_api("GET", path, headers={"If-None-Match": "*"}).status_code == 304


def test_a_resource_that_looks_otherwise_is_sent_though_its_revision_stands(
    sqlite_api: Api, url: str
) -> None:
    before = sqlite_api("GET", url)
    sqlite_api.post(f"{url}/targets", TARGET)
    after = sqlite_api("GET", url, headers={"If-None-Match": before.headers["etag"]})
    assert after.json()["revision"] == before.json()["revision"]
    assert (after.status_code, after.json()["counts"]["targets"]) == (200, 1)
    changed = sqlite_api("PATCH", url, {"notes": "x"}, headers={"If-Match": before.headers["etag"]})
    assert changed.status_code == 200  # what was seen of the mission itself still stands


def test_errors_and_sessions_are_sent_whole(sqlite_api: Api) -> None:
    missing = sqlite_api("GET", "/targets/tgt-none", headers={"If-None-Match": "*"})
    assert missing.status_code == 404
    assert "etag" not in missing.headers
    assert sqlite_api("GET", "/session").headers["cache-control"] == "no-store"
    assert sqlite_api("GET", "/missions").headers["cache-control"] == "private, no-cache"


def test_an_answer_its_problem_and_its_log_lines_name_one_request(
    sqlite_api: Api, caplog: pytest.LogCaptureFixture
) -> None:
    lines: list[tuple[str, str]] = []

    class Keep(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            lines.append((JsonFormatter().format(record), TextFormatter().format(record)))

    handler = Keep()
    logger = logging.getLogger("ground")
    logger.addHandler(handler)
    try:
        with caplog.at_level(logging.INFO, logger="ground"):
            answer = sqlite_api("GET", "/targets/tgt-none")
    finally:
        logger.removeHandler(handler)
    given = answer.headers["x-request-id"]
    assert answer.json()["request_id"] == given
    told, text = lines[-1]
    assert json.loads(told) | {"at_utc": "", "took_s": 0} == {
        "at_utc": "",
        "level": "info",
        "logger": "ground.app.gate",
        "message": "answered",
        "request_id": given,
        "method": "GET",
        "path": "/api/v1/targets/tgt-none",
        "status": 404,
        "took_s": 0,
    }
    assert f"request_id={given}" in text


def test_the_id_that_a_proxy_gave_is_kept_and_nothing_else_gets_into_the_log(sqlite_api: Api) -> None:
    kept = sqlite_api("GET", "/missions", headers={"X-Request-Id": "proxy-1.7_a"})
    assert kept.headers["x-request-id"] == "proxy-1.7_a"
    for strange in ("short", "with space in it", "x" * 65, "a\tb-12345678"):
        assert sqlite_api("GET", "/missions", headers={"X-Request-Id": strange}).headers[
            "x-request-id"
        ] not in {strange, ""}
    ids = {sqlite_api("GET", "/missions").headers["x-request-id"] for _ in range(20)}
    assert len(ids) == 20


def test_a_log_line_of_a_use_case_names_the_request(sqlite_api: Api, monkeypatch: Any) -> None:
    seen: list[str] = []

    def told(*_given: object, **_more: object) -> None:
        record = logging.LogRecord("x", logging.INFO, "", 0, "read", (), None)
        seen.append(json.loads(JsonFormatter().format(record)).get("request_id", ""))
        raise RuntimeError("broken for a test")

    for name in ("list_resources", "get_resource"):
        monkeypatch.setattr(f"ground.api.context.{name}", told)
    answers = [sqlite_api("GET", "/missions"), sqlite_api("GET", "/people/prs-1")]
    assert [a.status_code for a in answers] == [500, 500]
    assert seen == [a.headers["x-request-id"] for a in answers]


def test_what_is_not_there_is_not_found_whatever_is_done_to_it(sqlite_api: Api, url: str) -> None:
    for method in ("PATCH", "DELETE", "PUT", "POST"):
        for path in ("/sols/sol-path/1", "/nothing", "/missions/a/b/c"):
            answer = sqlite_api(method, path, {}, headers={"If-Match": "*"})
            assert (answer.status_code, answer.json()["type"]) == (404, "urn:outcrop:problem:not-found")
    assert sqlite_api("PUT", url, {}, headers={"If-Match": "*"}).status_code == 405
