"""`outcrop audit`, `backup`, `restore`, `check`, `doctor`, `prune`, `person`."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import TypeVar

import typer

from ground.cli.admin_group.upkeep import doctor, prune_command
from ground.cli.connection import PERSON, SERVER, connected
from ground.cli.failure import fail
from ground.cli.resources import group_of

T = TypeVar("T")
PHRASE = "Passphrase of the secrets"


def register(app: typer.Typer) -> None:
    """Add the commands."""
    _audit(app)
    _backups(app)
    _people(app)
    app.command("doctor")(doctor)
    app.command("prune")(prune_command)


def refused(work: Callable[[], T]) -> T:
    """Return what work gives; its refusal ends the command."""
    from ground.errors import GroundError

    try:
        return work()
    except GroundError as err:
        fail(err.message)


def _audit(app: typer.Typer) -> None:
    audit = typer.Typer(help="The history of every change.", no_args_is_help=True)
    app.add_typer(audit, name="audit")

    @audit.command("verify")
    def verify(
        against: Path | None = typer.Option(None, help="file of `outcrop audit head`, kept elsewhere"),
        key: str | None = typer.Option(None, help="public key, or its file, that must have signed it"),
    ) -> None:
        """Check the hash chain of every history, and every row against it; exit status 1 at a fault.

        Needs no server. Rows from before the histories held seals are counted, not checked.
        With --against every chain must go on from where it was when that file was written.
        """
        from ground.cli.repository import open_or_fail
        from ground.gdr.history import verify_against, verify_chains
        from ground.resources.history.verify_rows import verify_rows
        from ground.resources.upkeep.noted import note
        from ground.uplink.audit_head import read_head

        if key is not None and against is None:
            fail("--key is for the file of --against")
        heads = None if against is None else refused(lambda: read_head(against, key))
        repo = open_or_fail()
        with repo.database.read() as session:
            count, faults = verify_chains(session)
            faults += verify_against(session, heads or {})
            rows = verify_rows(session)
        for fault in faults:
            typer.echo(f"{fault.chain_id} event {fault.seq}: {fault.reason}", err=True)
        for row_fault in rows.faults:
            typer.echo(str(row_fault), err=True)
        untold = f", {rows.untold} earlier rows are in no event" if rows.untold else ""
        kept = "" if heads is None else f", {len(heads)} histories checked against {against}"
        odd = len(faults) + len(rows.faults)
        note(repo, "audit", odd)
        typer.echo(f"{count} events and {rows.checked} rows checked, {odd} faults{untold}{kept}")
        if faults or rows.faults:
            raise typer.Exit(1)

    @audit.command("head")
    def head(
        out: Path = typer.Argument(..., help="file to write; keep it where nobody of this machine writes"),
        key: Path = typer.Option(..., "--key", envvar="OUTCROP_KEY", help="private key of who vouches"),
    ) -> None:
        """Write the heads of all histories, signed, for `audit verify --against`. Needs no server."""
        from ground.cli.repository import open_or_fail
        from ground.gdr.history import heads_of, verify_chains
        from ground.uplink.audit_head import write_head

        repo = open_or_fail()
        with repo.database.read() as session:
            faults = verify_chains(session)[1]
            if faults:
                fail(f"{faults[0].chain_id} event {faults[0].seq}: {faults[0].reason}; nothing is signed")
            heads = heads_of(session)
        refused(lambda: write_head(out, heads, key))
        typer.echo(f"{out}: the heads of {len(heads)} histories")


def _backups(app: typer.Typer) -> None:

    @app.command("backup")
    def backup_command(
        target: Path = typer.Argument(..., help="tar file to write"),
        secrets: bool = typer.Option(
            False, "--secrets", help="with hashes of passwords and API keys, sealed with a passphrase"
        ),
    ) -> None:
        """Write database and files into one tar file, also while a server runs. Needs no server.

        Every stored file is checked against its hash; exit status 1 if one is damaged.
        """
        from ground.cli.repository import open_or_fail
        from ground.resources.backups.backup import backup
        from ground.resources.upkeep.noted import note

        phrase = typer.prompt(PHRASE, hide_input=True, confirmation_prompt=True) if secrets else None
        repo = open_or_fail()
        try:
            saved = refused(lambda: backup(repo, target, passphrase=phrase))
        except OSError as err:
            fail(f"{target} cannot be written: {err.strerror or err}")
        note(repo, "backup", len(saved.damaged))
        typer.echo(f"{target}: {sum(saved.rows.values())} rows, {target.stat().st_size} bytes")
        for name in saved.damaged:
            typer.echo(f"{name} is damaged or missing, and so in the backup", err=True)
        if saved.damaged:
            raise typer.Exit(1)

    @app.command("restore")
    def restore_command(
        source: Path = typer.Argument(..., help="tar file of `outcrop backup`"),
        until: datetime | None = typer.Option(
            None, help="as it was then, in UTC; the backup may be of any time after it"
        ),
        secrets: bool = typer.Option(False, "--secrets", help="with the secrets, by their passphrase"),
        test: bool = typer.Option(
            False, "--drill", help="restore into a scratch place, compare, and remove it again"
        ),
    ) -> None:
        """Fill an empty data folder and database from a backup. Needs no server.

        The backup is checked bit by bit first. Exit status 1 if something cannot come back as it was.
        """
        from ground.cli.repository import settings_or_fail
        from ground.errors import GroundError
        from ground.gdr.repository import open_repository
        from ground.resources.backups.restore import drill, restore

        repo = open_repository(settings_or_fail())
        phrase = typer.prompt(PHRASE, hide_input=True) if secrets else None
        moment = None if until is None else until.replace(tzinfo=until.tzinfo or UTC)
        try:
            if test:
                missing = drill(repo, source, until=moment, passphrase=phrase)
                typer.echo(f"{source}: drilled, {len(missing)} faults")
            else:
                done = restore(repo, source, until=moment, passphrase=phrase)
                missing = done.missing
                count, missions = sum(done.rows.values()), done.rows.get("missions", 0)
                typer.echo(f"{count} rows restored, {missions} missions")
        except GroundError as err:
            fail(err.message)
        for sentence in missing:
            typer.echo(sentence, err=True)
        if missing:
            raise typer.Exit(1)

    @app.command("check")
    def check_command(
        sweep: bool = typer.Option(
            False, "--sweep", help="remove what no record names and is older than an hour"
        ),
        contents: bool = typer.Option(False, "--contents", help="check every file against its hash"),
    ) -> None:
        """Look for records without their file and files that no record names. Needs no server."""
        from ground.cli.repository import open_or_fail
        from ground.resources.backups.check_files import check_files, damaged_files, sweep_files
        from ground.resources.upkeep.noted import note

        repo = open_or_fail()
        gone = sweep_files(repo) if sweep else []
        report = check_files(repo)
        for record in report.without_file:
            typer.echo(f"{record}: its file is not in the store", err=True)
        typer.echo(
            f"{report.files} files, {len(report.unnamed)} of them named by no record, "
            f"{len(report.strays)} folders of no run or campaign"
            + (f", {len(gone)} removed" if sweep else "")
        )
        damaged = damaged_files(repo) if contents else []
        if contents:
            note(repo, "contents", len(damaged))
        for name in damaged:
            typer.echo(f"{name} is damaged: its content is not what its hash says", err=True)
        if report.without_file or damaged:
            raise typer.Exit(1)


def _people(app: typer.Typer) -> None:
    person = group_of(app, "person")

    @person.command("add")
    def add_person(
        name: str = typer.Argument(...),
        role: str = typer.Option(
            "viewer", help="none, viewer, assistant, scientist, planner, flight_director, operator or admin"
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

    @person.command("password")
    def set_password_command(name: str = typer.Argument(...)) -> None:
        """Give somebody a password, and end their sessions. Needs no server."""
        from ground.cli.repository import open_or_fail
        from ground.records.actor import SYSTEM_ACTOR
        from ground.resources.people.passwords import set_password

        secret = _new_password()
        refused(lambda: set_password(open_or_fail(), SYSTEM_ACTOR, name, secret))
        typer.echo(f"{name} has a new password; sessions are ended")

    @person.command("reset-password")
    def reset_password_command(
        person_id: str = typer.Argument(...), server: str = SERVER, person: str | None = PERSON
    ) -> None:
        """Give somebody else a password, and end their sessions, as an administrator. Needs a server."""
        secret = _new_password()
        with connected(server, person) as client:
            client.reset_password(person_id, password=secret)
        typer.echo(f"{person_id} has a new password; sessions are ended")

    session = group_of(app, "session")

    @session.command("password")
    def change_password_command(server: str = SERVER, person: str | None = PERSON) -> None:
        """Change one's own password; one's sessions end. Needs a server."""
        old = typer.prompt("Password now", hide_input=True)
        secret = _new_password()
        with connected(server, person) as client:
            client.change_password(old=old, new=secret)
        typer.echo("your password is changed; your sessions are ended")


def _new_password() -> str:
    secret: str = typer.prompt("New password", hide_input=True, confirmation_prompt=True)
    if len(secret) < 8:
        fail("a password needs 8 characters")
    return secret
