"""`outcrop package`, `execute`, `ingest`: uplink and downlink."""

from __future__ import annotations

from pathlib import Path

import typer

from ground.cli.failure import fail, refusals


def register(app: typer.Typer) -> None:
    @app.command("package")
    def package(
        plan: str = typer.Argument(..., help="id of an approved plan"),
        out: Path | None = typer.Option(None, help="file; default its own name, here"),
        actor: str = typer.Option("Operator", "--as", help="who does it"),
    ) -> None:
        """Make the signed uplink package of an approved plan. Needs no server."""
        from ground.cli.repository import actor_or_fail, open_or_fail
        from ground.errors import GroundError
        from ground.resources.packages.package_plan import package_plan

        repo = open_or_fail()
        try:
            made = package_plan(repo, actor_or_fail(repo, actor), plan)
        except GroundError as err:
            fail(err.message)
        target = out or Path(made.file_name)
        target.write_bytes(made.content)
        typer.echo(f"{target}  sequence {made.sequence}  sha256 {made.sha256}")

    @app.command("execute")
    def execute(
        package: Path = typer.Argument(..., help="an uplink package"),
        rover: str = typer.Option("abstract", help="name of an installed rover"),
        world: Path = typer.Option(..., help="folder of the rover's world"),
        trust: Path = typer.Option(..., help="trust file: whose signatures count"),
        out: Path = typer.Option(..., help="new folder for the run"),
        seed: int | None = typer.Option(None, min=0, help="seed of a simulated rover"),
        resume: bool = typer.Option(
            False, "--resume", help="go on with a run in --out whose process died (simulated rovers)"
        ),
        light_time: float | None = typer.Option(None, help="rehearsal: one-way light time, seconds"),
        passes: Path | None = typer.Option(
            None, help="rehearsal: JSON of communication passes, or of a sol (`outcrop sol show`)"
        ),
        command: list[str] = typer.Option(
            [], help="rehearsal: what the operator sends and when, abort@S, pause@S or resume@S; repeatable"
        ),
    ) -> None:
        """Execute a package on a rover. Needs no server, database or network.

        Exit status 0: the plan succeeded, 1: it ended otherwise, 2: the package was refused.
        """
        from ground.uplink.execute import Place, execute_package
        from ground.uplink.link import Link, read_passes
        from ground.uplink.rehearsal import Sent

        with refusals():
            link = None
            if light_time is not None or passes is not None:
                link = Link(light_time or 0.0, () if passes is None else read_passes(passes))
            checked, flight = execute_package(
                package,
                Place(rover, world, trust, seed),
                out,
                resume=resume,
                link=link,
                commands=[Sent.parse(text) for text in command],
                on_repair=lambda what: typer.echo(f"outcrop: {what}", err=True),
            )
        run = flight.outcome
        typer.echo(
            f"package {checked.counter} of {checked.mission}: "
            f"{run.outcome or 'unfinished'} "
            f"after {run.end_s or 0.0:.0f} s, utility {run.utility:g}, {len(run.products)} products in {out}"
        )
        if run.outcome != "SUCCEEDED":
            raise typer.Exit(1)

    @app.command("ingest")
    def ingest(
        run: Path = typer.Argument(..., help="folder of an execution"),
        actor: str = typer.Option("Operator", "--as", help="who does it"),
    ) -> None:
        """Take in the folder of an execution and tie its products. Needs no server."""
        from ground.cli.repository import actor_or_fail, open_or_fail
        from ground.errors import GroundError
        from ground.records.list_resources import list_resources
        from ground.resources.downlinks.ingest_run import ingest_run
        from ground.resources.products.kind import PRODUCT

        repo = open_or_fail()
        who = actor_or_fail(repo, actor)
        try:
            value = ingest_run(repo, who, run)
            page = list_resources(
                repo, who, PRODUCT, value.mission_id, limit=1000, cursor=None, where={"run_id": value.id}
            )
        except GroundError as err:
            fail(err.message)
        orphans = [p for p in page.items if p.orphan]
        typer.echo(
            f"run {value.id}: {value.outcome}, {len(page.items)} products, {len(orphans)} match no request"
        )
        for product in orphans:
            typer.echo(f"  orphan {product.id}  task {product.task_id}  {product.file_name}")
