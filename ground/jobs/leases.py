"""Keeps the leases of running jobs from running out, in a thread that never waits for work or engines."""

from __future__ import annotations

import logging
import threading
from dataclasses import dataclass

from ground.gdr.repository import Repository
from ground.jobs.queue import Claim, extend
from ground.tracing import within

logger = logging.getLogger(__name__)


@dataclass(slots=True)
class Held:
    """A lease that is kept: `ours` until another worker has the job, `cancel` when the job is to stop."""

    claim: Claim
    ours: bool = True
    cancel: bool = False


class LeaseKeeper:
    """Renews what it is told to hold, three times in the length of a lease.

    A database that does not answer is asked again; meanwhile the fencing token keeps results right.
    """

    def __init__(self, repo: Repository) -> None:
        self._repo = repo
        self._held: dict[str, Held] = {}
        self._lock = threading.Lock()
        self._wake = threading.Event()
        self._thread: threading.Thread | None = None

    def hold(self, claim: Claim) -> Held:
        """Keep a lease from now on."""
        held = Held(claim)
        with self._lock:
            self._held[claim.job_id] = held
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name="leases", daemon=True)
                self._thread.start()
        return held

    def release(self, held: Held) -> None:
        """Keep it no longer; the thread ends with the last one."""
        with self._lock:
            if self._held.get(held.claim.job_id) is held:
                del self._held[held.claim.job_id]
        self._wake.set()

    def _run(self) -> None:
        while True:
            self._wake.wait(self._repo.settings.job_lease_s / 3)
            self._wake.clear()
            with self._lock:
                held = list(self._held.values())
                if not held:
                    self._thread = None
                    return
            for lease in held:
                self._renew(lease)

    def _renew(self, lease: Held) -> None:
        with within(lease.claim.traceparent):
            try:
                lease.ours, lease.cancel = extend(self._repo, lease.claim)
            except Exception:
                logger.exception("a lease cannot be renewed", extra={"job_id": lease.claim.job_id})
