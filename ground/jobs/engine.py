"""How the engine of a worker fares, and which errors are its fault."""

from __future__ import annotations

import time
from concurrent.futures import CancelledError
from dataclasses import dataclass
from datetime import datetime

from ground.errors import OtherProgramError, StoreAwayError
from ground.gdr.base import utc_now


@dataclass(frozen=True, slots=True)
class EngineState:
    """How the engine of a worker fares: an empty `trouble` is well; `failures` since the worker began."""

    trouble: str = ""
    since_utc: datetime | None = None
    failures: int = 0
    retry_at: float = 0.0
    wait_s: float = 0.0

    def failed(self, err: BaseException, first_s: float, longest_s: float) -> EngineState:
        """Return the state after one more failure: tried again after twice the wait of the one before.

        Failures of several slots within one wait are one death, so they do not make it longer.
        """
        now = time.monotonic()
        same = bool(self.trouble) and now < self.retry_at
        wait_s = self.wait_s if same else min(longest_s, max(first_s, 2 * self.wait_s))
        what = "it dropped the work" if isinstance(err, CancelledError) else str(err)
        return EngineState(
            f"{type(err).__name__}: {what}".rstrip(": "),
            self.since_utc or utc_now(),
            self.failures + 1,
            self.retry_at if same else now + wait_s,
            wait_s,
        )


def of_engine(error: BaseException) -> bool:
    """Return whether an error is the engine's and not the work's: a lost cluster, a cancelled future, a
    worker of another version, or an object store that is away.
    """
    lost = isinstance(error, CancelledError | OtherProgramError | StoreAwayError)
    return lost or (_is_dask(error) and not killed_its_workers(error))


def killed_its_workers(error: BaseException) -> bool:
    """Return whether a cluster gave work up because worker after worker died while doing it (`KilledWorker`).

    Somebody may have killed the workers, or the work did; as with a process that dies, the attempt counts.
    """
    return _is_dask(error) and type(error).__name__ == "KilledWorker"


def _is_dask(error: BaseException) -> bool:
    return type(error).__module__.partition(".")[0] == "distributed"
