"""`outcrop mission|target|request|keep-out|make-plan|dry-run|product`: what the browser does."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from ground.cli.failure import fail
from ground.resources.keep_outs.value import KeepOut
from ground.resources.missions.value import Mission
from ground.resources.observation_requests.value import ObservationRequest
from ground.resources.plans.value import Plan
from ground.resources.products.value import Product
from ground.resources.runs.value import Run
from ground.resources.targets.value import Target

if TYPE_CHECKING:
    from ground.client.rest import Client
    from ground.jobs.value import Job

SERVER = typer.Option(
    "http://127.0.0.1:8000", "--server", envvar="OUTCROP_SERVER", help="address of the server"
)
PERSON = typer.Option(None, "--as", envvar="OUTCROP_PERSON", help="local profile to work as")


@contextmanager
def connected(server: str, person: str | None) -> Iterator[Client]:
    """Give a client; its errors end the program with one line."""
    import os

    from ground.client.rest import ApiError, Client, ServerUnreachableError

    with Client(server, person=person, api_key=os.environ.get("OUTCROP_API_KEY")) as client:
        try:
            yield client
        except ServerUnreachableError as err:
            fail(f"{err}; start one with `outcrop serve`")
        except ApiError as err:
            fail(str(err))


def group_of(app: typer.Typer, name: str, about: str) -> typer.Typer:
    """Return the group of commands with a name; it is made if there is none."""
    for known in app.registered_groups:
        if known.name == name and known.typer_instance is not None:
            return known.typer_instance
    group = typer.Typer(help=about, no_args_is_help=True)
    app.add_typer(group, name=name)
    return group


def follow(client: Client, job: Job) -> Job:
    """Print the job's progress on stderr and return it when it is over; end the program if it failed."""
    from ground.jobs.value import JobState

    last = job
    for last in client.wait(job):
        typer.echo(f"{last.progress:5.0%} {last.message}", err=True)
    if last.state is not JobState.SUCCEEDED:
        fail((last.problem or {}).get("detail", last.state.value), 1)
    return last


def register(app: typer.Typer) -> None:
    _missions(app)
    _targets(app)
    _requests(app)
    _keep_outs(app)
    _work(app)
    _products(app)


