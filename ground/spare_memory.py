"""Memory that a process has freed, given back to the system.

glibc keeps what is freed, spread over an arena for each thread: a server whose objects took 240 MiB held 430
after a few sols of requests and jobs, and a little more after each. Where the C library has no
`malloc_trim`, nothing is done.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import threading
from collections.abc import Callable
from functools import cache
from pathlib import Path

GROWN = 16 << 20
"""Bytes that a process grows by before it is trimmed again: that takes some hundredths of a second."""

LOOK_S = 30.0
"""How often a server looks how much it holds."""


def resident_bytes() -> int:
    """Return what this process holds in memory; 0 where its system does not say (it is Linux that does)."""
    with contextlib.suppress(OSError, ValueError, IndexError):
        return int(Path("/proc/self/statm").read_bytes().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    return 0


@cache
def _trim() -> Callable[[int], int] | None:
    try:
        return ctypes.CDLL(None).malloc_trim
    except (AttributeError, OSError, TypeError):
        return None


class SpareMemory:
    """Gives a process's freed memory back when it has grown by `grown` bytes since that was done last."""

    def __init__(self, grown: int = GROWN) -> None:
        self.grown = grown
        self._lock = threading.Lock()
        self._held = 0
        self._over = threading.Event()
        self._thread: threading.Thread | None = None

    def give_back(self) -> bool:
        """Give memory back if the process has grown; return whether it was tried."""
        trim = _trim()
        with self._lock:
            if trim is None or resident_bytes() < self._held + self.grown:
                return False
            trim(0)
            self._held = resident_bytes()
        return True

    def start(self) -> None:
        """Look now and then, in a thread, until stopped."""
        self._thread = threading.Thread(target=self._look, name="spare-memory", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End the thread."""
        self._over.set()
        if self._thread is not None:
            self._thread.join()

    def _look(self) -> None:
        while not self._over.wait(LOOK_S):
            self.give_back()


SPARE = SpareMemory()
"""That of this process."""
