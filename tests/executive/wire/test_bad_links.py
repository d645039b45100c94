"""Three rovers keep the contract over a link with jitter, loss and absence."""

from __future__ import annotations

import shutil
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from executive.runtime.wire import Address
from executive.runtime.wire.contract import check_wire
from tests.executive.wire.proxy import BadLink
from tests.executive.wire.servers import served_script

ROOT = Path(__file__).resolve().parents[3]
REFERENCE = ROOT / "examples" / "wire_rover" / "rover.py"
AWAY_S = 6.0
"""How long the link is away here; `studies.live_links` takes the whole minute."""


def wait_for(address: Address) -> None:
    assert address.path is not None
    end = time.monotonic() + 20
    while not address.path.exists():
        assert time.monotonic() < end, f"{address} does not appear"
        time.sleep(0.02)


def compiled(folder: Path) -> Path | None:
    """Return the reference rover in C, None where there is no compiler."""
    compiler = shutil.which("gcc")
    if compiler is None:
        return None
    source, program = Path(__file__).with_name("rover.c"), folder / "rover"
    flags = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-O1"]
    subprocess.run([compiler, *flags, "-o", str(program), str(source), "-lm"], check=True)
    return program


def broken(address: Address, folder: Path, seed: int) -> list[str]:
    """Return what a rover does wrong over a link that is bad and, for a while, away."""
    link = BadLink(folder / f"link-{seed}.sock", address, jitter_s=0.5, loss=0.05, seed=seed)
    done = threading.Event()

    def be_away() -> None:
        done.wait(7.0)
        link.away.set()
        done.wait(AWAY_S)
        link.away.clear()

    thread = threading.Thread(target=be_away)
    thread.start()
    try:
        findings = check_wire(link.address, patience_s=AWAY_S + 14.0)
    finally:
        done.set()
        thread.join()
        link.close()
    assert len(findings) == 11
    assert link.lost > 5, "the link was not bad"
    return [f"{finding.name}: {finding.detail}" for finding in findings if not finding.passed]


def test_the_reference_rover_is_as_short_as_it_says() -> None:
    text = REFERENCE.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 150
    imports = {line.split()[1] for line in text.splitlines() if line.startswith(("import ", "from "))}
    assert imports <= set(sys.stdlib_module_names)


def test_rovers_in_two_languages_and_the_server_keep_the_contract_over_a_bad_link(tmp_path: Path) -> None:
    program = compiled(tmp_path)
    here, there = Address(tmp_path / "python.sock"), Address(tmp_path / "c.sock")
    commands = [[sys.executable, str(REFERENCE), str(here)]]
    if program is not None:
        commands.append([str(program), str(there.path)])
    processes = [subprocess.Popen(command) for command in commands]
    try:
        with served_script(tmp_path / "server.sock") as ours:
            addresses = [here, ours, *([there] if program is not None else [])]
            for address in addresses:
                wait_for(address)
            with ThreadPoolExecutor(len(addresses)) as pool:
                found = pool.map(lambda a: broken(a[1], tmp_path, a[0]), enumerate(addresses))
                assert list(found) == [[] for _ in addresses]
    finally:
        for process in processes:
            process.kill()
            process.wait()
    if program is None:
        pytest.skip("no gcc here: the rover in C was not compiled; the other two passed")
