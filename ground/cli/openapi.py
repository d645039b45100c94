"""`outcrop openapi`: the API's description, without a server."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import typer

from ground.cli.failure import fail

DEPTH = 3


def document_text(part: Any, depth: int = DEPTH) -> str:
    """Return a document as text: one line an operation or schema, so that a change of one is a line's."""
    if depth == 0 or not isinstance(part, dict):
        return json.dumps(part, sort_keys=True)
    rows = (f"{json.dumps(key)}: {document_text(value, depth - 1)}" for key, value in sorted(part.items()))
    return "{\n" + ",\n".join(rows) + "\n}"


def register(app: typer.Typer) -> None:
    @app.command("openapi")
    def openapi(
        out: Path | None = typer.Option(None, "--out", help="write here instead of to stdout"),
        check: Path | None = typer.Option(None, "--check", help="only say whether this file holds it"),
    ) -> None:
        """Print the OpenAPI document of the REST interface. Needs no server."""
        from ground.app.api import build_api

        text = document_text(build_api().openapi()) + "\n"
        if check is not None:
            if not check.is_file() or check.read_text(encoding="utf-8") != text:
                fail(f"{check} is not the interface's description: run `outcrop openapi --out {check}`", 1)
        elif out is None:
            typer.echo(text, nl=False)
        else:
            out.write_text(text, encoding="utf-8")
