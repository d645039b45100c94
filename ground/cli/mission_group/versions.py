"""`outcrop mission diff` and `outcrop mission merge`: a mission and its copy."""

from __future__ import annotations

from typing import Any

import typer

from ground.cli.connection import PERSON, SERVER, connected
from ground.cli.failure import fail

DIFFERENT = 1
CONFLICTS = 1


def register_versions(group: typer.Typer) -> None:
    """Add the commands to the group `mission`."""
    group.command("diff")(diff)
    group.command("merge")(merge)


def diff(
    mission: str = typer.Argument(..., help="the mission: ours"),
    other: str = typer.Argument(..., help="its copy, or what it is a copy of: theirs"),
    server: str = SERVER,
    person: str | None = PERSON,
) -> None:
    """Say what a mission and its copy did since they began to differ, and which edits collide.

    Exit status 0: they do not differ, 1: they do. Needs a server.
    """
    with connected(server, person) as client:
        found = client.differ_missions(mission, from_id=other)
    for edit in found.edits:
        typer.echo(edit_line(edit))
    for conflict in found.conflicts:
        typer.echo(conflict_line(conflict))
    if not found.edits:
        typer.echo("the missions do not differ")
        return
    raise typer.Exit(DIFFERENT)


def merge(
    other: str = typer.Argument(..., help="the mission to take edits from: theirs"),
    mission: str = typer.Argument(..., help="the mission to merge them into: ours"),
    choose: list[str] = typer.Option(
        [], help="CONFLICT=ours or CONFLICT=theirs, by the name that is printed for it; may be repeated"
    ),
    take: str | None = typer.Option(None, help="ours or theirs, for all conflicts that are not chosen"),
    event: int | None = typer.Option(
        None, min=1, help="newest event of the mission that was looked at; default what is there now"
    ),
    from_event: int | None = typer.Option(None, min=1, help="newest event of the other mission"),
    preview: bool = typer.Option(False, "--preview", help="keep nothing"),
    server: str = SERVER,
    person: str | None = PERSON,
) -> None:
    """Merge a copy into its mission, or the other way, as one act that one undo takes back.

    Exit status 0: merged, 1: conflicts are open and nothing was done. Needs a server.
    """
    if take not in {None, "ours", "theirs"}:
        fail(f'--take is "{take}"; it must be ours or theirs')
    choices = [choice_of(word) for word in choose]
    members: dict[str, Any] = {"from_id": other, "choices": choices, "take": take}
    members |= {name: found for name, found in (("event", event), ("from_event", from_event)) if found}
    with connected(server, person) as client:
        found = client.merge_missions(mission, **members, preview=True)
        if found.joined and not preview:
            seen = {"event": found.event, "from_event": found.from_event}
            found = client.merge_missions(mission, **{**members, **seen})
    for conflict in found.conflicts:
        typer.echo(conflict_line(conflict))
    if not found.joined:
        count = len(found.conflicts)
        fail(f"{count} conflict{'' if count == 1 else 's'}; nothing was merged", CONFLICTS)
    word = "would be " if preview else ""
    typer.echo(f"{found.added} {word}added, {found.changed} {word}changed, {found.removed} {word}removed")


def choice_of(word: str) -> dict[str, str]:
    """Return a choice from `kind:id:field=side`."""
    conflict, _, side = word.rpartition("=")
    parts = conflict.split(":", 2)
    if side not in {"ours", "theirs"} or len(parts) < 2:
        fail(f'--choose is "{word}"; it must be KIND:ID:FIELD=ours or =theirs, as a conflict is printed')
    return {"kind": parts[0], "id": parts[1], "field": "".join(parts[2:]), "take": side}


def edit_line(edit: Any) -> str:
    """Return what one side did as a line."""
    what = f"{edit.kind.replace('_', ' ')} {edit.name or edit.id}"
    told = f"{edit.side:7} {edit.action:8} {what}"
    if not edit.field:
        return told
    return f"{told}: {edit.field}: {edit.base or '(none)'} -> {edit.now or '(none)'}"


def conflict_line(conflict: Any) -> str:
    """Return a conflict as a line, its name for `--choose` first."""
    what = f"{conflict.resource.replace('_', ' ')} {conflict.name or conflict.id}"
    said = (("was", conflict.base), ("ours", conflict.ours), ("theirs", conflict.theirs))
    told = "; ".join(f"{who}: {text or '(none)'}" for who, text in said)
    return f"{conflict.kind}:{conflict.id}:{conflict.field}  {what}: {told}"
