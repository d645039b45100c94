"""What the browser can do the command line can: each operation has its command, and they do what they say."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import httpx
import pytest
import typer
import uvicorn
from typer.testing import CliRunner

from ground.app.api import build_api
from ground.app.service import build_app
from ground.cli.main import app, register_all
from ground.gdr.repository import Repository
from tests.ground.conftest import yard

FOR_SCRIPTS = "api"
"""Operations that make pictures in the browser, or concern its session: `outcrop api` asks for them."""

COMMANDS = {
    **{
        f"{verb}_{kind}": f"{group} {word}"
        for kind, group, verbs in (
            ("target", "target", "get change delete"),
            ("mission", "mission", "get change delete"),
            ("sol", "sol", "get change delete"),
            ("observation_request", "request", "get change delete"),
            ("keep_out", "keep-out", "get change delete"),
            ("comment", "comment", "get change delete"),
            ("plan", "review", "get change delete"),
            ("run", "run", "get change"),
            ("path_network", "network", "get"),
            ("problem", "problem", "get"),
            ("product", "product", "get"),
            ("job", "job", "get"),
            ("person", "person", "get change"),
            ("frame", "frame", "get change"),
            ("solution", "solution", "get change"),
            ("site_map", "site-map", "get change delete"),
            ("traverse", "traverse", "get change delete"),
        )
        for verb, word in (("get", "show"), ("change", "set"), ("delete", "delete"))
        if verb in verbs.split()
    },
    **{
        f"list_{kind}": f"{group} list"
        for kind, group in (
            ("targets", "target"),
            ("missions", "mission"),
            ("sols", "sol"),
            ("observation_requests", "request"),
            ("keep_outs", "keep-out"),
            ("comments", "comment"),
            ("plans", "review"),
            ("runs", "run"),
            ("path_networks", "network"),
            ("problems", "problem"),
            ("products", "product"),
            ("jobs", "job"),
            ("people", "person"),
            ("approvals", "approval"),
            ("history", "history"),
            ("frames", "frame"),
            ("solutions", "solution"),
            ("site_maps", "site-map"),
            ("traverses", "traverse"),
        )
    },
    "create_frame": "frame add",
    "list_frame_files": "frame files",
    "import_frames": "frame import",
    "export_frames": "frame export",
    "choose_solution": "frame use",
    "create_solution": "solution add",
    "create_site_map": "site-map add",
    "get_site_map_file": "site-map get",
    "create_traverse": "traverse adjust",
    "get_traverse_picture": "traverse picture",
    "create_target": "target add",
    "create_mission": "mission create",
    "copy_mission": "mission copy",
    "create_sol": "sol add",
    "create_observation_request": "request add",
    "create_keep_out": "keep-out add",
    "create_comment": "comment add",
    "create_path_network": "network make",
    "create_plan": "make-plan",
    "create_run": "dry-run",
    "create_person": "person add",
    "create_upload": "exchange import-geometry",
    "get_target_lineage": "target lineage",
    "get_observation_request_lineage": "request lineage",
    "get_product_lineage": "product lineage",
    "get_product_file": "product get",
    "get_run_product_file": "product get",
    "calibrate_mission": "mission calibrate",
    "export_mission": "mission export",
    "import_mission": "mission import",
    "export_geometry": "exchange export-geometry",
    "import_geometry": "exchange import-geometry",
    "draw_plan": "exchange draw-plan",
    "export_products": "exchange products",
    "get_run_report": "exchange report",
    "get_plan_report": "review report",
    "get_plan_tree": "review file",
    "get_plan_crl": "review file",
    "get_plan_summary": "review summary",
    "get_plan_findings": "review findings",
    "explain_request": "review why-not",
    "compare_plans": "review compare",
    "answer_what_if": "review what-if",
    "get_flight_rules": "review rules",
    "create_waiver": "review waive",
    "approve_plan": "review approve",
    "package_plan": "package",
    "ingest_run": "ingest",
    "control_run": "run control",
    "get_run_trace": "run file",
    "get_run_telemetry": "run file",
    "get_run_snapshot": "run file",
    "cancel_job": "job cancel",
    "retry_job": "job retry",
    "undo": "history undo",
    "redo": "history redo",
}


def commands(group: typer.Typer, before: str = "") -> Iterator[tuple[str, str]]:
    for command in group.registered_commands:
        name = command.name or (command.callback.__name__.replace("_", "-") if command.callback else "")
        about = command.help or (command.callback.__doc__ if command.callback else "") or ""
        yield f"{before}{name}", about
    for inner in group.registered_groups:
        assert inner.typer_instance is not None
        yield from commands(inner.typer_instance, f"{before}{inner.name} ")


@pytest.fixture(scope="module")
def program() -> typer.Typer:
    if not app.registered_groups:
        register_all()
    return app


def test_every_operation_of_the_interface_has_a_command(program: typer.Typer) -> None:
    known = dict(commands(program))
    assert FOR_SCRIPTS in known
    assert {c for c in COMMANDS.values() if c not in known} == set()
    operations = {
        o["operationId"]
        for path, ways in build_api().openapi()["paths"].items()
        for o in ways.values()
        if path.startswith("/api/")
    }
    assert set(COMMANDS) <= operations
    rest = operations - set(COMMANDS)
    pictures = ("terrain", "ortho", "heights", "coverage", "panorama", "view", "rover", "stand", "site")
    others = {"get_session", "create_session", "delete_session", "create_api_key", "delete_api_key"}
    strange = {o for o in rest - others if not o.startswith("stream_") and not any(p in o for p in pictures)}
    assert strange == set()


def test_every_command_about_resources_says_that_it_needs_a_server(program: typer.Typer) -> None:
    silent = [
        name
        for name, about in commands(program)
        if name.split()[0]
        in {
            "mission",
            "sol",
            "target",
            "request",
            "keep-out",
            "comment",
            "review",
            "run",
            "network",
            "problem",
        }
        | {"frame", "solution", "site-map", "traverse"}
        | {"product", "job", "approval", "history", "person", "exchange", "api", "make-plan", "dry-run"}
        and "Needs a server." not in about
        and "Needs no server." not in about
    ]
    assert silent == []


@pytest.fixture
def server(sqlite_repo: Repository) -> Iterator[str]:
    """Serve a repository over a socket; give the address."""
    config = uvicorn.Config(build_app(sqlite_repo, with_worker=False), port=0, log_level="error")
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
    assert "look at this" in run("comment", "list", mission, "--where", f"subject_id={target}")
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
    listed = run("solution", "list", mission, "--where", f"frame_id={two}").splitlines()
    assert [line.split("  ")[1:3] for line in listed] == [["telemetry", "False"], ["ground", "True"]]
    assert "is not 3 numbers" in run("solution", "add", two, frames["[1]"], "2.5,3", code=2)
