"""Commands of proposals: plain sentences, and the server for assistants."""

from ground.cli.assistant_group.commands import register

__all__ = ["register"]
