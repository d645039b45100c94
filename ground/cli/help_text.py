"""What lists of commands say of each: its first paragraph, where typer cuts it at the first sentence."""

from __future__ import annotations

import inspect

import typer


def first_paragraph(text: str | None) -> str:
    """Return the first paragraph of a docstring as one line."""
    return " ".join(inspect.cleandoc(text or "").split("\n\n")[0].split())


def tell_whole(commands: typer.Typer) -> None:
    """Give each command, also of groups, its first paragraph as what lists of commands say of it."""
    for command in commands.registered_commands:
        about = command.help or (command.callback.__doc__ if command.callback else None)
        command.short_help = command.short_help or first_paragraph(about)
    for group in commands.registered_groups:
        if group.typer_instance is not None:
            tell_whole(group.typer_instance)
