"""The command `outcrop`: one module per group of commands, heavy imports inside the functions."""

from ground.cli.main import main

__all__ = ["main"]
