"""How a command talks to a server, and what it prints of the answer."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from ground.cli.failure import fail

if TYPE_CHECKING:
    from ground.client import Client
    from ground.client.interface import Record

SERVER = typer.Option(
    "http://127.0.0.1:8000", "--server", envvar="OUTCROP_SERVER", help="address of the server"
)
PERSON = typer.Option(None, "--as", envvar="OUTCROP_PERSON", help="local profile to work as")


@contextmanager
def connected(server: str, person: str | None) -> Iterator[Client]:
    """Give a client; its errors end the program with one line."""
    import os

    from ground.client import ApiError, Client, ServerUnreachableError

    with Client(server, person=person, api_key=os.environ.get("OUTCROP_API_KEY")) as client:
        try:
            yield client
        except ServerUnreachableError as err:
            fail(f"{err}; start one with `outcrop serve`")
        except ApiError as err:
            fail(str(err))


def follow(client: Client, job: Record) -> Record:
    """Print the job's progress on stderr and return it when it is over; end the program if it failed."""
    last = job
    for last in client.wait(job):
        typer.echo(f"{last.progress:5.0%} {last.message}", err=True)
    if last.state != "succeeded":
        fail((last.problem or {}).get("detail", last.state), 1)
    return last


def uploaded(client: Client, path: Path) -> str:
    """Return the id under which the server has a file now."""
    if not path.is_file():
        fail(f"{path} is not a file")
    return str(client.upload(path).id)


def written(out: Path, content: bytes) -> None:
    """Write what came into a file and say how much it was."""
    try:
        out.write_bytes(content)
    except OSError as err:
        fail(f"{out} cannot be written: {err.strerror}")
    typer.echo(f"{out}: {len(content)} bytes")


def show(value: object) -> None:
    """Print a value as JSON."""
    typer.echo(json.dumps(value, indent=1, ensure_ascii=False))
