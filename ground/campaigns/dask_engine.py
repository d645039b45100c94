"""Units on a Dask cluster: every worker must run this program in this version."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any

from ground.campaigns.case import Cases
from ground.campaigns.units import Unit, fly_unit
from ground.errors import UnavailableError

WAIT_S = 30.0
"""For the scheduler to answer, and for a first worker."""
AHEAD = 4
"""Units on the way for each thread of the cluster."""


def program_version() -> str:
    """Return the version of this program, as each worker must have it."""
    from importlib.metadata import version

    return version("outcrop")


class DaskEngine:
    """Flies on the workers of a scheduler.

    Raises
    ------
    UnavailableError
        If `distributed` is not installed, nothing answers at the address, or a worker runs another version.
    """

    def __init__(self, scheduler: str) -> None:
        if not scheduler:
            raise UnavailableError("--engine dask needs OUTCROP_DASK_SCHEDULER, the scheduler's address")
        try:
            from distributed import Client
        except ImportError as err:
            raise UnavailableError(
                "--engine dask needs the extra cluster: pip install outcrop[cluster]"
            ) from err
        try:
            self._client: Any = Client(scheduler, timeout=WAIT_S, set_as_default=False)
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
        ours = program_version()
        try:
            found = self._client.run(program_version)
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
        from distributed import as_completed

        held = {name: self._client.scatter(case, broadcast=False, hash=False) for name, case in cases.items()}
        left = iter(units)
        threads = max(1, sum(self._client.nthreads().values()))
        open_: dict[str, Unit] = {}
        done = as_completed(loop=self._client.loop)

        def more() -> None:
            while len(open_) < AHEAD * threads and not should_stop():
                unit = next(left, None)
                if unit is None:
                    return
                future = self._client.submit(fly_unit, held[unit.series], unit, pure=False)
                open_[future.key] = unit
                done.add(future)

        try:
            more()
            while open_:
                future = next(done)
                unit = open_.pop(future.key)
                text = future.result()
                more()
                yield unit, text
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
