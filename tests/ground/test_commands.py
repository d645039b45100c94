"""The commands end with one line and a stable exit status, and the docs name everything there is."""

from __future__ import annotations

import json
import os
import re
import socket
import sqlite3
import subprocess
import sys
import time
from contextlib import closing
from http.client import HTTPConnection
from pathlib import Path

import pytest
from sqlalchemy import text

from ground.api.problems import STATUS
from ground.app.api import build_api
from ground.cli.admin import register as register_admin
from ground.cli.serve import register as register_serve
from ground.errors import GroundError
from ground.gdr.repository import Repository
from ground.settings import Settings

ROOT = Path(__file__).resolve().parents[2]


def outcrop(*arguments: str, data_dir: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "ground.cli", *arguments],
        cwd=ROOT,
        env={**os.environ, "OUTCROP_DATA_DIR": str(data_dir), **environment},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


def test_a_second_server_on_the_same_port_ends_with_one_line(sqlite_repo: Repository) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = str(taken.getsockname()[1])
        ended = outcrop("serve", "--port", port, data_dir=sqlite_repo.data_dir)
    assert ended.returncode == 2
    assert ended.stderr.strip() == (
        f"outcrop: cannot listen on 127.0.0.1 port {port}: Address already in use; choose another --port"
    )


def test_a_connection_that_was_idle_longer_than_clients_keep_theirs_is_still_good(
    sqlite_repo: Repository,
) -> None:
    environment = {**os.environ, "OUTCROP_DATA_DIR": str(sqlite_repo.data_dir), "PYTHONUNBUFFERED": "1"}
    order = [sys.executable, "-m", "ground.cli", "serve", "--no-worker", "--port", "0"]
    with subprocess.Popen(order, env=environment, stdout=subprocess.PIPE, text=True) as server:
        try:
            assert server.stdout is not None
            address = next(line for line in server.stdout if "Outcrop is at" in line)
            connection = HTTPConnection("127.0.0.1", int(address.split(":")[2].split("/")[0]), timeout=60.0)
            connection.connect()
            kept = connection.sock
            for idle_s in (0.0, 6.0):
                time.sleep(idle_s)
                connection.request("GET", "/healthz")
                assert connection.getresponse().read()
                assert connection.sock is kept
        finally:
            server.terminate()


@pytest.mark.parametrize("revision", ["none", "0003"])
def test_a_database_that_is_not_migrated_says_what_to_do(tmp_path: Path, revision: str) -> None:
    with closing(sqlite3.connect(tmp_path / "outcrop.db")) as database, database:
        database.execute("CREATE TABLE alembic_version (version_num VARCHAR(32) NOT NULL)")
        if revision != "none":
            database.execute("INSERT INTO alembic_version VALUES (?)", [revision])
    ended = outcrop("serve", "--port", "0", data_dir=tmp_path)
    assert (ended.returncode, "run `outcrop migrate`" in ended.stderr) == (2, True)
    with closing(sqlite3.connect(tmp_path / "outcrop.db")) as database:
        tables = database.execute("SELECT name FROM sqlite_master").fetchall()
    assert tables == [("alembic_version",)], "a database that holds something was changed"


def test_an_empty_folder_is_all_that_a_server_needs(tmp_path: Path) -> None:
    environment = {**os.environ, "OUTCROP_DATA_DIR": str(tmp_path), "PYTHONUNBUFFERED": "1"}
    environment.pop("OUTCROP_DATABASE_URL", None)
    order = [sys.executable, "-m", "ground.cli", "serve", "--no-worker", "--port", "0"]
    with subprocess.Popen(order, env=environment, stdout=subprocess.PIPE, text=True) as server:
        try:
            assert server.stdout is not None
            address = next(line for line in server.stdout if "Outcrop is at" in line)
            connection = HTTPConnection("127.0.0.1", int(address.split(":")[2].split("/")[0]), timeout=60.0)
            connection.request("GET", "/api/v1/missions")
            assert json.loads(connection.getresponse().read())["items"] == []
        finally:
            server.terminate()


def test_a_wrong_setting_names_itself(tmp_path: Path) -> None:
    ended = outcrop("migrate", data_dir=tmp_path, OUTCROP_WORKERS="many")
    assert ended.returncode == 2
    assert ended.stderr.startswith("outcrop: OUTCROP_WORKERS='many': ")
    assert "Traceback" not in ended.stderr


