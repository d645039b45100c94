"""Jobs are done elsewhere: by a worker of its own on the same database, or on a cluster."""

from __future__ import annotations

import dataclasses
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from ground.gdr.repository import Repository
from ground.jobs.executors import InlineExecutor
from ground.jobs.row import JobRow
from ground.jobs.worker import Worker
from ground.resources.missions.value import Mission
from ground.resources.path_networks.bodies import PathNetworkCreate
from ground.resources.path_networks.build_path_network import build_path_network
from ground.settings import ExecutorKind, SettingsError, load_settings
from tests.ground.conftest import PLANNER, yard
from tests.ground.killed import KINDS, queue_job

ROOT = Path(__file__).resolve().parents[2]


def test_a_worker_of_its_own_does_the_jobs_of_the_same_database(repo: Repository, mission: Mission) -> None:
    job = build_path_network(repo, PLANNER, mission.id, PathNetworkCreate())
    environment = {
        **os.environ,
        "OUTCROP_DATA_DIR": str(repo.data_dir),
        "OUTCROP_DATABASE_URL": repo.database.url.render_as_string(hide_password=False),
        "OUTCROP_EXECUTOR": "inline",
    }
    command = [sys.executable, "-m", "ground.cli", "worker", "--once"]
    done = subprocess.run(command, env=environment, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    with repo.database.read() as session:
        row = session.get_one(JobRow, job.id)
        assert (row.state, row.attempt) == ("succeeded", 1)
        assert row.worker
        assert not row.worker.endswith(f":{os.getpid()}")


def test_a_cluster_without_its_package_is_refused_at_start(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ground.settings.find_spec", lambda _name: None)
    with pytest.raises(SettingsError, match="extra `cluster`"):
        load_settings(data_dir=tmp_path, executor="distributed", dask_scheduler="tcp://127.0.0.1:1")


class DaskLike:
    """Dask's client and executor as far as a worker meets them: `shutdown` knows no `cancel_futures`."""

    closed = 0
    status = "running"

    def __init__(self, _address: str, *, timeout: float, set_as_default: bool) -> None:
        assert timeout > 0
        assert not set_as_default
        self._inner = InlineExecutor()

    def get_executor(self, *, pure: bool) -> DaskLike:
        assert not pure
        return self

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Any:
        return self._inner.submit(fn, *args, **kwargs)

    def shutdown(self, wait: bool = True) -> None:
        assert not wait

    def close(self, timeout: float) -> None:
        assert timeout > 0
        DaskLike.closed += 1


def test_a_worker_on_a_cluster_ends_its_connection(
    sqlite_repo: Repository, terrain_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", SimpleNamespace(Client=DaskLike))
    monkeypatch.setattr("ground.jobs.executors.knock", lambda _address: None)
    mission = yard(sqlite_repo, terrain_folder)
    job = queue_job(sqlite_repo, mission.id)
    there = {"executor": ExecutorKind.DISTRIBUTED, "dask_scheduler": "tcp://127.0.0.1:1"}
    repo = dataclasses.replace(sqlite_repo, settings=sqlite_repo.settings.model_copy(update=there))
    assert Worker(repo, KINDS, slots=1).run_until_idle() == 1
    with repo.database.read() as session:
        assert session.get_one(JobRow, job).state == "succeeded"
    assert DaskLike.closed == 1
