"""Where units are flown: in this process, in a pool of processes, on a Dask cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, ProcessPoolExecutor, wait
from typing import Protocol

from ground.campaigns.case import Cases
from ground.campaigns.units import Unit, fly_noted, fly_unit
from ground.errors import UnavailableError
from ground.tracing import note_part

DEATHS = 5
"""A pool whose processes die so often without a unit in between has a unit that kills them."""


class Engine(Protocol):
    """Flies units and returns them in any order, each once.

    A process or worker that dies costs the units it had; they are flown again. Ends when `should_stop` says
    so; what is done by then was given.
    """

    def fly(
        self, cases: Cases, units: Iterable[Unit], should_stop: Callable[[], bool]
    ) -> Iterator[tuple[Unit, str]]: ...

    def close(self) -> None:
        """Let go what the engine holds between two series."""


class HereEngine:
    """Flies in this process, in order."""

    def close(self) -> None: ...

    def fly(
        self, cases: Cases, units: Iterable[Unit], should_stop: Callable[[], bool]
    ) -> Iterator[tuple[Unit, str]]:
        for unit in units:
            if should_stop():
                return
            text, part = fly_noted(cases[unit.series], unit)
            note_part(part)
            yield unit, text


class PoolEngine:
    """Flies in processes of this machine."""

    def __init__(self, workers: int) -> None:
        self.workers = workers

    def close(self) -> None: ...

    def _pool(self) -> Executor:
        import multiprocessing

        context = multiprocessing.get_context("forkserver")
        return ProcessPoolExecutor(self.workers, mp_context=context, initializer=_quiet)

    def fly(
        self, cases: Cases, units: Iterable[Unit], should_stop: Callable[[], bool]
    ) -> Iterator[tuple[Unit, str]]:
        left = iter(units)
        again: list[Unit] = []
        deaths = 0
        while True:
            pool = self._pool()
            open_: dict[Future[str], Unit] = {}
            try:
                for unit, text in _drain(pool, cases, again, left, open_, self.workers, should_stop):
                    deaths = 0
                    yield unit, text
                return
            except BrokenExecutor as err:
                deaths += 1
                if deaths >= DEATHS:
                    raise UnavailableError(
                        f"worker processes died {deaths} times in a row at unit {_first(open_)}"
                    ) from err
                again.extend(open_.values())
            finally:
                pool.shutdown(wait=True, cancel_futures=True)


def _first(open_: Mapping[Future[str], Unit]) -> str:
    unit = min(open_.values(), key=lambda u: (u.series, u.index), default=None)
    return "?" if unit is None else f"{unit.series or 'main'} {unit.index}"


def _drain(
    pool: Executor,
    cases: Cases,
    again: list[Unit],
    left: Iterator[Unit],
    open_: dict[Future[str], Unit],
    workers: int,
    should_stop: Callable[[], bool],
) -> Iterator[tuple[Unit, str]]:
    """Keep two units for each process on the way; `open_` holds those that are not done."""
    while True:
        while len(open_) < 2 * workers and not should_stop():
            unit = again.pop() if again else next(left, None)
            if unit is None:
                break
            try:
                open_[pool.submit(fly_unit, cases[unit.series], unit)] = unit
            except BrokenExecutor:
                again.append(unit)
                raise
        if not open_:
            return
        done, _ = wait(open_, return_when=FIRST_COMPLETED)
        for future in sorted(done, key=lambda f: open_[f].index):
            text = future.result()
            yield open_.pop(future), text


def _quiet() -> None:
    """Leave Ctrl-C to the parent, and one thread to the linear algebra."""
    import os
    import signal

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
