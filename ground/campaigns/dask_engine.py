"""Units on a Dask cluster: every worker must run this program in this version."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from typing import Any

from ground.campaigns.case import Case, Cases
from ground.campaigns.engines import Engine, HereEngine
from ground.campaigns.units import Unit, fly_noted
from ground.cluster import Cluster, do_as, program
from ground.errors import UnavailableError
from ground.tracing import Part, note_part

WAIT_S = 30.0
"""For the scheduler to answer, and for a first worker."""
AHEAD = 4
"""Units on the way for each thread of the cluster."""

Bring = Callable[[], object]


def nothing() -> None:
    """Bring nothing: a case of the abstract rover needs no files."""


class DaskEngine:
    """Flies on the workers of a scheduler.

    Raises
    ------
    UnavailableError
        If `distributed` is not installed, nothing answers at the address, it is beyond loopback without
        TLS, or a worker runs another program.
    """

    def __init__(self, cluster: Cluster) -> None:
        scheduler = cluster.address
        if not scheduler:
            raise UnavailableError("--engine dask needs OUTCROP_DASK_SCHEDULER, the scheduler's address")
        if refusal := cluster.refusal():
            raise UnavailableError(refusal)
        try:
            from distributed import Client
        except ImportError as err:
            raise UnavailableError(
                "--engine dask needs the extra cluster: pip install outcrop[cluster]"
            ) from err
        try:
            self._client: Any = Client(scheduler, timeout=WAIT_S, set_as_default=False, **cluster.options())
        except (OSError, TimeoutError, ValueError) as err:
            raise UnavailableError(f"no Dask scheduler answers at {scheduler} within {WAIT_S:g} s") from err
        try:
            self._check(scheduler)
        except BaseException:
            self._client.close()
            raise

    def _check(self, scheduler: str) -> None:
        try:
            self._client.wait_for_workers(1, timeout=WAIT_S)
        except TimeoutError as err:
            raise UnavailableError(f"the Dask scheduler at {scheduler} has no worker") from err
        ours = program()
        try:
            found = self._client.run(program)
        except Exception as err:  # whatever the worker's import raises is sent here
            raise UnavailableError(f"a Dask worker cannot import outcrop: {err}") from err
        for worker, theirs in sorted(found.items()):
            if theirs != ours:
                raise UnavailableError(
                    f"the Dask worker {worker} runs outcrop {theirs}; this program is {ours}"
                )

    def fly(
        self, cases: Cases, units: Iterable[Unit], should_stop: Callable[[], bool]
    ) -> Iterator[tuple[Unit, str]]:
        try:
            yield from _fly_on(self._client, cases, units, should_stop, nothing)
        except Exception as err:
            raise self._told(err) from err

    def close(self) -> None:
        """End the connection."""
        self._client.close()

    def _told(self, err: Exception) -> Exception:
        """Return what a lost connection means; other errors as they are."""
        name = type(err).__name__
        if name in {
            "CancelledError",
            "FutureCancelledError",
            "ClosedClientError",
            "CommClosedError",
            "KilledWorker",
        }:
            return UnavailableError(
                f"the Dask cluster was lost ({name}); --resume goes on with what is there"
            )
        return err


class AroundEngine:
    """Flies on the cluster whose worker this is done by, which has its thread free meanwhile.

    What is lost there is not told in words: the worker of the service knows such errors of an engine.

    Parameters
    ----------
    bring
        Called before each unit where it is flown: brings to that machine what it has not got.
    """

    def __init__(self, bring: Bring) -> None:
        self._bring = bring

    def close(self) -> None: ...

    def fly(
        self, cases: Cases, units: Iterable[Unit], should_stop: Callable[[], bool]
    ) -> Iterator[tuple[Unit, str]]:
        from distributed import worker_client

        with worker_client() as client:
            yield from _fly_on(client, cases, units, should_stop, self._bring)


def engine_here(bring: Bring) -> Engine:
    """Return the engine of the cluster whose worker this is done by; without one that of this process.

    `bring` brings what a machine needs of files; it is sent to others.
    """
    distributed = sys.modules.get("distributed")
    if distributed is not None:
        try:
            distributed.get_worker()
        except ValueError:
            pass
        else:
            return AroundEngine(bring)
    bring()
    return HereEngine()


def _fly_on(
    client: Any, cases: Cases, units: Iterable[Unit], should_stop: Callable[[], bool], bring: Bring
) -> Iterator[tuple[Unit, str]]:
    from distributed import as_completed

    held = {name: client.scatter(case, broadcast=False, hash=False) for name, case in cases.items()}
    ours = program()
    left = iter(units)
    threads = max(1, sum(client.nthreads().values()))
    open_: dict[str, Unit] = {}
    done = as_completed(loop=client.loop)

    def more() -> None:
        while len(open_) < AHEAD * threads and not should_stop():
            unit = next(left, None)
            if unit is None:
                return
            future = client.submit(do_as, ours, _fly_there, held[unit.series], unit, bring, pure=False)
            open_[future.key] = unit
            done.add(future)

    more()
    while open_:
        future = next(done)
        unit = open_.pop(future.key)
        text, part = future.result()
        note_part(part)
        more()
        yield unit, text


def _fly_there(case: Case, unit: Unit, bring: Bring) -> tuple[str, Part]:
    bring()
    return fly_noted(case, unit)
