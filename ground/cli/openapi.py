"""`outcrop openapi`: the API's description, without a server."""

from __future__ import annotations

from pathlib import Path

import typer


def register(app: typer.Typer) -> None:
    @app.command("openapi")
    def openapi(
        out: Path | None = typer.Option(None, "--out", help="write here instead of to stdout"),
    ) -> None:
        """Print the OpenAPI document of the REST interface. Needs no server."""
        import json

        from ground.api.application import build_api

        text = json.dumps(build_api().openapi(), indent=1, sort_keys=True) + "\n"
        if out is None:
            typer.echo(text, nl=False)
        else:
            out.write_text(text, encoding="utf-8")
