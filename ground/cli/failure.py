"""How a command ends when its input is wrong: one line on stderr and a stable exit code."""

from __future__ import annotations

from typing import NoReturn

import typer

BAD_INPUT = 2


def fail(message: str, code: int = BAD_INPUT) -> NoReturn:
    """Print `message` on stderr, headed by the program's name, and exit with `code`."""
    typer.echo(f"outcrop: {message}", err=True)
    raise typer.Exit(code)
