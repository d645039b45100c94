"""`outcrop request say`: a plain sentence as a preview or a draft."""

from __future__ import annotations

import typer

from ground.cli.connection import PERSON, SERVER, connected
from ground.cli.failure import fail
from ground.cli.resources import group_of


def register(app: typer.Typer) -> None:
    group_of(app, "request").command("say")(say)


def say(
    mission: str = typer.Argument(..., help="id of the mission"),
    text: str = typer.Argument(..., help="one sentence: a request, a window or a keep-out"),
    draft: bool = typer.Option(False, "--draft", help="file it as a draft; else it is a preview"),
    server: str = SERVER,
    person: str | None = PERSON,
) -> None:
    """Read a plain sentence: say what it would draft, or ask about the words that are not understood.

    Needs a server. Exit status 0: it is understood, 1: something is asked.
    """
    with connected(server, person) as client:
        found = client.read_sentence(mission, text=text)
        if not found.understood:
            fail("; ".join(found.questions), 1)
        typer.echo(found.in_words)
        for assumed in found.assumed:
            typer.echo(f"assumed: {assumed}")
        if draft:
            typer.echo(client.draft_sentence(mission, text=text).id)
