"""`outcrop review|run|job|history|network ...`: plans, runs, jobs and history, as the browser has them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import typer

from ground.cli.failure import fail
from ground.cli.records import members, show
from ground.cli.resources import PERSON, SERVER, connected, fetch, follow, group_of


def register(app: typer.Typer) -> None:
    _review(group_of(app, "review", "Plans: look at, compare, approve."))
    _run(group_of(app, "run", "Runs."))
    _job(group_of(app, "job", "Jobs."))
    _history(group_of(app, "history", "Changes of a mission."))
    _network(group_of(app, "network", "Path networks."))


def _review(group: typer.Typer) -> None:
    @group.command("file")
    def file(
        plan: str = typer.Argument(...),
        out: Path = typer.Argument(..., help="FILE.crl, FILE.json (the tree), FILE.svg or FILE.dot"),
        canonical: bool = typer.Option(False, help="CRL over which the digest is taken"),
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        """Write a plan into a file: CRL, plan tree or drawing by its ending. Needs a server."""
        places = {
            ".crl": f"/plans/{plan}/crl?canonical={str(canonical).lower()}",
            ".json": f"/plans/{plan}/tree",
            ".svg": f"/plans/{plan}/drawing?form=svg",
            ".dot": f"/plans/{plan}/drawing?form=dot",
        }
        if out.suffix not in places:
            fail(f"{out}: the ending says the form; known are {', '.join(places)}")
        with connected(server, person) as client:
            content = client.request("GET", places[out.suffix]).content
        out.write_bytes(content)
        typer.echo(f"{out}: {len(content)} bytes")

    @group.command("report")
    def report(
        plan: str = typer.Argument(...),
        out: Path = typer.Argument(..., help="HTML file to write"),
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        """Write the report of a plan for the uplink meeting as one HTML page. Needs a server."""
        fetch(f"/plans/{plan}/report", out, server, person)

    @group.command("summary")
    def summary(plan: str = typer.Argument(...), server: str = SERVER, person: str | None = PERSON) -> None:
        """Print the planner's summary. Needs a server."""
        with connected(server, person) as client:
            show(client.request("GET", f"/plans/{plan}/summary").json())

    @group.command("findings")
    def findings(plan: str = typer.Argument(...), server: str = SERVER, person: str | None = PERSON) -> None:
        """Print what the CRL validator found. Needs a server."""
        with connected(server, person) as client:
            for found in client.request("GET", f"/plans/{plan}/findings").json():
                typer.echo(f"{found['severity']} {found['code']} line {found['line']}: {found['message']}")

    @group.command("rules")
    def rules(plan: str = typer.Argument(...), server: str = SERVER, person: str | None = PERSON) -> None:
        """Hold the flight rules against a plan; exit status 1 if one does not hold. Needs a server."""
        with connected(server, person) as client:
            found = client.request("GET", f"/plans/{plan}/flight-rules").json()
        for rule in found:
            word = "holds" if rule["holds"] else "waived" if rule["waived_by"] else "BROKEN"
            typer.echo(f"{word:7} {rule['rule']}  {rule['detail']}")
        if any(not rule["holds"] and not rule["waived_by"] for rule in found):
            raise typer.Exit(1)

    @group.command("waive")
    def waive(
        plan: str = typer.Argument(...),
        rule: str = typer.Argument(...),
        reason: str = typer.Argument(...),
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        """Accept that a flight rule does not hold for a plan. Needs a server."""
        with connected(server, person) as client:
            client.request("POST", f"/plans/{plan}/waivers", json={"rule": rule, "reason": reason})

    @group.command("approve")
    def approve(
        plan: str = typer.Argument(...),
        crl_sha256: str = typer.Argument(
            ..., help="digest of the text that was read: see `outcrop review show`"
        ),
        note: str = typer.Option(""),
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        """Approve a verified plan that somebody else made. Needs a server."""
        body = {"crl_sha256": crl_sha256, "note": note}
        with connected(server, person) as client:
            made = client.request("POST", f"/plans/{plan}/approval", json=body).json()
            typer.echo(f"{made['id']} by {made['approver']}")

    @group.command("why-not")
    def why_not(
        plan: str = typer.Argument(...),
        request: str = typer.Argument(...),
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        """Say why a request is not in a plan. Needs a server."""
        with connected(server, person) as client:
            show(client.request("GET", f"/plans/{plan}/why-not/{request}").json())

    @group.command("compare")
    def compare(
        plan: str = typer.Argument(...),
        other: str = typer.Argument(...),
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        """Compare two plans on the same futures. Needs a server."""
        with connected(server, person) as client:
            show(client.request("GET", f"/plans/{plan}/comparison/{other}").json())

    @group.command("what-if")
    def what_if(
        plan: str = typer.Argument(...),
        changes: list[str] = typer.Argument(..., help="such as time_budget_s=9000 or loss_factor=2"),
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        """Say what changes of the day are worth. Needs a server."""
        with connected(server, person) as client:
            show(client.request("POST", f"/plans/{plan}/what-if", json=members(changes)).json())


def _run(group: typer.Typer) -> None:
    @group.command("file")
    def file(
        run: str = typer.Argument(...),
        what: str = typer.Argument(..., help="trace, telemetry, snapshot, report (HTML) or products (zip)"),
        out: Path = typer.Argument(...),
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        """Write a part of a run into a file. Needs a server."""
        parts = ("trace", "telemetry", "snapshot", "report", "products")
        if what not in parts:
            fail(f"{what!r}: there are {', '.join(parts)}")
        with connected(server, person) as client:
            content = client.request("GET", f"/runs/{run}/{what}").content
        out.write_bytes(content)
        typer.echo(f"{out}: {len(content)} bytes")

    @group.command("control")
    def control(
        run: str = typer.Argument(...),
        act: str = typer.Argument(..., help="pause, resume, step, abort, or pace=SECONDS"),
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        """Hold, let go, step or abort a run that goes on. Needs a server."""
        bodies: dict[str, dict[str, Any]] = {
            "pause": {"paused": True},
            "resume": {"paused": False},
            "step": {"step": True},
            "abort": {"abort": True},
        }
        body = members([act]) if act.startswith("pace=") else bodies.get(act)
        if body is None:
            fail(f"{act!r}: there are {', '.join(bodies)} and pace=SECONDS")
        with connected(server, person) as client:
            show(client.request("POST", f"/runs/{run}/control", json=body).json())


def _job(group: typer.Typer) -> None:
    def ask(job: str, verb: str, server: str, person: str | None) -> None:
        with connected(server, person) as client:
            answer = client.request("POST", f"/jobs/{job}/{verb}").json()
            typer.echo(f"{answer['id']} {answer['state']} {answer['message']}")

    @group.command("cancel")
    def cancel(job: str = typer.Argument(...), server: str = SERVER, person: str | None = PERSON) -> None:
        """Ask a job to stop. Needs a server."""
        ask(job, "cancel", server, person)

    @group.command("retry")
    def retry(job: str = typer.Argument(...), server: str = SERVER, person: str | None = PERSON) -> None:
        """Queue a job once more that failed or was cancelled. Needs a server."""
        ask(job, "retry", server, person)


def _history(group: typer.Typer) -> None:
    @group.command("list")
    def list_changes(
        mission: str = typer.Argument(...),
        limit: int = typer.Option(50, min=1, max=1000),
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        """List the newest changes of a mission. Needs a server."""
        asked: dict[str, Any] = {"newest_first": True, "limit": limit}
        with connected(server, person) as client:
            for event in client.request("GET", f"/missions/{mission}/history", params=asked).json()["items"]:
                typer.echo(
                    f"{event['seq']:6}  {event['at_utc']}  {event['actor']}  {event['action']}  "
                    f"{event['kind']} {event['subject_id']}  {event['reason']}"
                )

    def turn(mission: str, word: str, anyone: bool, server: str, person: str | None) -> None:
        with connected(server, person) as client:
            done = client.request("POST", f"/missions/{mission}/{word}", json={"anyone": anyone}).json()
            for event in done:
                typer.echo(f"{event['action']} {event['kind']} {event['subject_id']}")

    anyone_option = typer.Option(False, "--anyone", help="of anybody, not only of oneself")

    @group.command("undo")
    def undo(
        mission: str = typer.Argument(...),
        anyone: bool = anyone_option,
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        """Take back the last act. Needs a server."""
        turn(mission, "undo", anyone, server, person)

    @group.command("redo")
    def redo(
        mission: str = typer.Argument(...),
        anyone: bool = anyone_option,
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        """Do again what was taken back. Needs a server."""
        turn(mission, "redo", anyone, server, person)


def _network(group: typer.Typer) -> None:
    @group.command("make")
    def make(mission: str = typer.Argument(...), server: str = SERVER, person: str | None = PERSON) -> None:
        """Compute the path network of a mission. Needs a server."""
        with connected(server, person) as client:
            typer.echo(follow(client, client.path_network(mission)).subject_id)
