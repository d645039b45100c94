"""`outcrop audit`, `backup`, `restore`, `check`, `person`."""

from __future__ import annotations

from pathlib import Path

import typer

from ground.cli.failure import fail
from ground.cli.resources import group_of


def register(app: typer.Typer) -> None:
    audit = typer.Typer(help="The history of every change.", no_args_is_help=True)
    app.add_typer(audit, name="audit")

    @audit.command("verify")
    def verify() -> None:
        """Check the hash chain of every history; exit status 1 if one is broken. Needs no server."""
        from ground.cli.repository import open_or_fail
        from ground.gdr.history import verify_chains

        repo = open_or_fail()
        with repo.database.read() as session:
            count, faults = verify_chains(session)
        for fault in faults:
            typer.echo(f"{fault.chain_id} event {fault.seq}: {fault.reason}", err=True)
        typer.echo(f"{count} events checked, {len(faults)} faults")
        if faults:
            raise typer.Exit(1)

    @app.command("backup")
    def backup_command(target: Path = typer.Argument(..., help="tar file to write")) -> None:
        """Write database and files into one tar file, also while a server runs. Needs no server."""
        from ground.cli.repository import open_or_fail
        from ground.resources.backups.backup import backup

        counts = backup(open_or_fail(), target)
        typer.echo(f"{target}: {sum(counts.values())} rows, {target.stat().st_size} bytes")

    @app.command("restore")
    def restore_command(source: Path = typer.Argument(..., help="tar file of `outcrop backup`")) -> None:
        """Fill an empty data folder and database from a backup. Needs no server."""
        from ground.cli.repository import settings_or_fail
        from ground.errors import GroundError
        from ground.gdr.repository import open_repository
        from ground.resources.backups.backup import restore

        try:
            counts = restore(open_repository(settings_or_fail()), source)
        except GroundError as err:
            fail(err.message)
        typer.echo(f"{sum(counts.values())} rows restored, {counts.get('missions', 0)} missions")

    @app.command("check")
    def check_command(
        sweep: bool = typer.Option(
            False, "--sweep", help="remove what no record names and is older than an hour"
        ),
    ) -> None:
        """Look for records without their file and files that no record names. Needs no server."""
        from ground.cli.repository import open_or_fail
        from ground.resources.backups.check_files import check_files, sweep_files

        repo = open_or_fail()
        gone = sweep_files(repo) if sweep else []
        report = check_files(repo)
        for record in report.without_file:
            typer.echo(f"{record}: its file is not in the store", err=True)
        typer.echo(
            f"{report.files} files, {len(report.unnamed)} of them named by no record, "
            f"{len(report.stray_runs)} folders of no run" + (f", {len(gone)} removed" if sweep else "")
        )
        if report.without_file:
            raise typer.Exit(1)

    person = group_of(app, "person")

    @person.command("add")
    def add_person(
        name: str = typer.Argument(...),
        role: str = typer.Option(
            "viewer", help="viewer, scientist, planner, flight_director, operator or admin"
        ),
        password: bool = typer.Option(False, "--password", help="ask for a password (needed with accounts)"),
    ) -> None:
        """Add a person. Needs no server."""
        from ground.cli.repository import open_or_fail
        from ground.errors import GroundError
        from ground.records.actor import SYSTEM_ACTOR, Role
        from ground.resources.people.accounts import create_person

        try:
            chosen = Role(role)
        except ValueError:
            fail(f"there is no role {role!r}; there are {', '.join(r.value for r in Role)}")
        secret = typer.prompt("Password", hide_input=True, confirmation_prompt=True) if password else None
        if secret is not None and len(secret) < 8:
            fail("a password needs 8 characters")
        try:
            made = create_person(open_or_fail(), SYSTEM_ACTOR, name, chosen, secret)
        except GroundError as err:
            fail(err.message)
        typer.echo(f"{made.id} {made.name} {made.role.value}")
