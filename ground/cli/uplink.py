"""`outcrop package`, `execute`, `stop`, `ingest`: uplink and downlink, and what a live run can be asked."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from ground.cli.failure import fail, refusals

if TYPE_CHECKING:
    from ground.uplink.flight import Flight
    from ground.uplink.verify import Package


LINGER_S = 600.0
"""How long a simulated rover waits for an executive that died to come back."""

RUN = typer.Argument(..., help="folder of the live run")


def register(app: typer.Typer) -> None:
    _live(app)

    @app.command("package")
    def package(
        plan: str = typer.Argument(..., help="id of an approved plan"),
        out: Path | None = typer.Option(None, help="file; default its own name, here"),
        actor: str = typer.Option("Operator", "--as", help="who does it"),
    ) -> None:
        """Make the signed uplink package of an approved plan. Needs no server."""
        from ground.cli.repository import actor_or_fail, open_or_fail
        from ground.resources.packages.package_plan import package_plan

        repo = open_or_fail()
        with refusals():
            made = package_plan(repo, actor_or_fail(repo, actor), plan)
        target = out or Path(made.file_name)
        target.write_bytes(made.content)
        typer.echo(f"{target}  sequence {made.sequence}  sha256 {made.sha256}")

    @app.command("execute")
    def execute(
        package: Path = typer.Argument(..., help="an uplink package"),
        rover: str = typer.Option("abstract", help="name of an installed rover"),
        world: Path = typer.Option(..., help="folder of the rover's world and ledger"),
        trust: Path = typer.Option(..., help="trust file: whose signatures count"),
        out: Path = typer.Option(..., help="new folder for the run"),
        seed: int | None = typer.Option(None, min=0, help="seed of a simulated rover"),
        resume: bool = typer.Option(
            False, "--resume", help="go on with a run in --out whose process died; a live one also begins"
        ),
        live: bool = typer.Option(
            False, "--live", help="on the real clock: the rover runs in a process of its own"
        ),
        connect: str | None = typer.Option(
            None, help="live, on the rover that listens there: unix:/path or tcp://host:port"
        ),
        speed: float = typer.Option(1.0, help="live: seconds of the plan in a second, simulated rovers"),
        silence: float = typer.Option(
            60.0, help="live: seconds without a word before the rover is made safe"
        ),
        dictionary: Path | None = typer.Option(
            None, help="live: dictionary/1 file of a rover that does not tell its own"
        ),
        cert: Path | None = typer.Option(None, help="mutual TLS: own certificate, PEM"),
        key: Path | None = typer.Option(None, help="mutual TLS: its key, PEM"),
        ca: Path | None = typer.Option(None, help="mutual TLS: the authority of both ends, PEM"),
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

        if live or connect is not None:
            order = LiveOrder(rover, connect, world, trust, seed, speed, silence, dictionary, (cert, key, ca))
            with refusals():
                checked, flight = execute_on_the_real_clock(package, order, out, resume=resume)
            _tell(checked, flight, out)
            return
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
        _tell(checked, flight, out)

    @app.command("ingest")
    def ingest(
        run: Path = typer.Argument(..., help="folder of an execution"),
        actor: str = typer.Option("Operator", "--as", help="who does it"),
    ) -> None:
        """Take in the folder of an execution and tie its products. Needs no server."""
        from ground.cli.repository import actor_or_fail, open_or_fail
        from ground.records.list_resources import list_resources
        from ground.resources.downlinks.ingest_run import ingest_run
        from ground.resources.products.kind import PRODUCT

        repo = open_or_fail()
        who = actor_or_fail(repo, actor)
        with refusals():
            value = ingest_run(repo, who, run)
            page = list_resources(
                repo, who, PRODUCT, value.mission_id, limit=1000, cursor=None, where={"run_id": value.id}
            )
        orphans = [p for p in page.items if p.orphan]
        typer.echo(
            f"run {value.id}: {value.outcome}, {len(page.items)} products, {len(orphans)} match no request"
        )
        for product in orphans:
            typer.echo(f"  orphan {product.id}  task {product.task_id}  {product.file_name}")


def _tell(checked: Package, flight: Flight, out: Path) -> None:
    run = flight.outcome
    typer.echo(
        f"package {checked.counter} of {checked.mission}: "
        f"{run.outcome or 'unfinished'} "
        f"after {run.end_s or 0.0:.0f} s, utility {run.utility:g}, {len(run.products)} products in {out}"
    )
    if run.outcome != "SUCCEEDED":
        raise typer.Exit(1)


def _live(app: typer.Typer) -> None:
    """Add what a live run can be asked: it goes to the run's own process, not to a server."""
    from ground.cli.resources import group_of
    from ground.cli.robot_group.recording import import_
    from ground.cli.robot_group.watch import watch

    @app.command("stop")
    def stop(run: Path = RUN) -> None:
        """Stop a live run and its rover at once. Needs no server; works when everything else hangs."""
        from ground.uplink.live import stop_run

        with refusals():
            typer.echo(stop_run(run, by=_who()))

    runs = group_of(app, "run")

    @runs.command("ask")
    def ask(
        what: str = typer.Argument(..., help="hold, go, step, abort or state"),
        run: Path = RUN,
    ) -> None:
        """Hold a live run, let it go on, let one thing start, abort it, or ask how it stands.

        Needs no server.
        """
        import json

        if what not in ("hold", "go", "step", "abort", "state"):
            fail(f"{what!r} is nothing a run can be asked; hold, go, step, abort and state are")
        typer.echo(json.dumps(_ask(run, {"m": what, "by": _who()})))

    @runs.command("export")
    def export(
        run: Path = typer.Argument(..., help="folder of a run, over or not"),
        mcap: Path = typer.Option(..., help="the MCAP file to write (extra `mcap`)"),
        ros2: bool = typer.Option(False, "--ros2", help="standard messages of ROS 2 in CDR, as bags hold"),
        capacity_j: float = typer.Option(
            0.0, min=0.0, help="with --ros2: energy of the full battery, to tell its share of charge"
        ),
    ) -> None:
        """Write a run as MCAP: pose, telemetry, plan, notes, pictures. Needs no server.

        Foxglove opens both kinds of file; the bag tools of ROS open the one with `--ros2`.
        """
        from ground.uplink.mcap_export import export_mcap

        with refusals():
            counts = export_mcap(run, mcap, ros2=ros2, capacity_j=capacity_j)
            for topic, count in sorted(counts.items()):
                typer.echo(f"{count:7d}  {topic}")

    runs.command("watch")(watch)
    runs.command("import")(import_)

    @runs.command("inject")
    def inject(
        run: Path = RUN,
        kind: str = typer.Argument(..., help="kind of fault/1: lose-target, slow-drive, low-battery, ..."),
        target: str | None = typer.Option(None, help="target that it concerns"),
        amount: float | None = typer.Option(None, help="factor, joules or interest"),
        task: str | None = typer.Option(None, help="when the command of this task arrives; else now"),
    ) -> None:
        """Let the simulated rover of a live run suffer a fault. Needs no server."""
        given = {"kind": kind, "target": target, "amount": amount, "task": task}
        _ask(run, {"m": "inject", "fault": {k: v for k, v in given.items() if v is not None}, "by": _who()})


