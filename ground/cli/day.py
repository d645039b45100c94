"""Commands of a day that do more than one operation, or say more than its answer."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Annotated, Any

import typer

from ground.cli.connection import PERSON, SERVER, connected, follow, show, uploaded, written
from ground.cli.failure import fail, refusals
from ground.cli.forms.at import CRS, LONLAT, corners_of, reference_of
from ground.cli.resources import group_of
from ground.day.plan_summary import told_band


def register(app: typer.Typer) -> None:
    group_of(app, "target").command("check")(check_target)
    _sources(app)
    _plan(app)
    _run(app)
    _api(app)


def _sources(app: typer.Typer) -> None:
    @group_of(app, "mission").command("create")
    def create_mission(
        name: str = typer.Argument(...),
        terrain: Path | None = typer.Option(None, help="GeoTIFF, mesh, or zip of a terrain folder"),
        seed: int = typer.Option(0, min=0, help="seed of a generated terrain, without --terrain"),
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        """Open a mission on a terrain. Needs a server."""
        if terrain is not None and not terrain.is_file():
            fail(f"{terrain} is not a file; zip a terrain folder first")
        with connected(server, person) as client:
            source: dict[str, Any] = {"source": "generated", "seed": seed}
            if terrain is not None:
                source = {"source": "uploaded", "upload_id": uploaded(client, terrain)}
            typer.echo(client.create_mission(name=name, terrain=source).id)

    @group_of(app, "request").command("add")
    def add_request(
        mission: str = typer.Argument(...),
        target: str = typer.Argument(...),
        instrument: str = typer.Argument(..., help="one of the mission's rover"),
        value: float = typer.Argument(...),
        must_do: bool = typer.Option(False, "--must-do"),
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        """File an observation request and say whether it can be reached. Needs a server."""
        body: dict[str, Any] = {"target_id": target, "instrument": instrument, "value": value}
        with connected(server, person) as client:
            made = client.create_observation_request(mission, must_do=must_do, **body)
        typer.echo(made.id)
        if made.observation_point is not None and not made.observation_point.reachable:
            typer.echo(f"not reachable: {made.observation_point.reason}", err=True)

    @group_of(app, "keep-out").command("add")
    def add_keep_out(
        mission: str = typer.Argument(...),
        corners: list[str] = typer.Argument(..., help="EAST,NORTH for each corner, or X,Y with --crs"),
        crs: str | None = CRS,
        lonlat: bool = LONLAT,
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        """Draw a keep-out. Needs a server."""
        polygon, name = corners_of(corners), reference_of(crs, lonlat)
        with connected(server, person) as client:
            if name is None:
                typer.echo(client.create_keep_out(mission, polygon_m=polygon).id)
            else:
                typer.echo(client.create_keep_out(mission, at={"crs": name, "polygon": polygon}).id)

    @group_of(app, "product").command("get")
    def get_product(
        product: str = typer.Argument(...),
        out: Path | None = typer.Option(None, help="file; default its own name, here"),
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        """Fetch the file of a data product. Needs a server."""
        with connected(server, person) as client:
            target = out or Path(Path(client.get_product(product).file_name).name)
            target.write_bytes(client.get_product_file(product))
            typer.echo(str(target))


def _plan(app: typer.Typer) -> None:
    @app.command("make-plan")
    def make_plan(
        mission: str = typer.Argument(...),
        time_limit: float = typer.Option(20.0, help="seconds"),
        max_branches: int = typer.Option(8),
        seed: int = typer.Option(1),
        strategy: str = typer.Option("optimal", help="optimal or pico2005"),
        max_overrun: float | None = typer.Option(None, help="largest chance of ending over a budget"),
        crl: Path | None = typer.Option(None, help="write the CRL here"),
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        """Plan a mission's day on the server. Needs a server."""
        order: dict[str, Any] = {
            "time_limit_s": time_limit,
            "max_branches": max_branches,
            "seed": seed,
            "strategy": strategy,
            "max_overrun_probability": max_overrun,
        }
        with connected(server, person) as client:
            plan = client.get_plan(follow(client, client.create_plan(mission, **order)).subject_id)
            typer.echo(
                f"{plan.id}  {plan.status}  expected utility {plan.expected_utility or 0.0:.2f}, at most "
                f"{plan.upper or 0.0:.2f}, {plan.branches} branches, {len(plan.left_out)} requests left out"
            )
            if band := told_band(client.get_plan_summary(plan.id)):
                typer.echo(band)
            if crl is not None:
                crl.write_text(client.get_plan_crl(plan.id), encoding="utf-8")

    @group_of(app, "review").command("rules")
    def rules(plan: str = typer.Argument(...), server: str = SERVER, person: str | None = PERSON) -> None:
        """Check the flight rules against a plan; exit status 1 if one does not hold. Needs a server."""
        with connected(server, person) as client:
            found = client.get_flight_rules(plan)
        for rule in found:
            word = "holds" if rule.holds else "waived" if rule.waived_by else "BROKEN"
            typer.echo(f"{word:7} {rule.rule}  {rule.detail}")
        if any(not rule.holds and not rule.waived_by for rule in found):
            raise typer.Exit(1)


