"""What a process has freed goes back to the system."""

from __future__ import annotations

import gc
import subprocess
import sys
import time
import weakref
from pathlib import Path

import pytest

from ground import spare_memory
from ground.app.service import build_app
from ground.gdr.repository import Repository
from ground.spare_memory import SpareMemory

FRAGMENTED = """
import gc, os, threading
from ground.spare_memory import SpareMemory
from studies.common.processes import resident_mib

pins = []

def work():
    kept = [bytes(600 + k % 4000) for k in range(12_000)]
    pins.append(kept[::400])  # what stays lies among what goes

for _ in range(3):
    threads = [threading.Thread(target=work) for _ in range(8)]
    [t.start() for t in threads]
    [t.join() for t in threads]
gc.collect()
spare = SpareMemory(0.02)
before = resident_mib(os.getpid())
tried = spare.give_back()
print(before, resident_mib(os.getpid()), tried, spare.give_back())
"""


@pytest.mark.skipif(
    spare_memory._trim() is None or not Path("/proc/self/smaps_rollup").exists(),
    reason="no malloc_trim here (glibc has it), or no word of what a process holds (Linux)",
)
def test_freed_memory_goes_back_and_only_of_a_process_that_worked() -> None:
    done = subprocess.run([sys.executable, "-c", FRAGMENTED], capture_output=True, text=True, check=True)
    before, after, tried, again = done.stdout.split()
    assert (tried, again) == ("True", "False")
    assert float(after) < 0.6 * float(before)


def test_a_service_that_nobody_holds_any_more_is_gone(sqlite_repo: Repository) -> None:
    """With its database's compiled statements: a suite that opens thousands would hold them all."""
    app = build_app(sqlite_repo, with_worker=False)
    there = weakref.ref(app)
    del app
    gc.collect()
    assert there() is None


def test_without_the_function_nothing_is_done(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(spare_memory, "_trim", lambda: None)
    assert not SpareMemory(0.0).give_back()


def test_a_server_looks_now_and_then_until_it_is_stopped(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(spare_memory, "LOOK_S", 0.001)
    frozen: list[int] = []
    monkeypatch.setattr(gc, "freeze", lambda: frozen.append(1))
    # a full one takes ten seconds in a process that has held thousands of tests
    monkeypatch.setattr(gc, "collect", lambda: 0)
    asked = []
    spare = SpareMemory(0.0)
    monkeypatch.setattr(spare, "give_back", lambda: asked.append(1))
    spare.start()
    end = time.monotonic() + 10.0
    while len(asked) < 3 and time.monotonic() < end:
        time.sleep(0.001)
    spare.stop()
    assert len(asked) >= 3
    assert len(frozen) == 1  # what it began with, and no more
    count = len(asked)
    assert spare._thread is not None
    assert not spare._thread.is_alive()
    assert len(asked) == count


LARGE = """
import os
import numpy as np
from ground.spare_memory import keep_together
from studies.common.processes import resident_mib

if {together}:
    keep_together()
before = resident_mib(os.getpid())
pins = []
for _ in range(40):
    large = [np.ones(2_000_000 // 8) for _ in range(10)]
    pins.append(bytes(3000))  # what stays lies behind what goes
    del large
print(resident_mib(os.getpid()) - before)
"""


def _left_over(together: bool) -> float:
    code = LARGE.format(together=together)
    return float(subprocess.run([sys.executable, "-c", code], capture_output=True, check=True).stdout)


@pytest.mark.skipif(
    spare_memory._trim() is None or not Path("/proc/self/smaps_rollup").exists(),
    reason="no malloc_trim here (glibc has it), or no word of what a process holds (Linux)",
)
def test_large_arrays_go_back_where_they_have_places_of_their_own() -> None:
    left = _left_over(True)
    assert left < 4.0
    assert left < 0.5 * _left_over(False)


def test_a_process_without_the_function_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []
    monkeypatch.setattr(spare_memory, "_of_c", lambda name: asked.append(name))
    spare_memory.keep_together()
    assert asked == ["mallopt"]
