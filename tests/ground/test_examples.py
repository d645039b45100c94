"""The document of the interface shows an example of every operation, its headers, and who may ask."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Any

import pytest
from fastapi.routing import APIRoute
from jsonschema import Draft202012Validator  # type: ignore[import-untyped]
from pydantic import TypeAdapter

from executive.crl import parse
from ground.app.api import build_api
from ground.app.gate import API, OPEN
from tests.ground.conftest import Api

BYTES = {
    "application/geopackage+sqlite3",
    "application/octet-stream",
    "application/zip",
    "image/png",
    "image/jpeg",
    "image/tiff",
}
"""Files whose example would tell nobody anything."""


@cache
def document() -> dict[str, Any]:
    return build_api().openapi()


def operations() -> Iterator[tuple[str, str, dict[str, Any]]]:
    for path, ways in document()["paths"].items():
        for method, operation in ways.items():
            yield path, method, operation


def resolved(told: dict[str, Any]) -> dict[str, Any]:
    """Return what a reference of the document stands for."""
    for part in told.get("$ref", "#").split("/")[1:]:
        told = document()[part] if part == "components" else told[part]
    return told


def answers(operation: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    for status, answer in operation["responses"].items():
        yield status, resolved(answer)


def bodies(operation: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the media type and the content of all that is sent and answered."""
    yield from operation.get("requestBody", {}).get("content", {}).items()
    for _, answer in answers(operation):
        yield from answer.get("content", {}).items()


def example_of(content: dict[str, Any]) -> Any:
    if "examples" in content:
        (named,) = content["examples"].values()
        return resolved(named)["value"]
    return content["example"]


def faults(schema: dict[str, Any], value: Any) -> list[str]:
    whole = {**schema, "components": document()["components"]}
    return [
        f"{error.json_path}: {error.message[:120]}"
        for error in Draft202012Validator(whole).iter_errors(value)
    ]


def test_every_body_of_every_operation_has_an_example_that_fits_its_schema() -> None:
    wrong = []
    for _, _, operation in operations():
        for media, content in bodies(operation):
            if media in BYTES:
                continue
            wrong += [
                (operation["operationId"], fault)
                for fault in faults(content.get("schema", {}), example_of(content))
            ]
    assert wrong == []


def test_what_an_example_sends_is_taken_and_what_it_answers_is_what_the_code_answers() -> None:
    """The code's own types say more than their schemas: rules between members, whole values."""
    routes = {route.name: route for route in build_api().routes if isinstance(route, APIRoute)}
    sent = answered = 0
    for _, _, operation in operations():
        route = routes[operation["operationId"]]
        content = operation.get("requestBody", {}).get("content", {}).get("application/json")
        if content is not None:
            (body,) = route.dependant.body_params
            TypeAdapter[Any](body.field_info.annotation).validate_python(example_of(content))
            sent += 1
        content = (
            operation["responses"]
            .get(str(route.status_code or 200), {})
            .get("content", {})
            .get("application/json")
        )
        if content is not None and route.response_model is not None:
            TypeAdapter(route.response_model).validate_python(example_of(content))
            answered += 1
    assert sent > 50
    assert answered > 120


def test_every_parameter_has_a_description_or_an_example_that_fits() -> None:
    for path, _, operation in operations():
        for told in operation["parameters"]:
            parameter = resolved(told)
            if parameter["in"] in {"path", "header"}:
                assert faults(parameter["schema"], parameter["example"]) == [], (path, parameter["name"])
            if parameter["in"] == "header":
                assert parameter["description"], (path, parameter["name"])


def test_every_answer_names_its_headers() -> None:
    for _, method, operation in operations():
        name = operation["operationId"]
        for status, answer in answers(operation):
            assert "X-Request-Id" in answer["headers"], (name, status)
            for header in answer["headers"].values():
                assert resolved(header)["description"]
        whole = operation["responses"].get("200", {})
        stream = "text/event-stream" in whole.get("content", {})
        kept = method == "get" and not stream
        assert ("304" in operation["responses"]) == kept, name
        if kept:
            assert "ETag" in whole["headers"], name


def test_what_needs_somebody_says_who_may_ask() -> None:
    schemes = document()["components"]["securitySchemes"]
    for path, method, operation in operations():
        asked = operation["security"]
        assert (asked == [{}]) == (path in OPEN or not path.startswith(API)), path
        assert all(name in schemes for way in asked for name in way)
        with_session = [way for way in asked if "session" in way]
        assert all(("token" in way) == (method != "get") for way in with_session), path


@pytest.mark.parametrize("name", ["stream_job", "stream_mission", "stream_run", "get_plan_crl"])
def test_an_example_of_text_is_one_of_its_own(name: str) -> None:
    (operation,) = (operation for _, _, operation in operations() if operation["operationId"] == name)
    ((_, content),) = operation["responses"]["200"]["content"].items()
    text = example_of(content)
    if name == "get_plan_crl":
        parse(text)
    else:
        assert f"`{text.split('event: ')[1].splitlines()[0]}`" in operation["description"]


def test_an_open_operation_is_answered_without_anybody(sqlite_api: Api) -> None:
    for path, method, operation in operations():
        if operation["security"] == [{}] and method == "get":
            answer = sqlite_api("GET", path, who="nobody")
            assert answer.status_code != 401, path
