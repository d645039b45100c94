"""Join the groups of commands into one program."""

from __future__ import annotations

import importlib
import pkgutil

import typer

app = typer.Typer(
    name="outcrop",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
)


def _show_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"outcrop {version('outcrop')}")
        raise typer.Exit


@app.callback()
def outcrop(
    version: bool = typer.Option(
        False, "--version", callback=_show_version, is_eager=True, help="Show the version."
    ),
) -> None:
    """Plan a rover's day on the ground and carry it out."""


def register_all() -> None:
    """Let each module of `ground.cli` that has a `register(app)` add its commands."""
    import ground.cli

    for module in sorted(m.name for m in pkgutil.iter_modules(ground.cli.__path__)):
        if module in {"main", "__main__"}:
            continue
        register = getattr(importlib.import_module(f"ground.cli.{module}"), "register", None)
        if register is not None:
            register(app)


def main() -> None:
    """Run the command line."""
    register_all()
    app()
