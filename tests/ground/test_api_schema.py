"""The OpenAPI document is true: no 500, every error a problem document, no undocumented status."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import schemathesis
from fastapi import FastAPI
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis.strategies import booleans
from schemathesis.checks import not_a_server_error
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    response_headers_conformance,
    response_schema_conformance,
    status_code_conformance,
)

import ground
from ground.api import jobs_answer
from ground.app.api import build_api
from ground.app.service import build_app
from ground.cli.openapi import document_text
from ground.gdr.repository import Repository, open_repository
from ground.resources.keep_outs.bodies import KeepOutCreate
from ground.resources.keep_outs.create_keep_out import create_keep_out
from ground.resources.observation_requests.bodies import ObservationRequestCreate
from ground.resources.observation_requests.create_request import create_request
from ground.resources.people.accounts import ensure_profiles
from ground.resources.targets.bodies import TargetCreate
from ground.resources.targets.create_target import create_target
from rover_iface import terrain
from tests.ground.conftest import PLANNER, PostgresServer, settings_for, yard

OPERATIONS = [
    (method.upper(), path) for path, methods in build_api().openapi()["paths"].items() for method in methods
]
CHECKS = [
    not_a_server_error,
    status_code_conformance,
    content_type_conformance,
    response_headers_conformance,
    response_schema_conformance,
]


@dataclass(frozen=True)
class Asked:
    """A service and the ids of what is in it."""

    app: FastAPI
    known: dict[str, str]


def _service(repo: Repository, terrain_folder: Path) -> Asked:
    ensure_profiles(repo)
    mission = yard(repo, terrain_folder)
    target = create_target(repo, PLANNER, mission.id, TargetCreate(east_m=4.0, north_m=1.0))
    asked = create_request(
        repo,
        PLANNER,
        mission.id,
        ObservationRequestCreate(target_id=target.id, instrument="science_camera", value=3.0),
    )
    keep_out = create_keep_out(repo, PLANNER, mission.id, KeepOutCreate(polygon_m=[(1, 1), (2, 1), (2, 2)]))
    known = {
        "mission_id": mission.id,
        "target_id": target.id,
        "observation_request_id": asked.id,
        "keep_out_id": keep_out.id,
    }
    return Asked(build_app(repo, with_worker=False), known)


@pytest.fixture(scope="module")
def at_length(request: pytest.FixtureRequest) -> bool:
    """Whether what is slow is wanted: many questions, and PostgreSQL asked as well."""
    return "not slow" not in request.config.getoption("markexpr")


@pytest.fixture(scope="module")
def services(
    request: pytest.FixtureRequest,
    at_length: bool,
    sqlite_template: Path,
    terrain_folder: Path,
    tmp_path_factory: pytest.TempPathFactory,
) -> Iterator[list[Asked]]:
    """Give the service on each database."""
    folder = tmp_path_factory.mktemp("fuzz")
    shutil.copyfile(sqlite_template, folder / "outcrop.db")
    address = ""
    if at_length:
        with suppress(pytest.skip.Exception):  # no server here; in CI its absence is a failure
            server: PostgresServer = request.getfixturevalue("postgres")
            address = server.clone()
    repos = [open_repository(settings_for(folder))]
    if address:
        repos.append(open_repository(settings_for(tmp_path_factory.mktemp("fuzz"), address)))
    small = terrain.generate_terrain(7, 48.0)
    with (
        pytest.MonkeyPatch.context() as patch
    ):  # what a seed gives has its tests elsewhere, and takes seconds
        patch.setattr(jobs_answer, "MAX_WAIT_S", 0.5)  # of the 30 s of an example: there is no worker
        patch.setattr(terrain, "generate_terrain", lambda *_seed_and_size, **_options: small)
        yield [_service(repo, terrain_folder) for repo in repos]
    for repo in repos:
        repo.database.dispose()
    if address:
        server.drop(address)


@pytest.fixture(scope="module")
def document(services: list[Asked]) -> Any:
    """Give the document as schemathesis reads it."""
    loaded = schemathesis.openapi.from_asgi("/api/v1/openapi.json", services[0].app)
    # Made-up keys and sessions would be refused before anything else is asked.
    loaded.config.generation.with_security_parameters = False
    return loaded


@pytest.mark.parametrize(("method", "path"), OPERATIONS, ids=lambda value: value)
def test_every_answer_is_as_the_document_says(
    document: Any, services: list[Asked], at_length: bool, method: str, path: str
) -> None:
    """What is asked is made up once for all databases, which takes longer than the answers."""

    @settings(
        max_examples=25 if at_length else 3,
        deadline=None,
        derandomize=True,
        database=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(case=document[path][method].as_strategy(), real=booleans(), free=booleans())
    def ask(case: schemathesis.Case, real: bool, free: bool) -> None:
        if free and method in {"PATCH", "DELETE"}:
            case.headers = {**(case.headers or {}), "If-Match": "*"}
        if method == "DELETE" and real:
            return  # what the other operations are asked about stays
        for service in services:
            for name in case.path_parameters or {}:
                if (
                    real and name in service.known and not path.endswith("/events")
                ):  # a stream of what is there has no end
                    case.path_parameters[name] = service.known[name]
            # A panorama may be painted on a busy machine.
            judge(case, case.call(app=service.app, timeout=300.0))

    ask()


def judge(case: schemathesis.Case, response: schemathesis.Response) -> None:
    """Hold an answer to the document, and a refusal to the form of all refusals."""
    case.validate_response(response, checks=CHECKS)
    if response.status_code >= 400:
        assert response.headers["content-type"] == ["application/problem+json"]
        problem = response.json()
        assert problem["status"] == response.status_code
        assert problem["type"].startswith("urn:outcrop:problem:")
        assert problem["detail"]


def test_operation_ids_are_unique_and_every_operation_says_what_it_does() -> None:
    seen: set[str] = set()
    for path, operations in build_api().openapi()["paths"].items():
        for method, operation in operations.items():
            assert operation["operationId"] not in seen, (path, method)
            seen.add(operation["operationId"])
            assert operation["description"].endswith((".", ")")), (path, method)


def test_the_document_beside_the_code_is_the_interface() -> None:
    kept = (Path(ground.__file__).parent / "openapi.json").read_text(encoding="utf-8")
    assert kept == document_text(build_api().openapi()) + "\n", "outcrop openapi --out ground/openapi.json"


def test_a_problem_answer_is_stated_once() -> None:
    document = build_api().openapi()
    stated = document["components"]["responses"]
    problems = [answer for answer in stated.values() if "content" in answer]
    assert json.dumps(document).count('"application/problem+json"') == len(problems)
    used = {
        answer["$ref"].removeprefix("#/components/responses/")
        for path in document["paths"].values()
        for operation in path.values()
        for answer in operation["responses"].values()
        if "$ref" in answer
    }
    assert used == set(stated)
