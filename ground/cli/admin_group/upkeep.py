"""`outcrop doctor` and `outcrop prune`: what a service needs over weeks."""

from __future__ import annotations

import typer


def doctor() -> None:
    """Say what is wrong with the service and what to do, a line each; exit status 1 if anything is.

    Needs no server, changes nothing.
    """
    from ground.cli.repository import settings_or_fail
    from ground.gdr.repository import open_repository
    from ground.resources.upkeep.diagnose import diagnose

    findings = diagnose(open_repository(settings_or_fail()))
    for finding in findings:
        typer.echo(str(finding))
    if findings:
        raise typer.Exit(1)
    typer.echo("nothing is wrong: folder, database, schema, jobs, people, files, backups")


def prune_command(
    older_than: float = typer.Option(30.0, min=0.0, max=36_500.0, help="days since it was over"),
    dry_run: bool = typer.Option(False, "--dry-run", help="only say what would go"),
) -> None:
    """Remove finished jobs, superseded plans and dry runs, and files of no record. Needs no server.

    Nothing goes that an approval, a package, a campaign or a product names, nor the newest plan of a sol, nor
    the last run of a plan that stays. What goes is in the history.
    """
    from datetime import timedelta

    from ground.cli.repository import open_or_fail
    from ground.resources.upkeep.prune import prune

    gone = prune(open_or_fail(), timedelta(days=older_than), dry=dry_run)
    what = f"{len(gone.jobs)} jobs, {len(gone.runs)} dry runs, {len(gone.plans)} plans"
    typer.echo(f"{what} would go" if dry_run else f"{what} and {len(gone.files)} files and folders went")
    if dry_run:
        for name in (*gone.runs, *gone.plans):
            typer.echo(f"  {name}")
