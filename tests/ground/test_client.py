"""The Python client reaches every operation of the interface and says truly what comes back."""

from __future__ import annotations

import inspect
import re
import typing
from collections.abc import Callable, Iterator
from operator import methodcaller
from pathlib import Path
from typing import Any

import httpx
import pytest
from fastapi.routing import APIRoute

from ground.app.api import build_api
from ground.client.operations import (
    Caller,
    MissionOperations,
    PeopleOperations,
    PlanOperations,
    RunOperations,
    SiteOperations,
    TerrainOperations,
    events_of,
)
from ground.client.rest import COLLECTIONS, ApiError, Client
from ground.resources.targets.value import Target

GROUPS = (
    MissionOperations,
    TerrainOperations,
    PlanOperations,
    RunOperations,
    SiteOperations,
    PeopleOperations,
)
FOR_MACHINES = {"healthz", "readyz", "metrics"}
Routes = dict[tuple[str, str], APIRoute]
Asked = tuple[str, str]


class _AskedError(Exception):
    """Carries the request that a method would have sent."""


def _asked(act: Callable[[Client], Any]) -> Asked:
    """Return method and path of what a call asks of the server."""

    def stop(request: httpx.Request) -> httpx.Response:
        raise _AskedError(request.method, request.url.path)

    with Client("http://nowhere", transport=httpx.MockTransport(stop)) as client:
        try:
            done = act(client)
            if isinstance(done, Iterator):
                next(done)
        except _AskedError as asked:
            return asked.args[0], asked.args[1]
    raise AssertionError("nothing was asked")


@pytest.fixture(scope="module")
def routes() -> Routes:
    return {
        (method, route.path): route
        for route in build_api().routes
        if isinstance(route, APIRoute)
        for method in route.methods or ()
    }


def _fitting(routes: Routes, asked: Asked, variable: str) -> list[APIRoute]:
    return [
        route
        for (method, path), route in routes.items()
        if method == asked[0] and re.fullmatch(re.sub(r"\{[^}]*\}", variable, path), asked[1])
    ]


def _route(routes: Routes, asked: Asked) -> APIRoute:
    """Return the route of a request; the one with fewest variables wins (`/missions/import`)."""
    found = _fitting(routes, asked, "[^/]+")
    assert found, f"there is no {asked[0]} {asked[1]}"
    return min(found, key=lambda route: route.path.count("{"))


def _arguments(method: Callable[..., Any], file: Path) -> dict[str, Any]:
    """Return a value for each parameter that has to be given."""
    hints = typing.get_type_hints(method)
    values: dict[Any, Any] = {float: 1.0, int: 1, Path: file}
    return {
        name: values.get(hints[name], "one")
        for name, parameter in inspect.signature(method).parameters.items()
        if name != "self"
        and parameter.default is inspect.Parameter.empty
        and parameter.kind is not inspect.Parameter.VAR_KEYWORD
    }


@pytest.fixture(scope="module")
def special(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[Any, Asked]]:
    """Each method beyond the general ones: what it says it returns, and what it asks."""
    file = tmp_path_factory.mktemp("client") / "file"
    file.write_bytes(b"content")
    base = {name for name, _ in inspect.getmembers(Caller, inspect.isfunction)}
    return {
        name: (
            typing.get_type_hints(method)["return"],
            _asked(methodcaller(name, **_arguments(method, file))),
        )
        for group in GROUPS
        for name, method in inspect.getmembers(group, inspect.isfunction)
        if name not in base
    }


def _on(act: Callable[[Client, type], Any], kind: type) -> Callable[[Client], Any]:
    return lambda client: act(client, kind)


def _general() -> Iterator[Asked]:
    acts: list[Callable[[Client, type], Any]] = [
        lambda c, k: c.get(k, "one"),
        lambda c, k: c.each(k),
        lambda c, k: c.each(k, "one"),
        lambda c, k: c.create(k, {}),
        lambda c, k: c.create(k, {}, "one"),
        lambda c, k: c.change(k, "one", {}),
        lambda c, k: c.delete(k, "one"),
        lambda c, k: c.lineage(k, "one"),
    ]
    for kind in COLLECTIONS:
        for act in acts:
            yield _asked(_on(act, kind))


def test_every_operation_of_the_interface_is_a_method_of_the_client(
    routes: Routes, special: dict[str, tuple[Any, Asked]]
) -> None:
    reached = {_route(routes, asked).name for _, asked in special.values()}
    for asked in _general():
        reached |= {route.name for route in _fitting(routes, asked, "one")}
    assert {route.name for route in routes.values()} - reached == FOR_MACHINES


def test_a_method_returns_the_value_that_the_interface_describes(
    routes: Routes, special: dict[str, tuple[Any, Asked]]
) -> None:
    loose = {bytes, str, httpx.Response, type(None)}
    checked = 0
    for name, (says, asked) in special.items():
        inner = typing.get_args(says)
        if says in loose or typing.get_origin(says) in {dict, Iterator} or dict[str, Any] in inner:
            continue
        assert says == _route(routes, asked).response_model, name
        checked += 1
    assert checked > 30


def test_events_are_read_with_their_ids_and_comments_are_passed_over() -> None:
    lines = ["retry: 1000", "", ": still here", "", "id: 7", "event: changed", 'data: {"kind": "target"}', ""]
    assert list(events_of(iter(lines))) == [{"id": "7", "event": "changed", "data": {"kind": "target"}}]


def test_a_refused_stream_is_an_error_with_the_reason() -> None:
    def refuse(_: httpx.Request) -> httpx.Response:
        return httpx.Response(
            404, json={"type": "urn:outcrop:problem:not-found", "detail": "there is no run r"}
        )

    with (
        Client("http://nowhere", transport=httpx.MockTransport(refuse)) as client,
        pytest.raises(ApiError, match="there is no run r") as caught,
    ):
        next(client.run_events("r"))
    assert (caught.value.status, caught.value.kind) == (404, "not-found")


def test_the_token_of_a_session_goes_with_every_change() -> None:
    seen: list[str | None] = []

    def serve(request: httpx.Request) -> httpx.Response:
        seen.append(request.headers.get("X-CSRF-Token"))
        if request.url.path.endswith("/session"):
            return httpx.Response(201, json={"person": None, "csrf_token": "t0", "auth": "accounts"})
        return httpx.Response(204)

    with Client("http://nowhere", transport=httpx.MockTransport(serve)) as client:
        client.log_in("Ada", "secret")
        client.delete(Target, "tgt-1")
    assert seen == [None, "t0"]
