"""What a worker counts of its jobs: attempts, leases that were lost, how long they took and what they held.

Written beside its presence, for whoever makes metrics of it: a worker by itself answers no requests.
"""

from __future__ import annotations

import contextlib
import json
from bisect import bisect_left
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from ground.jobs.presence import TALLY, still_heard

SECONDS = (0.1, 0.5, 2.0, 10.0, 30.0, 120.0, 600.0, 3600.0, 14_400.0)
"""From a dry run to a live day."""
BYTES = tuple(float(2**n * 2**20) for n in range(6, 14))
"""64 MiB, an interpreter with numpy, to 8 GiB."""


@dataclass(slots=True)
class Spread:
    """How many values lie up to each bound and above the one before, the last beyond all; and their sum."""

    counts: list[int]
    total: float = 0.0

    def add(self, bounds: tuple[float, ...], value: float) -> None:
        """Count one value."""
        self.counts[bisect_left(bounds, value)] += 1
        self.total += value


@dataclass(slots=True)
class KindTally:
    """What was counted of one kind of job since the worker began; `seconds`, `memory` when attempts ended."""

    attempts: int = 0
    leases_lost: int = 0
    seconds: Spread = field(default_factory=lambda: Spread([0] * (len(SECONDS) + 1)))
    memory: Spread = field(default_factory=lambda: Spread([0] * (len(BYTES) + 1)))

    def ended(self, seconds: float, peak_bytes: int) -> None:
        """Count an attempt that ended; the memory of one that ended without a result is not known (0)."""
        self.seconds.add(SECONDS, seconds)
        if peak_bytes:
            self.memory.add(BYTES, peak_bytes)


class Tally(defaultdict[str, KindTally]):
    """What a worker counted, by kind of job."""

    def __init__(self) -> None:
        super().__init__(KindTally)

    def text(self) -> str:
        """Return it as a file holds it."""
        return json.dumps({kind: asdict(counted) for kind, counted in self.items()})


def tallies(folder: Path) -> Mapping[str, Mapping[str, KindTally]]:
    """Return what the workers that are there have counted, by the name of their file.

    A file that is damaged, or of a version with other bounds, is left out.
    """
    found = {}
    for path, _ in still_heard(folder, TALLY):
        with contextlib.suppress(OSError, ValueError, TypeError, LookupError, AttributeError):
            told = json.loads(path.read_text(encoding="utf-8"))
            found[path.stem] = {kind: _counted(counted) for kind, counted in told.items()}
    return found


def _counted(told: Mapping[str, Any]) -> KindTally:
    seconds, memory = Spread(**told["seconds"]), Spread(**told["memory"])
    if (len(seconds.counts), len(memory.counts)) != (len(SECONDS) + 1, len(BYTES) + 1):
        raise ValueError("other bounds")
    return KindTally(told["attempts"], told["leases_lost"], seconds, memory)
