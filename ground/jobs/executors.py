"""Where a job's work is done: here, in a process, on a cluster; and the word it leaves of its progress."""

from __future__ import annotations

import contextlib
import json
import logging
import socket
import sys
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Executor, Future
from dataclasses import dataclass, field
from functools import lru_cache
from multiprocessing import parent_process
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from ground.cluster import Cluster, do_as, program
from ground.errors import JobFailedError
from ground.jobs.queue import Work
from ground.logs import set_up_logging
from ground.settings import ExecutorKind, Settings
from ground.spare_memory import OF_JOBS, keep_together
from ground.tracing import Part, noting_parts, now_ns, this_place, within
from mission import MissionError
from mission.codec import Codec

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController

STOP_LOOK_S = 0.02
"""How late work may learn that it is to stop: a look at each event of a run took a fifteenth of its time."""


@dataclass(slots=True)
class _Channel:
    """Word between work and worker: a file with the progress, a file that says stop."""

    folder: str
    name: str
    last: float = field(default=0.0)
    looked: float = field(default=0.0)
    stopping: bool = field(default=False)

    def report(self, progress: float, message: str) -> None:
        now = time.monotonic()
        if now - self.last < 0.1 and progress < 1.0:
            return
        self.last = now
        path = Path(self.folder) / f"{self.name}.progress"
        path.parent.mkdir(parents=True, exist_ok=True)  # on a machine of a cluster nobody may have made it
        draft = path.with_suffix(".draft")
        draft.write_text(json.dumps([progress, message]), encoding="utf-8")
        draft.replace(path)

    def should_stop(self) -> bool:
        """Return whether the work is to stop; the file is looked for no oftener than anybody could notice."""
        now = time.monotonic()
        if not self.stopping and now - self.looked >= STOP_LOOK_S:
            self.looked = now
            self.stopping = (Path(self.folder) / f"{self.name}.stop").exists()
        return self.stopping


@dataclass(frozen=True, slots=True)
class Done:
    """What work came to, and beside it when and in which process it was done, the most that this held, and
    where it is traced its parts.
    """

    result: Mapping[str, object]
    began_ns: int
    ended_ns: int
    place: str
    peak_bytes: int
    parts: tuple[Part, ...] = ()


def forget_peak() -> None:
    """Have the most memory that this process ever held counted from now on, where its system can (Linux)."""
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")


def peak_bytes() -> int:
    """Return the most memory that this process held; 0 where its system does not say."""
    with contextlib.suppress(OSError):
        for line in Path("/proc/self/status").read_text(encoding="ascii", errors="replace").splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024
    return 0


@lru_cache(maxsize=1)
def _libraries(_modules: int) -> ThreadpoolController:
    """Return the libraries that have threads; with more modules loaded, which may have brought one, anew.

    To look for them takes 2 ms, a twentieth of a dry run.
    """
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


def run_work(
    work: Work,
    orders: Codec[Any],
    payload: Mapping[str, object],
    folder: str,
    name: str,
    traceparent: str = "",
) -> Done:
    """Do the work in this process, within the trace that it belongs to; BLAS keeps to one thread.

    Raises
    ------
    JobFailedError
        If the order in the job's row cannot be read: it is of a newer version, or damaged.
    """
    channel = _Channel(folder, name)
    try:
        order = orders.from_document(payload)
    except MissionError as err:
        raise JobFailedError(str(err)) from err
    forget_peak()
    began_ns = now_ns()
    with (
        _libraries(len(sys.modules)).limit(limits=1),
        within(traceparent),
        noting_parts(bool(traceparent)) as parts,
    ):
        result = work(order, channel.report, channel.should_stop)
    done = Done(result, began_ns, now_ns(), this_place(), peak_bytes(), tuple(parts))
    if parent_process() is not None:  # a process for jobs alone: in a server's own, the server gives back
        OF_JOBS.give_back()
    return done


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


def is_news(record: logging.LogRecord) -> bool:
    """Return whether a line of Dask's event loop says what the worker does not: not that a lost scheduler
    dropped the work, which comes as a traceback now and then.
    """
    error = record.exc_info[1] if record.exc_info else None
    return type(error).__name__ != "FutureCancelledError"


class ClusterExecutor(Executor):
    """Does the work on a Dask cluster, over a connection of its own that ends with it.

    Dask's own executor takes no `cancel_futures`: without waiting it always cancels what is not done.

    Raises
    ------
    OSError
        If no scheduler answers at the address within seconds, or it is beyond loopback without TLS.
    """

    def __init__(self, cluster: Cluster) -> None:
        if refusal := cluster.refusal():
            raise OSError(refusal)
        knock(cluster.address)
        from distributed import Client

        logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # the worker tells it in a line
        logging.getLogger("tornado.application").addFilter(is_news)
        options: dict[str, Any] = {"timeout": HELLO_S, "set_as_default": False, **cluster.options()}
        try:
            self._client = Client(cluster.address, **options)
        except OSError as err:  # such as a certificate that another authority signed
            reason = (str(err) or type(err).__name__).splitlines()[0]
            raise OSError(f"the Dask scheduler {cluster.address} cannot be used ({reason})") from err
        self._inner: Executor = self._client.get_executor(pure=False)

    @property
    def lost(self) -> bool:
        """Return whether the scheduler is gone; what was sent to it will never come back."""
        return bool(self._client.status != "running")

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        return self._inner.submit(do_as, program(), fn, *args, **kwargs)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        self._inner.shutdown(wait=wait and not cancel_futures)
        self._client.close(timeout=CLOSE_S)


def _begin_process(form: str, level: str) -> None:
    """Log as the server does, and leave Ctrl-C to it: it hands its jobs back itself."""
    import signal

    keep_together()
    set_up_logging(form, level)
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def make_executor(settings: Settings) -> Executor:
    """Return an executor for one slot of a worker."""
    match settings.executor:
        case ExecutorKind.INLINE:
            return InlineExecutor()
        case ExecutorKind.DISTRIBUTED:
            return ClusterExecutor(settings.cluster)
        case ExecutorKind.PROCESS:
            import multiprocessing
            from concurrent.futures import ProcessPoolExecutor

            context = multiprocessing.get_context("forkserver")
            logs = (settings.log_format, settings.log_level)
            return ProcessPoolExecutor(1, mp_context=context, initializer=_begin_process, initargs=logs)
