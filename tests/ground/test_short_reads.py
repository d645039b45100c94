"""GETs by id that ask for nothing more go past the framework's way to parameters, and mean the same."""

from __future__ import annotations

import pytest
from fastapi.dependencies.utils import request_params_to_args
from hypothesis import given
from hypothesis import strategies as st
from starlette.datastructures import QueryParams

from ground.api.context import Route, _defaults_of_read, _is_id
from ground.app.api import build_api
from tests.ground.conftest import Api

SHORT = {
    route.path: (route, defaults)
    for route in build_api().routes
    if isinstance(route, Route) and (defaults := _defaults_of_read(route)) is not None
}


def test_those_asked_most_are_short() -> None:
    assert {"/api/v1/targets/{target_id}", "/api/v1/missions/{mission_id}/targets"} < set(SHORT)
    assert not [path for path in SHORT if path.endswith(("/events", "/sessions", "/session"))]


@pytest.mark.parametrize("path", SHORT)
def test_what_nobody_asked_for_is_what_the_framework_makes_of_it(path: str) -> None:
    route, defaults = SHORT[path]
    values, errors = request_params_to_args(route.dependant.query_params, QueryParams(""))
    assert (values, errors) == (defaults, [])


@given(st.text(max_size=3) | st.text("aZ09_-~é\n", min_size=35, max_size=45) | st.just("a\n"))
def test_an_id_is_one_where_the_framework_takes_it(word: str) -> None:
    route, _ = SHORT["/api/v1/targets/{target_id}"]
    _, errors = request_params_to_args(route.dependant.path_params, {"target_id": word})
    assert bool(_is_id(word)) == (not errors)


def test_what_is_no_id_is_refused_as_before(sqlite_api: Api) -> None:
    for word in ("x" * 41, "a%0A", "a~b", "%C3%A9"):
        refused = sqlite_api("GET", f"/targets/{word}")
        assert (refused.status_code, refused.json()["type"]) == (422, "urn:outcrop:problem:invalid-input")
    assert sqlite_api("GET", "/targets/tgt-none").status_code == 404
    assert sqlite_api("GET", "/targets/tgt-none?strange=1").status_code == 422