def _run(app: typer.Typer) -> None:
    @app.command("dry-run")
    def dry_run(
        mission: str = typer.Argument(...),
        plan: str = typer.Argument(...),
        rover: str = typer.Option("abstract"),
        seed: int = typer.Option(1),
        light_time: float | None = typer.Option(
            None, help="rehearsal in the passes of the sol: one-way light time, seconds"
        ),
        command: list[str] = typer.Option(
            [], help="what the operator sends and when: abort@S, pause@S or resume@S; repeatable"
        ),
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        """Run a plan on a simulated rover on the server. Needs a server."""
        from ground.uplink.rehearsal import Sent

        order: dict[str, Any] = {} if light_time is None else {"light_time_s": light_time}
        with refusals():
            sent = [Sent.parse(text) for text in command]
        order["commands"] = [{"operation": c.operation.value, "sent_s": c.sent_s} for c in sent]
        with connected(server, person) as client:
            job = client.create_run(mission, plan_id=plan, rover=rover, seed=seed, **order)
            run = client.get_run(follow(client, job).subject_id)
            typer.echo(
                f"{run.id}  {run.outcome}  utility {run.utility:g}  {run.duration_s or 0.0:.0f} s  "
                f"options {', '.join(run.options_taken) or 'none'}"
            )

    @group_of(app, "run").command("control")
    def control(
        run: str = typer.Argument(...),
        act: str = typer.Argument(..., help="pause, resume, step, abort, stop (live), or pace=SECONDS"),
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        """Hold, let go, step or abort a run that goes on. Needs a server."""
        wishes: dict[str, dict[str, Any]] = {
            "pause": {"paused": True},
            "resume": {"paused": False},
            "step": {"step": True},
            "abort": {"abort": True},
            "stop": {"stop": True},
        }
        name, _, text = act.partition("=")
        try:
            wish = {"pace": float(text)} if name == "pace" else wishes[act]
        except (KeyError, ValueError):
            fail(f"{act!r}: there are {', '.join(wishes)} and pace=SECONDS")
        with connected(server, person) as client:
            show(client.control_run(run, **wish))


def _api(app: typer.Typer) -> None:
    @app.command("api")
    def call_api(
        method: str = typer.Argument(..., help="GET, POST, PATCH or DELETE"),
        path: str = typer.Argument(..., help="such as /missions; see `outcrop openapi`"),
        body: str | None = typer.Option(None, "--json", help="body of the request"),
        out: Path | None = typer.Option(None, help="write the answer here"),
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        """Ask the REST interface for anything. Needs a server."""
        headers = {"If-Match": "*"} if method.upper() in {"PATCH", "DELETE"} else {}
        try:
            document = None if body is None else json.loads(body)
        except ValueError as err:
            fail(f"--json is not JSON: {err}")
        with connected(server, person) as client:
            url = "/" + path.removeprefix("/api/v1").lstrip("/")
            answer = client.request(method.upper(), url, json=document, headers=headers)
        if out is not None:
            written(out, answer.content)
        elif "json" in answer.headers.get("content-type", ""):
            show(answer.json())
        elif answer.content:
            typer.echo(answer.text)


def check_target(
    east: Annotated[float, typer.Argument(help="of the target, metres")],
    north: Annotated[float, typer.Argument(help="of the target, metres; after -- when negative")],
    terrain: Annotated[Path | None, typer.Option(help="terrain folder; generated if absent")] = None,
    seed: Annotated[int, typer.Option(help="of the generated terrain", min=0)] = 1,
    rover: Annotated[str, typer.Option(help="rover profile")] = "k9",
    instrument: Annotated[str, typer.Option(help="its usual contact instrument if absent")] = "",
    start: Annotated[
        tuple[float, float, float],
        typer.Option(help="the rover's stand: east, north, heading (degrees)"),
    ] = (0.0, 0.0, 0.0),
) -> None:
    """Say before a day how far, in sight, known and reachable a target is; status 0. Needs no server."""
    from ground.day.advice import target_advice
    from ground.demo.mission import target_at
    from mission import Pose
    from rover_iface.profile import load_profile
    from rover_iface.terrain import generate_terrain, load_terrain

    with refusals():
        ground = load_terrain(terrain) if terrain else generate_terrain(seed, ortho=False)
        ground.require_inside(east, north, "target")
        profile = load_profile(rover)
        target = target_at(ground, "T", "T", east, north)
        here = Pose(start[0], start[1], math.radians(start[2]))
        advice = target_advice(ground, profile, here, target, instrument=instrument)
    for line in advice.lines():
        typer.echo(line)
