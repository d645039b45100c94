"""Join the groups of commands into one program."""

from __future__ import annotations

import importlib
import os
import pkgutil
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from ground.cli.failure import BAD_INPUT
from ground.cli.help_text import tell_whole
from ground.extras import missing_extra

if TYPE_CHECKING:
    from typer.models import TyperInfo

app = typer.Typer(
    name="outcrop",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
    rich_markup_mode=None,  # drawing the help with rich takes 0.09 s of the 0.25 s that a start may
    context_settings={"max_content_width": 120},
)


def _show_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"outcrop {version('outcrop')}")
        raise typer.Exit


@app.callback()
def outcrop(
    _version: bool = typer.Option(
        False, "--version", callback=_show_version, is_eager=True, help="Show the version."
    ),
    profiles: Path | None = typer.Option(
        None, exists=True, file_okay=False, help="Folder of rover profiles of your own (OUTCROP_PROFILES)."
    ),
) -> None:
    """Plan a rover's day on the ground and carry it out."""
    if profiles is not None:
        # in the environment, as the processes that do jobs and every room look there
        os.environ["OUTCROP_PROFILES"] = str(profiles.resolve())


def register_all() -> None:
    """Let each module of `ground.cli` that has a `register(app)` add its commands."""
    import ground.cli

    for module in sorted(m.name for m in pkgutil.iter_modules(ground.cli.__path__)):
        if module in {"main", "__main__"}:
            continue
        register = getattr(importlib.import_module(f"ground.cli.{module}"), "register", None)
        if register is not None:
            register(app)


def only_asked(groups: Sequence[TyperInfo], words: Sequence[str]) -> None:
    """Empty the groups of commands that the words do not name: making options of all takes 0.2 s."""
    for group in groups:
        inside = group.typer_instance
        if inside is not None and not {group.name, inside.info.name} & set(words):
            inside.registered_commands = []
            inside.registered_groups = []


def main() -> None:
    """Run the command line."""
    register_all()
    only_asked(app.registered_groups, sys.argv[1:])
    tell_whole(app)
    try:
        app()
    except ModuleNotFoundError as err:
        told = missing_extra(err)
        if told is None:
            raise
        typer.echo(f"outcrop: {told}", err=True)
        sys.exit(BAD_INPUT)