def _missions(app: typer.Typer) -> None:
    group = group_of(app, "mission", "Missions.")

    @group.command("list")
    def list_missions(server: str = SERVER, person: str | None = PERSON) -> None:
        """List missions. Needs a server."""
        with connected(server, person) as client:
            for mission in client.each(Mission):
                count = mission.counts
                typer.echo(
                    f"{mission.id}  {mission.name}  {count.targets} targets, "
                    f"{count.observation_requests} requests, {count.plans} plans, {count.products} products"
                )

    @group.command("create")
    def create(
        name: str = typer.Argument(...),
        terrain: Path | None = typer.Option(None, help="GeoTIFF, mesh, or zip of a terrain folder"),
        seed: int = typer.Option(0, min=0, help="seed of a generated terrain, without --terrain"),
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        """Open a mission on a terrain. Needs a server."""
        if terrain is not None and not terrain.is_file():
            fail(f"{terrain} is no file; zip a terrain folder first")
        with connected(server, person) as client:
            source: dict[str, Any] = {"source": "generated", "seed": seed}
            if terrain is not None:
                source = {"source": "uploaded", "upload_id": client.upload(terrain).id}
            typer.echo(client.create(Mission, {"name": name, "terrain": source}).id)

    @group.command("copy")
    def copy(
        mission: str = typer.Argument(...),
        name: str = typer.Argument(...),
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        """Copy a mission: a what-if of its own. Needs a server."""
        with connected(server, person) as client:
            made = client.request("POST", f"/missions/{mission}/copy", json={"name": name}).json()
            typer.echo(made["id"])


def _targets(app: typer.Typer) -> None:
    group = group_of(app, "target", "Targets.")

    @group.command("add")
    def add(
        mission: str = typer.Argument(...),
        east: float = typer.Argument(..., help="metres east"),
        north: float = typer.Argument(..., help="metres north"),
        name: str | None = typer.Option(None),
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        """Pick a target. Needs a server."""
        body: dict[str, Any] = {"east_m": east, "north_m": north}
        if name is not None:
            body["name"] = name
        with connected(server, person) as client:
            target = client.create(Target, body, mission)
            typer.echo(f"{target.id}  {target.name}  up {target.position.up_m:.3f} m")

    @group.command("list")
    def list_targets(
        mission: str = typer.Argument(...), server: str = SERVER, person: str | None = PERSON
    ) -> None:
        """List targets. Needs a server."""
        with connected(server, person) as client:
            for target in client.each(Target, mission):
                p = target.position
                typer.echo(f"{target.id}  {target.name}  {p.east_m:.2f} {p.north_m:.2f} {p.up_m:.2f}")

    _common(group, "target", Target)


def _requests(app: typer.Typer) -> None:
    group = group_of(app, "request", "Observation requests.")

    @group.command("add")
    def add(
        mission: str = typer.Argument(...),
        target: str = typer.Argument(...),
        instrument: str = typer.Argument(..., help="microscopic_imager or science_camera"),
        value: float = typer.Argument(...),
        must_do: bool = typer.Option(False, "--must-do"),
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        """File an observation request. Needs a server."""
        body = {"target_id": target, "instrument": instrument, "value": value, "must_do": must_do}
        with connected(server, person) as client:
            made = client.create(ObservationRequest, body, mission)
            point = made.observation_point
            typer.echo(made.id)
            if point is not None and not point.reachable:
                typer.echo(f"not reachable: {point.reason}", err=True)

    @group.command("list")
    def list_requests(
        mission: str = typer.Argument(...), server: str = SERVER, person: str | None = PERSON
    ) -> None:
        """List observation requests. Needs a server."""
        with connected(server, person) as client:
            for request in client.each(ObservationRequest, mission):
                typer.echo(
                    f"{request.id}  {request.target_name}  {request.instrument.value}  "
                    f"value {request.value:g}  {request.state.value}  {request.state_reason}"
                )

    _common(group, "observation request", ObservationRequest)


def _keep_outs(app: typer.Typer) -> None:
    group = group_of(app, "keep-out", "Keep-outs.")

    @group.command("add")
    def add(
        mission: str = typer.Argument(...),
        corners: list[str] = typer.Argument(..., help="EAST,NORTH for each corner"),
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        """Draw a keep-out. Needs a server."""
        try:
            polygon = [[float(part) for part in corner.split(",")] for corner in corners]
        except ValueError:
            fail("a corner is EAST,NORTH in metres, such as 1.5,-2")
        with connected(server, person) as client:
            typer.echo(client.create(KeepOut, {"polygon_m": polygon}, mission).id)

    _common(group, "keep-out", KeepOut)


def _common(group: typer.Typer, title: str, kind: type) -> None:
    @group.command("delete", help=f"Delete a {title}. Needs a server.")
    def delete(
        identifier: str = typer.Argument(...), server: str = SERVER, person: str | None = PERSON
    ) -> None:
        with connected(server, person) as client:
            client.delete(kind, identifier)


def _work(app: typer.Typer) -> None:
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
        with connected(server, person) as client:
            order = {
                "time_limit_s": time_limit,
                "max_branches": max_branches,
                "seed": seed,
                "strategy": strategy,
                "max_overrun_probability": max_overrun,
            }
            job = follow(client, client.plan(mission, **order))
            plan = client.get(Plan, job.subject_id)
            typer.echo(
                f"{plan.id}  {plan.status}  expected utility {plan.expected_utility or 0.0:.2f}, at most "
                f"{plan.upper or 0.0:.2f}, {plan.branches} branches, {len(plan.left_out)} requests left out"
            )
            if crl is not None:
                crl.write_text(client.crl(plan.id), encoding="utf-8")

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
        from ground.errors import GroundError
        from ground.uplink.rehearsal import Sent

        link: dict[str, Any] = {} if light_time is None else {"light_time_s": light_time}
        try:
            sent = [Sent.parse(text) for text in command]
        except GroundError as err:
            fail(err.message)
        link["commands"] = [{"operation": c.operation.value, "sent_s": c.sent_s} for c in sent]
        with connected(server, person) as client:
            job = follow(client, client.run(mission, plan, rover=rover, seed=seed, **link))
            run = client.get(Run, job.subject_id)
            typer.echo(
                f"{run.id}  {run.outcome}  utility {run.utility:g}  {run.duration_s or 0.0:.0f} s  "
                f"options {', '.join(run.options_taken) or 'none'}"
            )


def _products(app: typer.Typer) -> None:
    group = group_of(app, "product", "Data products.")

    @group.command("list")
    def list_products(
        mission: str = typer.Argument(...),
        orphans: bool = typer.Option(False, "--orphans", help="only those that match no request"),
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        """List data products. Needs a server."""
        where = {"orphan": "true"} if orphans else {}
        with connected(server, person) as client:
            for product in client.each(Product, mission, **where):
                typer.echo(
                    f"{product.id}  {product.file_name}  request {product.request_id or '-'}  "
                    f"run {product.run_id}"
                )

    @group.command("get")
    def get_product(
        product: str = typer.Argument(...),
        out: Path | None = typer.Option(None, help="file; default its own name, here"),
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        """Fetch the file of a data product. Needs a server."""
        with connected(server, person) as client:
            found = client.get(Product, product)
            target = out or Path(Path(found.file_name).name)
            target.write_bytes(client.product_file(product))
            typer.echo(str(target))


def fetch(url: str, out: Path, server: str, person: str | None) -> None:
    """Write what the server has at an address into a file."""
    with connected(server, person) as client:
        content = client.request("GET", url).content
    try:
        out.write_bytes(content)
    except OSError as err:
        fail(f"{out} cannot be written: {err.strerror}")
    typer.echo(f"{out}: {len(content)} bytes")
