"""`outcrop run watch`: a run as live topics for Foxglove."""

from __future__ import annotations

import time
from pathlib import Path

import typer

from ground.cli.failure import refusals


def watch(
    run: Path = typer.Argument(..., help="folder of a run, going on or over"),
    foxglove: int = typer.Option(8765, min=0, max=65535, help="port for Foxglove; 0 takes a free one"),
    host: str = typer.Option("127.0.0.1", help="address to listen at; other machines need another one"),
    for_s: float | None = typer.Option(None, "--for", min=0.0, help="end after so many seconds"),
) -> None:
    """Serve a run's topics over Foxglove's WebSocket protocol (extra `mcap`). Needs no server.

    The bridge only reads the run's folder. Control-C ends it.
    """
    from ground.uplink.foxglove_bridge import Bridge

    end = None if for_s is None else time.monotonic() + for_s
    with refusals():
        bridge = Bridge(run, host=host, port=foxglove)
        typer.echo(f"open in Foxglove: ws://{host}:{bridge.port}")
        try:
            count = bridge.serve(lambda: end is not None and time.monotonic() >= end)
        except KeyboardInterrupt:
            return
        finally:
            bridge.close()
    typer.echo(f"{count} messages")
