"""Where a command may write a terrain: nowhere that one is already, unless it is to be replaced."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ground.cli.failure import fail

Replace = Annotated[bool, typer.Option("--replace", help="write over the terrain that is there")]


def refuse_over(out: Path, replace: bool) -> None:
    """End the command if `out` holds a terrain: missions, panoramas and plans rest on it by its digest."""
    if not replace and (out / "terrain.json").exists():
        fail(f"{out} holds a terrain already: choose another folder, or add --replace to write over it")