def _who() -> str:
    """Return who is at the machine, for the journal."""
    import getpass

    try:
        return f"{getpass.getuser()} at the machine"
    except (KeyError, OSError):  # a user without a name, as in some containers
        return "somebody at the machine"


def _ask(run: Path, request: dict[str, object]) -> dict[str, object]:
    from executive.runtime.control import ask_run

    with refusals():
        return ask_run(run, request, timeout_s=10.0)


@dataclass(frozen=True, slots=True)
class LiveOrder:
    """What `outcrop execute --live` was given; without `connect` the rover is made here."""

    rover: str
    connect: str | None
    world: Path
    trust: Path
    seed: int | None
    speed: float
    silence_s: float
    dictionary: Path | None
    keys: tuple[Path | None, Path | None, Path | None]


def execute_on_the_real_clock(
    package: Path, order: LiveOrder, out: Path, *, resume: bool
) -> tuple[Package, Flight]:
    """Return what came of a package on the real clock; see `ground.uplink.live.execute_live`."""
    from executive.crl.dictionary import load_dictionary
    from executive.runtime.wire import Address, Keys
    from ground.uplink.live import LiveOptions, LivePlace, execute_live
    from ground.uplink.serve_rover import ROVER_SOCKET, Serving, rover_at

    language = None if order.dictionary is None else load_dictionary(order.dictionary)
    named = None if language is None else (language.name, language.version, language.sha256)
    options = LiveOptions(silence_s=order.silence_s)
    if order.connect is not None:
        place = LivePlace(Address.parse(order.connect), order.world, order.trust, Keys.of(*order.keys), named)
        return execute_live(package, place, out, resume=resume, options=options, on_repair=_warn)
    address = Address(out.resolve() / ROVER_SOCKET)
    place = LivePlace(address, order.world, order.trust, None, named, products_here=True)
    serving = Serving(
        order.rover, order.world, address, None, out.resolve(), order.seed, order.speed, LINGER_S
    )
    with rover_at(serving):
        return execute_live(package, place, out, resume=resume, options=options, on_repair=_warn)


def _warn(what: str) -> None:
    typer.echo(f"outcrop: {what}", err=True)