def test_a_changed_history_fails_the_audit(sqlite_repo: Repository) -> None:
    assert outcrop("audit", "verify", data_dir=sqlite_repo.data_dir).returncode == 0
    with sqlite_repo.database.write() as session:
        session.execute(text("UPDATE events SET actor = 'Nobody' WHERE seq = 1"))
    ended = outcrop("audit", "verify", data_dir=sqlite_repo.data_dir)
    assert ended.returncode == 1
    assert "system event 1: content does not match its hash" in ended.stderr


def test_the_description_of_the_api_needs_no_server(tmp_path: Path) -> None:
    ended = outcrop("openapi", "--out", str(tmp_path / "openapi.json"), data_dir=tmp_path / "none")
    assert ended.returncode == 0
    assert json.loads((tmp_path / "openapi.json").read_text())["openapi"] == "3.1.0"
    assert not (tmp_path / "none").exists()


def test_what_is_no_package_is_refused_with_the_reason(tmp_path: Path) -> None:
    for name in ("package.zip", "trust.json"):
        (tmp_path / name).write_bytes(b"nothing")
    place = [
        "--world",
        str(tmp_path),
        "--trust",
        str(tmp_path / "trust.json"),
        "--out",
        str(tmp_path / "run"),
    ]
    ended = outcrop("execute", str(tmp_path / "package.zip"), *place, data_dir=tmp_path)
    assert ended.returncode == 2
    assert "the package is damaged" in ended.stderr
    assert ended.stderr.count("\n") == 1


def test_every_endpoint_has_an_entry_in_the_docs() -> None:
    page = (ROOT / "docs" / "reference" / "rest.md").read_text(encoding="utf-8")
    for path, operations in build_api().openapi()["paths"].items():
        for method in operations:
            assert f"`{method.upper()} {path}`" in page


def test_every_problem_type_is_named_in_the_docs() -> None:
    page = (ROOT / "docs" / "reference" / "rest.md").read_text(encoding="utf-8")
    for _, kind, _ in STATUS.values():
        assert f"`{kind}`" in page


def test_every_setting_is_named_in_the_docs() -> None:
    page = (ROOT / "docs" / "reference" / "settings.md").read_text(encoding="utf-8")
    for name in Settings.model_fields:
        assert f"`OUTCROP_{name.upper()}`" in page


def test_defaults_of_settings_stand_in_the_docs() -> None:
    page = (ROOT / "docs" / "reference" / "settings.md").read_text(encoding="utf-8")
    rows = [line.split("|")[1:3] for line in page.splitlines() if line.startswith("| `OUTCROP_")]
    told = {
        name: default
        for row in rows
        for name, default in zip(
            re.findall(r"`(\w+)`", row[0]), re.findall(r"`([^`]+)`", row[1]), strict=False
        )
    }
    assert len(told) > 15
    for name, default in told.items():
        field = Settings.model_fields[name.removeprefix("OUTCROP_").lower()]
        shown = f"{field.default:g}" if isinstance(field.default, float) else str(field.default)
        assert default.lower() == shown.lower(), name


def test_every_error_class_has_a_status() -> None:
    def every(kind: type[GroundError]) -> set[type[GroundError]]:
        return {kind}.union(*(every(k) for k in kind.__subclasses__()))

    from ground import errors

    own = {k for k in every(GroundError) if k.__module__ == errors.__name__} - {GroundError}
    assert own == set(STATUS)


def test_help_says_which_commands_need_a_server() -> None:
    import typer

    app = typer.Typer()
    register_serve(app)
    register_admin(app)
    for command in app.registered_commands:
        assert command.callback is not None
        assert re.search(r"Needs (no|a) server|Is the server", command.callback.__doc__ or "")


@pytest.mark.parametrize("field", ["job_lease_s", "max_body_mib"])
def test_settings_have_limits(field: str, tmp_path: Path) -> None:
    ended = outcrop("migrate", data_dir=tmp_path, **{f"OUTCROP_{field.upper()}": "-1"})
    assert ended.returncode == 2
    assert f"OUTCROP_{field.upper()}='-1'" in ended.stderr
