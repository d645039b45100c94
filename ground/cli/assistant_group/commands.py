"""`outcrop request say`: a plain sentence as a preview or draft. `outcrop assistant serve`: tools by MCP."""

from __future__ import annotations

import typer

from ground.cli.connection import PERSON, SERVER, connected
from ground.cli.failure import fail, refusals
from ground.cli.resources import group_of


def register(app: typer.Typer) -> None:
    group_of(app, "request").command("say")(say)
    assistant = typer.Typer(help="A server of tools for assistants.", no_args_is_help=True)
    assistant.command("serve")(serve_tools)
    app.add_typer(assistant, name="assistant")


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


def serve_tools(
    server: str = SERVER,
    http: int | None = typer.Option(
        None,
        "--http",
        min=1,
        max=65535,
        help="port of loopback for streamable HTTP; else standard input and output",
    ),
) -> None:
    """Serve tools that read and draft to an assistant (MCP), with the narrowed key of OUTCROP_API_KEY.

    No tool approves, signs, packages or sends. Needs a server, and the extra `assistant`.
    """
    with refusals(), connected(server, None) as client:
        from ground.assistant.serve import require_narrowed, serve

        require_narrowed(client)
        serve(client, http)
