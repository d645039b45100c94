"""Memory that a process has freed, given back to the system.

glibc keeps what is freed, spread over an arena for each thread: a server whose objects took 240 MiB held 430
after a few sols of requests and jobs, and a little more after each. Where the C library has no
`malloc_trim`, nothing is done.
"""

from __future__ import annotations

import ctypes
import threading
import time
from collections.abc import Callable
from functools import cache

LOOK_S = 30.0
"""How often a server gives back."""

SERVED_S, WORKED_S = 0.05, 0.5
"""Processor seconds since the last time before which a server, or a process that does jobs, gives nothing
back: to do so takes some hundredths of one, and who did nothing has nothing.
"""


@cache
def _trim() -> Callable[[int], int] | None:
    try:
        return ctypes.CDLL(None).malloc_trim
    except (AttributeError, OSError, TypeError):
        return None


class SpareMemory:
    """Gives a process's freed memory back once it has used `used_s` of a processor since the last time.

    How much a process holds does not tell when: what was in use at the last time may be free by now.
    """

    def __init__(self, used_s: float) -> None:
        self.used_s = used_s
        self._lock = threading.Lock()
        self._last_s = 0.0
        self._over = threading.Event()
        self._thread: threading.Thread | None = None

    def give_back(self) -> bool:
        """Give memory back if the process has worked; return whether it was tried."""
        trim = _trim()
        with self._lock:
            if trim is None or time.process_time() - self._last_s < self.used_s:
                return False
            trim(0)
            self._last_s = time.process_time()
        return True

    def start(self) -> None:
        """Give back now and then, in a thread, until stopped."""
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


OF_JOBS = SpareMemory(WORKED_S)
"""That of a process that does jobs."""
