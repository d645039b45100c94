"""Two people on the page alone: from an empty folder to three executed sols, in processor time.

A scientist and a flight director, each with a browser profile and a key of their own, click and type what
`tests/web/two_people.py` says. What counts is the processor time of the server with its workers, and of all
processes of the browser, software GL among them; time on the clock stands beside it.
"""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from playwright.sync_api import Page

from benchmarks.common.clock import yardstick
from benchmarks.common.figure import Figure, command
from studies.common.processes import children, cpu_of
from tests.web import two_people
from tests.web.conftest import build_ui, run_server
from tests.web.page import chromium, open_page

MOST_S = 200.0
"""Processor seconds of server and page for three sols."""
QUICK = {"sols": 1}
BUDGET_S = 900.0
QUERY = "?quality=test&webgl=off"


def spent_below(pid: int) -> float:
    """Return the processor seconds of a process and all that it started, also of those that have ended."""
    return cpu_of(pid) + sum(cpu_of(child) for child in children(pid))


def browsers() -> list[int]:
    """Return the browsers that this process has started."""
    names = {pid: _name_of(pid) for pid in children(os.getpid())}
    below = {child for pid, name in names.items() if name.startswith("chrom") for child in children(pid)}
    return [pid for pid, name in names.items() if name.startswith("chrom") and pid not in below]


def _name_of(pid: int) -> str:
    try:
        return Path(f"/proc/{pid}/comm").read_text().strip()
    except OSError:
        return ""


def _products(page: Page) -> float:
    """Return how many data products the page lists."""
    label = page.get_by_role("tab", name="Products").inner_text()
    return float(label.split()[-1])


def figures(sols: int = two_people.SOLS) -> Iterator[Figure]:
    """Yield the processor time of a play, its parts, and what came of it."""
    build_ui()
    yield Figure("yardstick: 2 million steps of a loop", yardstick(), "s")
    with tempfile.TemporaryDirectory(prefix="outcrop-two-people-") as folder:
        data, packages = Path(folder, "data"), Path(folder, "packages")
        data.mkdir()
        packages.mkdir()
        with (
            run_server(data, demo=False, AUTH="accounts") as server,
            chromium() as browser,
            open_page(browser, server, QUERY) as scientist,
            open_page(browser, server, QUERY) as director,
        ):
            began = time.monotonic()
            two_people.play(scientist, director, server, packages, sols=sols)
            wall = time.monotonic() - began
            of_server = spent_below(server.pid)
            of_browser = sum(spent_below(pid) for pid in browsers())
            products = _products(scientist)
    what = f"{sols} {'sol' if sols == 1 else 'sols'} by two people"
    limit = MOST_S if sols == two_people.SOLS else None
    yield Figure(f"{what}, from an empty folder: server and page", of_server + of_browser, "s", limit)
    yield Figure("of it the server and its workers", of_server, "s")
    yield Figure("of it the browser, two profiles, all processes", of_browser, "s")
    yield Figure("time on the clock", wall, "s")
    yield Figure("data products that came back", products, "", 1.0, least=True)


if __name__ == "__main__":
    command(figures, QUICK, BUDGET_S)
