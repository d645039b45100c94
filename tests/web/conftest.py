"""A real server with the demo mission, and Debian's chromium to look at it."""

from __future__ import annotations

import os
import re
import selectors
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
CHROMIUM = Path(os.environ.get("OUTCROP_CHROMIUM", "/usr/bin/chromium"))
FLAGS = [
    "--no-sandbox",
    "--enable-unsafe-swiftshader",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-default-apps",
    "--disable-sync",
    "--no-first-run",
]
START_S = 120.0


def _outcrop(data: Path) -> tuple[list[str], dict[str, str]]:
    environment = dict(os.environ, OUTCROP_DATA_DIR=str(data), PYTHONUNBUFFERED="1")
    environment.pop("OUTCROP_DATABASE_URL", None)
    # The server works in its data folder: what it imports is this checkout, whatever else is installed.
    environment["PYTHONPATH"] = str(ROOT)
    return [sys.executable, "-m", "ground.cli"], environment


def _address(server: subprocess.Popen[str]) -> str:
    """Return the address the server says it is at; it chose a free port itself."""
    assert server.stdout is not None
    waiter = selectors.DefaultSelector()
    waiter.register(server.stdout, selectors.EVENT_READ)
    printed: list[str] = []
    end = time.monotonic() + START_S
    while time.monotonic() < end and server.poll() is None:
        if not waiter.select(timeout=1.0):
            continue
        line = server.stdout.readline()
        printed.append(line)
        if found := re.search(r"http://127\.0\.0\.1:\d+", line):
            return found.group()
    server.kill()
    raise AssertionError("the server did not start:\n" + "".join(printed))


def build_ui() -> Path:
    """Return the folder of the built UI; it is made where it is missing or old."""
    subprocess.run([sys.executable, str(ROOT / "scripts" / "build_web.py")], check=True)
    return ROOT / "web" / "dist"


@pytest.fixture(scope="session")
def built_ui() -> Path:
    """The built UI."""
    return build_ui()


@dataclass(frozen=True)
class Server:
    """A running server: its address, and its data folder for commands that work beside it."""

    address: str
    data: Path
    pid: int

    def __str__(self) -> str:
        return self.address

    def outcrop(self, *arguments: str) -> str:
        """Run the command `outcrop` on the server's data; return what it printed."""
        command, environment = _outcrop(self.data)
        done = subprocess.run(
            [*command, *arguments],
            env=environment,
            cwd=self.data,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, f"outcrop {' '.join(arguments)}: {done.stdout}{done.stderr}"
        return done.stdout


@pytest.fixture(scope="session")
def server(tmp_path_factory: pytest.TempPathFactory, built_ui: Path) -> Iterator[Server]:
    """A server on a fresh database with the demo mission."""
    with run_server(tmp_path_factory.mktemp("data")) as running:
        yield running


@contextmanager
def run_server(data: Path, *, demo: bool = True, **settings: str) -> Iterator[Server]:
    """Give a server on a fresh database with the demo mission; its data are gone afterwards.

    Without the mission nothing is done before: it is `outcrop serve` on an empty folder. Settings are named
    as variables without `OUTCROP_`.
    """
    command, environment = _outcrop(data)
    environment |= {f"OUTCROP_{name}": value for name, value in settings.items()}
    for arguments in (["migrate"], ["mission", "load-demo"]) if demo else ():
        subprocess.run(
            [*command, *arguments], env=environment, check=True, cwd=data, stdout=subprocess.DEVNULL
        )
    log = data / "server.log"
    with log.open("w") as errors:
        process = subprocess.Popen(
            [*command, "serve", "--port", "0"],
            env=environment,
            cwd=data,
            stdout=subprocess.PIPE,
            stderr=errors,
            text=True,
        )
        try:
            address = _address(process)
            end = time.monotonic() + START_S
            while not _answers(address):
                assert process.poll() is None, log.read_text()[-2000:]
                assert time.monotonic() < end, "the server does not answer"
            yield Server(address, data, process.pid)
        finally:
            process.terminate()
            try:
                process.wait(20)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
            assert process.stdout is not None
            process.stdout.close()
            shutil.rmtree(data, ignore_errors=True)


def _answers(address: str) -> bool:
    from urllib.error import URLError
    from urllib.request import urlopen

    try:
        with urlopen(f"{address}/healthz", timeout=2) as answer:
            return bool(answer.status == 200)
    except (URLError, OSError):
        return False
