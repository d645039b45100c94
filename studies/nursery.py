"""Processes of the `outcrop` command, forked from one that has loaded the modules already.

They are whole processes, with a command line, an environment, an id and an exit status of their own; only the
seconds of importing are spared, so that hundreds can be killed and started again.
"""

from __future__ import annotations

import multiprocessing
import os
import pkgutil
import sys
import traceback
from collections.abc import Mapping, Sequence
from multiprocessing.process import BaseProcess
from pathlib import Path

import ground.cli

_CONTEXT = multiprocessing.get_context("forkserver")
_COMMANDS = tuple(
    f"ground.cli.{m.name}" for m in pkgutil.iter_modules(ground.cli.__path__) if m.name != "__main__"
)
_LOADED = (
    *_COMMANDS,
    "alembic.command",
    "ground.app.job_kinds",
    "ground.app.service",
    "ground.client",
    "ground.gdr.migrate",
    "ground.resources.downlinks.ingest_run",
    "ground.uplink.execute",
    "ground.day.prepare",
    "ground.resources.path_networks.work",
    "planner.path_network",
    "rover_iface.behaviour.products",
    "rover_iface.simulator.abstract_rover",
    "rover_iface.simulator.world",
    "sqlalchemy.dialects.postgresql.psycopg",
    "sqlalchemy.dialects.sqlite",
    "uvicorn.lifespan.on",
    "uvicorn.protocols.http.auto",
)


def start(
    arguments: Sequence[str], output: Path, environment: Mapping[str, str] | None = None
) -> BaseProcess:
    """Return a process of `outcrop ARGUMENTS`; what it prints is added to the file `output`."""
    _CONTEXT.set_forkserver_preload(list(_LOADED))
    process = _CONTEXT.Process(
        target=_command, args=(list(arguments), output, dict(environment or {})), daemon=True
    )
    process.start()
    return process


def _command(arguments: list[str], output: Path, environment: dict[str, str]) -> None:
    os.environ.update(environment)
    with output.open("ab") as file:
        for number in (1, 2):
            os.dup2(file.fileno(), number)
    sys.argv = ["outcrop", *arguments]
    from ground.cli.main import main

    try:
        main()
    except Exception:  # noqa: BLE001 - shown as an interpreter of its own would show it
        traceback.print_exc()
        os._exit(1)
