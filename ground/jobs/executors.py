"""Where a job's work is done: here, in a process, on a cluster; and the word it leaves of its progress."""

from __future__ import annotations

import json
import logging
import socket
import time
from collections.abc import Callable
from concurrent.futures import Executor, Future
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from ground.errors import JobFailedError
from ground.jobs.queue import Work
from ground.settings import ExecutorKind, Settings
from mission import MissionError
from mission.codec import Codec, Document


@dataclass(slots=True)
class _Channel:
    """Word between work and worker: a file with the progress, a file that says stop."""

    folder: str
    name: str
    last: float = field(default=0.0)

    def report(self, progress: float, message: str) -> None:
        now = time.monotonic()
        if now - self.last < 0.1 and progress < 1.0:
            return
        self.last = now
        path = Path(self.folder) / f"{self.name}.progress"
        draft = path.with_suffix(".draft")
        draft.write_text(json.dumps([progress, message]), encoding="utf-8")
        draft.replace(path)

    def should_stop(self) -> bool:
        return (Path(self.folder) / f"{self.name}.stop").exists()


def run_work(work: Work, orders: Codec[Any], payload: Document, folder: str, name: str) -> Document:
    """Do the work in this process; BLAS keeps to one thread.

    Raises
    ------
    JobFailedError
        If the order in the job's row cannot be read: it is of a newer version, or damaged.
    """
    from threadpoolctl import threadpool_limits

    channel = _Channel(folder, name)
    try:
        order = orders.from_document(payload)
    except MissionError as err:
        raise JobFailedError(str(err)) from err
    with threadpool_limits(limits=1):
        return work(order, channel.report, channel.should_stop)


class InlineExecutor(Executor):
    """Does the work at once in the caller's thread; for tests and commands."""

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as err:  # noqa: BLE001 - the future tells it to whoever asks
            future.set_exception(err)
        return future


KNOCK_S = 2.0
"""For the port of a scheduler to answer. Dask itself tries for 30 s, and leaves a thread and three files open
each time that it gives up.
"""
HELLO_S = 10.0
"""For a scheduler whose port answers to say what it is."""
CLOSE_S = 5.0


def knock(address: str) -> None:
    """Raise OSError unless something listens at the address of a Dask scheduler."""
    place = urlsplit(address if "//" in address else f"tcp://{address}")
    try:
        socket.create_connection((place.hostname or "", place.port or 8786), KNOCK_S).close()
    except OSError as err:
        raise OSError(f"the Dask scheduler {address} does not answer ({err.strerror or err})") from err


class ClusterExecutor(Executor):
    """Does the work on a Dask cluster, over a connection of its own that ends with it.

    Dask's own executor takes no `cancel_futures`: without waiting it always cancels what is not done.

    Raises
    ------
    OSError
        If no scheduler answers at the address, within seconds.
    """

    def __init__(self, address: str) -> None:
        knock(address)
        from distributed import Client

        logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # the worker tells it in a line
        self._client = Client(address, timeout=HELLO_S, set_as_default=False)
        self._inner: Executor = self._client.get_executor(pure=False)

    @property
    def lost(self) -> bool:
        """Return whether the scheduler is gone; what was sent to it will never come back."""
        return bool(self._client.status != "running")

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        return self._inner.submit(fn, *args, **kwargs)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        self._inner.shutdown(wait=wait and not cancel_futures)
        self._client.close(timeout=CLOSE_S)


def _quiet() -> None:
    """Leave Ctrl-C to the server: it hands its jobs back itself."""
    import signal

    signal.signal(signal.SIGINT, signal.SIG_IGN)


def make_executor(settings: Settings) -> Executor:
    """Return an executor for one slot of a worker."""
    match settings.executor:
        case ExecutorKind.INLINE:
            return InlineExecutor()
        case ExecutorKind.DISTRIBUTED:
            return ClusterExecutor(settings.dask_scheduler)
        case ExecutorKind.PROCESS:
            import multiprocessing
            from concurrent.futures import ProcessPoolExecutor

            context = multiprocessing.get_context("forkserver")
            return ProcessPoolExecutor(1, mp_context=context, initializer=_quiet)
