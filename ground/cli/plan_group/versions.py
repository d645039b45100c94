"""`outcrop plan diff` and `outcrop plan merge`: versions of one plan, without a server."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from ground.cli.failure import fail, refusals

if TYPE_CHECKING:
    from executive.crl import Plan

DIFFERENT = 1
CONFLICTS = 1


def register_versions(group: typer.Typer) -> None:
    """Add the commands to the group `plan`."""
    group.command("diff")(diff)
    group.command("merge")(merge_)


def diff(
    first: Path = typer.Argument(..., help="CRL file."),
    second: Path = typer.Argument(..., help="Another version of it."),
    as_json: bool = typer.Option(False, "--json", help="plan-difference/1 on stdout"),
    words: bool = typer.Option(
        True, help="tell words too (names, predictions, notes of blocks), which change no meaning"
    ),
) -> None:
    """Say what differs between two plans by meaning: steps, branches, conditions, windows.

    Exit status 0: they mean the same, 1: they differ, 2: one cannot be read. Needs no server.
    """
    from ground.versions.difference import DIFFERENCES, difference, without_words

    with refusals():
        found = difference(plan_in(first), plan_in(second))
    if not words:
        found = without_words(found)
    if as_json:
        typer.echo(DIFFERENCES.write(found, indent=1))
    else:
        for change in found.changes:
            typer.echo(f"{change.group:10}  {change.line()}")
        if found.same:
            typer.echo("the plans mean the same")
    if not found.same:
        raise typer.Exit(DIFFERENT)


def merge_(
    base: Path = typer.Argument(..., help="CRL file that both edits began with."),
    ours: Path = typer.Argument(..., help="One edit of it."),
    theirs: Path = typer.Argument(..., help="Another."),
    out: Path = typer.Option(..., "--out", help="CRL file for the merged plan; not written on a conflict."),
    take: str | None = typer.Option(
        None, help="ours or theirs: whose value stands where both changed one field or order"
    ),
) -> None:
    """Join two edits of one plan; what cannot be joined is named and nothing is written.

    Exit status 0: joined, 1: conflicts, 2: a plan cannot be read. Needs no server.
    """
    from executive.crl.printer import readable_text
    from ground.versions.merge import Take, merge

    if take not in (None, "ours", "theirs"):
        fail(f'--take is "{take}"; it must be ours or theirs')
    with refusals():
        found = merge(plan_in(base), plan_in(ours), plan_in(theirs), None if take is None else Take(take))
        if found.plan is not None:
            out.write_text(readable_text(found.plan), encoding="utf-8")
    for conflict in found.conflicts:
        typer.echo(conflict.line())
    if found.plan is None:
        count = len(found.conflicts)
        fail(f"{count} conflict{'' if count == 1 else 's'}; {out} was not written", CONFLICTS)
    typer.echo(str(out))


def plan_in(path: Path) -> Plan:
    """Return the plan in a CRL file; raises `InvalidInputError` with its first finding."""
    from ground.campaigns.variant import read_plan

    return read_plan(path)
