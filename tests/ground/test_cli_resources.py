"""What the browser can do the command line can: each operation has its command, and they do what they say."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import httpx
import pytest
import typer
import uvicorn
from typer.testing import CliRunner

from ground.app.api import build_api
from ground.app.service import build_app
from ground.cli.main import app, register_all
from ground.cli.resources import BY_HAND, generated, place_of
from ground.client.interface import operations
from ground.gdr.repository import Repository
from tests.ground.conftest import yard

FOR_MACHINES = {"healthz", "readyz", "metrics"}


def commands(program: typer.Typer) -> dict[str, str]:
    """Return what each command of the program says of itself, by its whole name."""
    top = typer.main.get_command(program)
    found = {}
    ctx = top.make_context("outcrop", ["--version"], resilient_parsing=True)
    for name in top.list_commands(ctx):  # type: ignore[attr-defined]
        group = top.get_command(ctx, name)  # type: ignore[attr-defined]
        inner = getattr(group, "list_commands", None)
        if inner is None:
            found[name] = group.help or ""
            continue
        for word in inner(ctx):
            found[f"{name} {word}"] = group.get_command(ctx, word).help or ""
    return found


@pytest.fixture(scope="module")
def program() -> typer.Typer:
    if not app.registered_groups:
        register_all()
    return app


def test_every_operation_of_the_interface_has_a_command(program: typer.Typer) -> None:
    known = commands(program)
    made = {o.name: f"{group} {word}" for group, found in generated().items() for word, o in found.items()}
    asked = {
        o["operationId"] for ways in build_api().openapi()["paths"].values() for o in ways.values()
    } - FOR_MACHINES
    assert asked == {*made, *BY_HAND}
    assert {name for name in (made | BY_HAND).values() if name not in known} == set()


def test_each_command_asks_one_operation(program: typer.Typer) -> None:
    places = [place_of(operation) for operation in operations().values() if operation.name not in BY_HAND]
    assert len(places) == len(set(places))


def test_every_command_about_resources_says_that_it_needs_a_server(program: typer.Typer) -> None:
    groups = {"api", "make-plan", "dry-run", *generated()}
    silent = [
        name
        for name, about in commands(program).items()
        if name.split()[0] in groups and "Needs a server." not in about and "Needs no server." not in about
    ]
    assert silent == []


@contextmanager
def serving(repo: Repository) -> Iterator[str]:
    """Serve a repository over a socket; give the address."""
    config = uvicorn.Config(build_app(repo, with_worker=False), port=0, log_level="error")
    running = uvicorn.Server(config)
    thread = threading.Thread(target=running.run, daemon=True)
    thread.start()
    while not running.started:
        assert thread.is_alive()
        time.sleep(0.01)
    port = running.servers[0].sockets[0].getsockname()[1]
    yield f"http://127.0.0.1:{port}"
    running.should_exit = True
    thread.join(20.0)


@pytest.fixture
def server(sqlite_repo: Repository) -> Iterator[str]:
    settings = sqlite_repo.settings.model_copy(update={"webhook_hosts": "hooks.example"})
    with serving(replace(sqlite_repo, settings=settings)) as address:
        yield address


@pytest.fixture
def run(program: typer.Typer, server: str) -> Callable[..., str]:
    def invoke(*words: str, code: int = 0, who: str = "Planner") -> str:
        result = CliRunner().invoke(
            program, list(words), env={"OUTCROP_SERVER": server, "OUTCROP_PERSON": who}
        )
        assert result.exit_code == code, (words, result.output, result.exception)
        return result.output.strip()

    return invoke


def test_a_mission_is_worked_on_from_the_command_line(
    run: Callable[..., str], server: str, sqlite_repo: Repository, terrain_folder: Path, tmp_path: Path
) -> None:
    mission = yard(sqlite_repo, terrain_folder).id
    target = run("target", "add", mission, "4.0", "1.0", "--name", "Rock").split()[0]
    assert run("target", "set", target, "notes=dusty", "name=Crag") == f"{target} revision 2"
    assert json.loads(run("target", "show", target))["notes"] == "dusty"
    assert "is at revision 2" in run("target", "set", target, "notes=x", "--revision", "1", code=2)
    request = run("request", "add", mission, target, "science_camera", "5").splitlines()[0]
    run("request", "set", request, "value=7.5")
    assert "value 7.5" in run("request", "list", mission)
    assert json.loads(run("request", "lineage", request))["nodes"]
    keep_out = run("keep-out", "add", mission, "6,6", "8,6", "8,8")
    run("keep-out", "set", keep_out, "name=Ditch")
    assert "Ditch" in run("keep-out", "list", mission)
    run("keep-out", "delete", keep_out)
    assert run("keep-out", "list", mission) == ""
    assert run("history", "undo", mission).endswith(keep_out)
    assert "Ditch" in run("keep-out", "list", mission)
    assert "delete keep_out" not in run("history", "redo", mission)
    comment = run(
        "comment", "add", mission, "subject_kind=target", f"subject_id={target}", "text=look at this"
    )
    assert "look at this" in run("comment", "list", mission, "--subject-id", target)
    run("comment", "delete", comment)
    sol = run("sol", "add", mission, "number=2")
    assert json.loads(run("sol", "show", sol))["number"] == 2
    assert run("sol", "set", sol, "battery_j=1000.0") == f"{sol} revision 2"
    assert "Scientist" in run("person", "list")
    assert "may not" in run("target", "delete", target, code=2, who="Viewer")
    assert f"create  target {target}" in run("history", "list", mission)
    assert json.loads(run("api", "GET", f"/missions/{mission}/terrain"))["bounds_m"]
    run("api", "GET", f"/missions/{mission}/terrain/heights?max_posts=16", "--out", str(tmp_path / "h.bin"))
    assert (tmp_path / "h.bin").stat().st_size > 0
    assert "name=value" in run("target", "set", target, "notes", code=2)
    assert httpx.get(f"{server}/healthz").status_code == 200


def test_a_secret_is_shown_where_it_is_made(
    run: Callable[..., str], sqlite_repo: Repository, terrain_folder: Path
) -> None:
    key, secret = run("api-key", "add", "nightly", "--role", "viewer", "--days", "30").split()
    assert secret.startswith("oc_")
    assert key in run("api-key", "list")
    assert secret not in run("api-key", "list")
    mission = yard(sqlite_repo, terrain_folder).id
    hook, first = run("webhook", "add", mission, "name=lab", "url=https://hooks.example/outcrop").split()
    same, second = run("webhook", "secret", hook).split()
    assert same == hook
    assert first.startswith("whsec_")
    assert second.startswith("whsec_")
    assert first != second


def test_deliveries_of_a_webhook_are_a_line_each(
    run: Callable[..., str], sqlite_repo: Repository, terrain_folder: Path
) -> None:
    mission = yard(sqlite_repo, terrain_folder).id
    hook = run("webhook", "add", mission, "name=lab", "url=https://hooks.example/outcrop").split()[0]
    assert run("webhook", "deliveries", hook) == ""
    event = run("history", "list", mission).split()[0]
    run("webhook", "redeliver", hook, event)
    line = run("webhook", "deliveries", hook)
    assert line.split()[0] == event
    assert line.endswith("0 tries  asked for by Planner")


def test_a_site_chain_is_imported_solved_anew_and_exported(
    run: Callable[..., str], sqlite_repo: Repository, terrain_folder: Path, tmp_path: Path
) -> None:
    from rover_iface.localization.site_frames import parse_frame_file, print_frame_file
    from tests.ground.test_site_chain import chain_file

    mission = yard(sqlite_repo, terrain_folder).id
    source, out = tmp_path / "chain.svf", tmp_path / "out.svf"
    source.write_text(print_frame_file(chain_file()))
    assert "5 solutions, 0 known before" in run("frame", "import", mission, str(source))
    assert "chain.svf  5 new" in run("frame", "files", mission)
    run("frame", "export", mission, str(out))
    assert parse_frame_file(out.read_bytes()) == chain_file()
    frames = {line.split("  ")[2]: line.split("  ")[0] for line in run("frame", "list", mission).splitlines()}
    two = frames["[2]"]
    target = run("target", "add", mission, "4.0", "1.0", "--name", "Rock").split()[0]
    run("target", "set", target, f"frame_id={two}")
    made = run("solution", "add", two, frames["[1]"], "2.5,3,0.1", "--sigma", "0,0,0.01,0.3,0.2,0.1")
    assert "moved 0.500 m" in run("frame", "use", two, made, "--preview")
    assert "Rock  moved 0.500 m, deviation" in run("frame", "use", two, made, "--reason", "better")
    assert "no solution in use ties" in run("frame", "use", two, "none", code=2)
    listed = run("solution", "list", mission, "--frame-id", two).splitlines()
    assert [line.split("  ")[1:3] for line in listed] == [["telemetry", "False"], ["ground", "True"]]
    assert "is not 3 numbers" in run("solution", "add", two, frames["[1]"], "2.5,3", code=2)
