"""Memory that a process has freed, given back to the system.

glibc keeps what is freed, spread over an arena for each thread: a server whose objects took 240 MiB held 430
after a few sols of requests and jobs, and a little more after each. In few arenas, with large arrays in
places of their own, what is free lies together and can go back. Where the C library has no `malloc_trim` or
`mallopt`, nothing is done.
"""

from __future__ import annotations

import ctypes
import gc
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


M_MMAP_THRESHOLD, M_ARENA_MAX = -3, -8
"""What `mallopt` can be told of (glibc's malloc.h)."""

ARENAS = 2
"""One for the main thread, one for all others: theirs is what Python itself does not keep, a small part."""

OWN_PLACE_BYTES = 1 << 20
"""From here on an array has a place of its own, which goes back when it is freed. Left to itself glibc
raises that to 32 MiB with the largest array that is freed; below, a place of its own costs more time than
filling it.
"""


def _of_c(name: str) -> Callable[..., int] | None:
    try:
        return getattr(ctypes.CDLL(None), name)  # type: ignore[no-any-return]
    except (AttributeError, OSError, TypeError):
        return None


@cache
def _trim() -> Callable[..., int] | None:
    return _of_c("malloc_trim")


def keep_together() -> None:
    """Have this process free memory in a way that it can go back; call before it starts threads."""
    tell = _of_c("mallopt")
    if tell is not None and _trim() is not None:  # others than glibc number what they are told otherwise
        tell(M_ARENA_MAX, ARENAS)
        tell(M_MMAP_THRESHOLD, OWN_PLACE_BYTES)


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
        """Give back now and then, in a thread, until stopped.

        What there is at the first look, a server's code above all, is from then on left out of garbage
        collection: a full one is cheaper and comes more often, so fewer cycles of objects wait for it.
        """
        self._thread = threading.Thread(target=self._look, name="spare-memory", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End the thread."""
        self._over.set()
        if self._thread is not None:
            self._thread.join()

    def _look(self) -> None:
        if not self._over.wait(LOOK_S):
            gc.collect()
            gc.freeze()
            self.give_back()
        while not self._over.wait(LOOK_S):
            self.give_back()


OF_JOBS = SpareMemory(WORKED_S)
"""That of a process that does jobs."""
