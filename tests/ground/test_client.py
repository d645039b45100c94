"""The Python client reaches every operation of the interface and asks what the interface describes."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from fastapi.routing import APIRoute

from ground.app.api import build_api
from ground.client import ApiError, Client
from ground.client.interface import Member, Operation, Record, operations
from ground.client.rest import events_of

ROOT = Path(__file__).parents[2]
FOR_MACHINES = {"healthz", "readyz", "metrics"}


def _served(answer: Callable[[httpx.Request], httpx.Response]) -> Client:
    return Client("http://nowhere", transport=httpx.MockTransport(answer))


def _sample(member: Member) -> Any:
    kinds = {"string": "one", "integer": 1, "number": 1.5, "boolean": True, "array": [], "object": {}}
    return next(value for kind, value in kinds.items() if kind in member.types)


def _given(operation: Operation) -> tuple[list[Any], dict[str, Any]]:
    """Return a value for whatever an operation takes."""
    where = [_sample(p) for p in operation.parameters["path"]]
    named = {p.name: _sample(p) for p in operation.parameters["query"] if p.name not in {"cursor", "after"}}
    named |= {member.name: _sample(member) for member in operation.body or ()}
    named |= {p.word: 3 if p.word == "revision" else "one" for p in operation.parameters["header"]}
    return where, named | ({"content": b"file"} if operation.sends_file else {})


@pytest.fixture(scope="module")
def routes() -> dict[str, APIRoute]:
    return {
        route.name: route
        for route in build_api().routes
        if isinstance(route, APIRoute) and route.include_in_schema and route.name not in FOR_MACHINES
    }


def test_every_operation_of_the_interface_is_a_method_of_the_client(routes: dict[str, APIRoute]) -> None:
    assert set(operations()) == set(routes)
    with _served(lambda _: httpx.Response(204)) as client:
        assert all(callable(getattr(client, name)) for name in routes)
        with pytest.raises(AttributeError, match="no operation 'fly'"):
            client.fly  # noqa: B018 - reading it is the test


def test_a_method_asks_what_its_route_takes(routes: dict[str, APIRoute]) -> None:
    for name, route in routes.items():
        asked: list[httpx.Request] = []

        def note(request: httpx.Request, asked: list[httpx.Request] = asked) -> httpx.Response:
            asked.append(request)
            return httpx.Response(200, json={"items": [], "next_cursor": None, "csrf_token": ""})

        where, named = _given(operations()[name])
        with _served(note) as client:
            answer = getattr(client, name)(*where, **named)
            if isinstance(answer, Iterator):
                list(answer)
        (request,) = asked
        assert request.method in route.methods
        assert re.fullmatch(re.sub(r"\{[^}]*\}", "[^/]+", route.path), request.url.path), name
        known = {parameter.alias for parameter in route.dependant.query_params}
        assert set(request.url.params) == known - {"cursor", "after"}, name
        for parameter in route.dependant.header_params:
            assert parameter.alias in request.headers, (name, parameter.alias)
        if route.body_field is not None and not operations()[name].sends_file:
            (body,) = route.dependant.body_params
            assert set(_json(request)) == set(body.field_info.annotation.model_fields), name  # type: ignore[union-attr]


def _json(request: httpx.Request) -> dict[str, Any]:
    found: dict[str, Any] = httpx.Response(200, content=request.content).json()
    return found


def test_what_an_operation_does_not_take_is_refused_before_it_is_asked() -> None:
    with _served(lambda _: pytest.fail("the server was asked")) as client:
        with pytest.raises(TypeError, match="create_target takes no east"):
            client.create_target("msn-1", east=1.0)
        with pytest.raises(TypeError, match="get_target takes target_id; 0 are given"):
            client.get_target()


def test_answers_come_as_records_text_or_bytes() -> None:
    def serve(request: httpx.Request) -> httpx.Response:
        if request.url.path.endswith("/crl"):
            return httpx.Response(200, text="(plan)")
        if request.url.path.endswith("/report"):
            return httpx.Response(200, text="<html>")
        return httpx.Response(200, json={"id": "tgt-1", "position": {"east_m": 1.5}})

    with _served(serve) as client:
        target = client.get_target("tgt-1")
        assert target.position.east_m == target["position"]["east_m"] == 1.5
        with pytest.raises(AttributeError, match="no member 'north'; there are id, position"):
            target.north  # noqa: B018 - reading it is the test
        assert client.get_plan_crl("pln-1") == "(plan)"
        assert client.get_plan_report("pln-1") == b"<html>"


@pytest.mark.parametrize(("name", "turn"), [("list_targets", "cursor"), ("list_history", "after")])
def test_a_list_comes_from_all_its_pages(name: str, turn: str) -> None:
    asked: list[tuple[str | None, str]] = []

    def serve(request: httpx.Request) -> httpx.Response:
        at = request.url.params.get(turn)
        asked.append((at, request.url.params["limit"]))
        first = int(at or 0)
        rows = [{"id": f"row-{first + k}"} for k in range(2)]
        return httpx.Response(200, json={"items": rows, "next_cursor": None if first == 4 else first + 2})

    with _served(serve) as client:
        assert [row.id for row in getattr(client, name)("msn-1")] == [f"row-{k}" for k in range(6)]
        assert asked == [(None, "200"), ("2", "200"), ("4", "200")]
        asked.clear()
        assert [row.id for row in getattr(client, name)("msn-1", limit=1)] == ["row-0"]
        assert asked == [(None, "1")]


def test_a_change_names_the_revision_that_was_seen() -> None:
    seen: list[str | None] = []

    def serve(request: httpx.Request) -> httpx.Response:
        seen.append(request.headers.get("If-Match"))
        return httpx.Response(200, json={"id": "tgt-1"})

    with _served(serve) as client:
        client.change_target("tgt-1", notes="dusty", revision=4)
        client.change_target("tgt-1", notes="dusty")
    assert seen == ['"4"', "*"]


def test_a_part_of_a_path_stays_one_part() -> None:
    with _served(lambda request: httpx.Response(200, json={"path": request.url.raw_path.decode()})) as client:
        assert client.get_target("../people").path == "/api/v1/targets/..%2Fpeople"


def test_events_are_read_with_their_ids_and_comments_are_passed_over() -> None:
    lines = ["retry: 1000", "", ": still here", "", "id: 7", "event: changed", 'data: {"kind": "target"}', ""]
    assert list(events_of(iter(lines))) == [{"id": "7", "event": "changed", "data": {"kind": "target"}}]


def test_a_refused_stream_is_an_error_with_the_reason() -> None:
    def refuse(_: httpx.Request) -> httpx.Response:
        return httpx.Response(
            404, json={"type": "urn:outcrop:problem:not-found", "detail": "there is no run r"}
        )

    with _served(refuse) as client, pytest.raises(ApiError, match="there is no run r") as caught:
        next(client.stream_run("r"))
    assert (caught.value.status, caught.value.kind) == (404, "not-found")


def test_the_token_of_a_session_goes_with_every_change() -> None:
    seen: list[str | None] = []

    def serve(request: httpx.Request) -> httpx.Response:
        seen.append(request.headers.get("X-CSRF-Token"))
        if request.url.path.endswith("/session"):
            return httpx.Response(201, json={"person": None, "csrf_token": "t0", "auth": "accounts"})
        return httpx.Response(204)

    with _served(serve) as client:
        client.create_session(name="Ada", password="secret")
        client.delete_target("tgt-1")
    assert seen == [None, "t0"]


@pytest.mark.slow
def test_the_types_of_the_methods_are_those_of_the_interface(tmp_path: Path) -> None:
    """mypy takes what the interface takes, and refuses what it does not."""
    script = ROOT / "scripts" / "client_stub.py"
    subprocess.run([sys.executable, str(script)], check=True)
    stub = (ROOT / "ground" / "client" / "operations.pyi").read_text(encoding="utf-8")
    assert [f"    def {name}(self" in stub for name in operations()].count(False) == 0
    use = tmp_path / "use.py"
    use.write_text(
        "from ground.client import Client\n"
        "with Client() as client:\n"
        "    for target in client.list_targets('msn-1'):\n"
        "        up: float = target.position.up_m\n"
        "    name: str = client.get_plan_crl('pln-1', canonical=True)\n"
        "    client.create_target('msn-1', east_m='far', north_m=1.0)\n"
        "    client.fly()\n"
    )
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", "--cache-dir", str(tmp_path / "cache"), str(use)],
        capture_output=True,
        text=True,
        cwd=ROOT,
        env={"MYPYPATH": str(ROOT), "PATH": "/usr/bin:/bin"},
    )
    wrong = [line.rpartition("use.py:")[2] for line in done.stdout.splitlines() if "error:" in line]
    assert [line.partition(":")[0] for line in wrong] == ["6", "7"], done.stdout


def test_a_record_is_a_mapping_and_its_members_are_attributes() -> None:
    record = Record(items=[1], name="n")
    assert record.name == "n"
    assert record["items"] == [1]
    assert dict(record) == {"items": [1], "name": "n"}
