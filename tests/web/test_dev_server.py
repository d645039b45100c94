"""`npm run dev`: changes made in its page reach the server, which refuses those of foreign pages."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import pytest

from tests.web.conftest import ROOT, Server
from tests.web.missions import small_mission

pytestmark = [pytest.mark.browser, pytest.mark.slow, pytest.mark.xdist_group("browser")]


@pytest.fixture
def dev_server(server: Server) -> Iterator[str]:
    """The address of Vite's server before the real one."""
    command = [sys.executable, str(ROOT / "scripts" / "build_web.py"), "npm", "run", "dev"]
    process = subprocess.Popen(
        [*command, "--", "--port", "5199", "--clearScreen", "false"],
        env=dict(os.environ, OUTCROP_URL=server.address, NO_COLOR="1"),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )
    assert process.stdout is not None
    try:
        printed = []
        for line in process.stdout:
            printed.append(line)
            if found := re.search(r"http://localhost:\d+", line):
                yield found.group()
                break
        else:
            raise AssertionError("".join(printed))
    finally:
        os.killpg(process.pid, signal.SIGTERM)
        process.wait(20)
        process.stdout.close()


def _post(address: str, origin: str, mission: str) -> int:
    request = Request(
        f"{address}/api/v1/missions/{mission}/targets",
        json.dumps({"east_m": 1.0, "north_m": 1.0}).encode(),
        {"X-Outcrop-Person": "Planner", "Content-Type": "application/json", "Origin": origin},
    )
    try:
        with urlopen(request, timeout=60) as answer:
            return int(answer.status)
    except HTTPError as err:
        return err.code


def test_a_change_in_the_page_of_the_dev_server_is_taken(server: Server, dev_server: str) -> None:
    mission = small_mission(server, "Dev", targets=0)
    assert _post(server.address, dev_server, mission) == 403, "a foreign page"
    assert _post(dev_server, dev_server, mission) == 201
