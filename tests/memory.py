"""What tests leave behind in circles is collected once it is much."""

from __future__ import annotations

import contextlib
import gc
import os
from collections.abc import Callable
from pathlib import Path

from ground.spare_memory import SpareMemory

GROWN_MIB = 256.0
"""A full collection takes 0.2 s; a rendered site with its pictures and clouds is about so large."""


def resident_mib() -> float:
    """Return the memory that this process holds; 0 where its system does not say."""
    with contextlib.suppress(OSError):
        pages = Path("/proc/self/statm").read_text(encoding="ascii").split()[1]
        return int(pages) * os.sysconf("SC_PAGE_SIZE") / 2**20
    return 0.0


class Leavings:
    """Collects garbage by its size: terrains and pictures are few objects, and the collector counts objects.

    What is freed goes back to the system, so that the next growth is seen.
    """

    def __init__(self, resident: Callable[[], float] = resident_mib) -> None:
        self._resident = resident
        self._settled_mib = resident()
        self._spare = SpareMemory(0.0)

    def clear(self) -> bool:
        """Collect if the process has grown by `GROWN_MIB` since the last time; return whether it had."""
        if self._resident() < self._settled_mib + GROWN_MIB:
            return False
        gc.collect()
        self._spare.give_back()
        self._settled_mib = self._resident()
        return True
