"""The Dask engine: same rows, workers of another version refused, a lost cluster told in a line."""

from __future__ import annotations

import contextlib
import re
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from ground.campaigns import dask_engine
from ground.campaigns.case import Case
from ground.campaigns.conduct import Conduct, Plan, make_order
from ground.campaigns.dask_engine import DaskEngine
from ground.campaigns.engines import HereEngine
from ground.campaigns.folder import CampaignFolder
from ground.campaigns.inputs import read_case
from ground.cluster import Cluster, program
from ground.errors import UnavailableError
from tests.ground.campaigns.small import write_small


class FakeFuture:
    """A future of a cluster, done when it is asked for."""

    count = 0

    def __init__(self, fn: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
        FakeFuture.count += 1
        self.key, self._fn, self._arguments = f"unit-{FakeFuture.count}", fn, arguments

    def result(self) -> Any:
        return self._fn(*self._arguments)


class FakeCluster:
    """A scheduler with two workers, as far as the engine meets it; the last unit handed in comes first."""

    def __init__(self) -> None:
        self.away = False
        self.versions = {"tcp://a": program(), "tcp://b": program()}
        self.lost_after = 10**9
        self.closed = False

    def client(self, address: str, *, timeout: float, set_as_default: bool) -> Any:
        assert (timeout, set_as_default) == (dask_engine.WAIT_S, False)
        if self.away:
            raise OSError(f"Timed out trying to connect to {address}")
        return SimpleNamespace(
            wait_for_workers=lambda _count, timeout: None,
            run=lambda _fn: self.versions,
            scatter=lambda case, **_how: case,
            nthreads=lambda: dict.fromkeys(self.versions, 1),
            submit=lambda fn, *arguments, pure: FakeFuture(fn, arguments),
            close=lambda: setattr(self, "closed", True),
            loop="the client's",
        )

    def as_completed(self, *, loop: str) -> Any:
        assert (loop, self.closed) == ("the client's", False)
        cluster, held = self, list[FakeFuture]()

        class Completed:
            def add(self, future: FakeFuture) -> None:
                held.append(future)

            def __next__(self) -> FakeFuture:
                cluster.lost_after -= 1
                if cluster.lost_after < 0:
                    raise type("FutureCancelledError", (Exception,), {})("unit-1 was cancelled")
                return held.pop()

        return Completed()


@pytest.fixture
def cluster(monkeypatch: pytest.MonkeyPatch) -> FakeCluster:
    made = FakeCluster()
    fake = SimpleNamespace(Client=made.client, as_completed=made.as_completed)
    monkeypatch.setitem(sys.modules, "distributed", fake)
    return made


@pytest.fixture
def case(tmp_path: Path) -> Case:
    return read_case(*write_small(tmp_path), "abstract")


def fly(case: Case, out: Path, engine: Any, *, resume: bool = False) -> None:
    order = make_order(case, 1, help_runs=50)
    folder = CampaignFolder(out)
    folder.open(order, resume=resume)
    with contextlib.closing(engine):
        Conduct(folder, order, Plan(1150)).run(engine)


def contents(folder: Path) -> dict[str, bytes]:
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def test_a_cluster_leaves_the_same_bytes_and_is_let_go(
    case: Case, tmp_path: Path, cluster: FakeCluster
) -> None:
    fly(case, tmp_path / "here", HereEngine())
    fly(case, tmp_path / "dask", DaskEngine(Cluster("tcp://127.0.0.1:1")))
    assert contents(tmp_path / "here") == contents(tmp_path / "dask")
    assert cluster.closed


def test_a_lost_cluster_is_told_and_gone_on_with(case: Case, tmp_path: Path, cluster: FakeCluster) -> None:
    cluster.lost_after = 4
    with pytest.raises(UnavailableError, match=r"was lost \(FutureCancelledError\); --resume goes on"):
        fly(case, tmp_path / "dask", DaskEngine(Cluster("tcp://127.0.0.1:1")))
    assert len(list((tmp_path / "dask" / "units").iterdir())) == 4
    fly(case, tmp_path / "dask", HereEngine(), resume=True)
    fly(case, tmp_path / "here", HereEngine())
    assert contents(tmp_path / "here") == contents(tmp_path / "dask")


def test_workers_of_another_version_are_refused(cluster: FakeCluster) -> None:
    cluster.versions["tcp://b"] = "0.0.1"
    ours = program()
    said = re.escape(f"worker tcp://b runs outcrop 0.0.1; this program is {ours}")
    with pytest.raises(UnavailableError, match=said):
        DaskEngine(Cluster("tcp://127.0.0.1:1"))
    assert cluster.closed


def test_a_scheduler_that_is_not_there_is_told(cluster: FakeCluster) -> None:
    cluster.away = True
    with pytest.raises(UnavailableError, match=r"no Dask scheduler answers at tcp://127.0.0.1:1 within 30 s"):
        DaskEngine(Cluster("tcp://127.0.0.1:1"))
