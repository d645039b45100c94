"""Processor time of a piece of work, and of a fixed loop that says what the machine is worth now."""

from __future__ import annotations

import gc
import statistics
import time
from collections.abc import Callable
from typing import Any

STEPS = 2_000_000


def spent(work: Callable[[], Any]) -> float:
    """Return the processor seconds of a piece of work, garbage collected before it."""
    gc.collect()
    began = time.process_time()
    work()
    return time.process_time() - began


def median_spent(work: Callable[[], Any], repeat: int) -> float:
    """Return the median of the processor seconds of several runs."""
    return statistics.median(spent(work) for _ in range(repeat))


def quantile(values: list[float], share: float) -> float:
    """Return the value below which a share of the values lies."""
    return sorted(values)[min(len(values) - 1, int(share * len(values)))]


def yardstick() -> float:
    """Return the processor seconds of a fixed loop."""

    def loop() -> None:
        total = 0
        for n in range(STEPS):
            total += n & 7
        assert total

    return spent(loop)
