"""What the simulated rover of a dry run is told of its world."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from benchmarks.dry_run import order_for
from executive.runtime.journal import FileJournal
from ground.errors import JobFailedError
from ground.gdr.files import FileStore
from ground.resources.runs import work as run_work
from ground.resources.runs.order import RunWork
from ground.uplink.flight import Flight
from mission import Sky
from rover_iface.errors import RoverError
from rover_iface.simulator.world import load_world
from rover_iface.terrain import generate_terrain, write_terrain
from tests.planner.examples import problem_document


def test_a_dry_run_is_of_the_missions_rover_at_the_sols_hour(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[Any] = []

    def make_rover(world: Any, **_options: object) -> None:
        seen.append(load_world(world))
        raise RoverError("seen enough")

    monkeypatch.setattr(run_work, "find_rover", lambda _name: make_rover)
    write_terrain(generate_terrain(1, size_m=32.0), tmp_path / "terrain")
    order = RunWork(
        "run_1",
        run_dir=str(tmp_path / "run"),
        files_dir=str(tmp_path / "files"),
        terrain_dir=str(tmp_path / "terrain"),
        crl_text="",
        problem=problem_document(),
        rover="abstract",
        seed=1,
        rover_profile="mer",
        sky=Sky(start_lmst_h=14.5),
    )
    with pytest.raises(JobFailedError, match="seen enough"):
        run_work.work(order, lambda _share, _what: None, lambda: False)
    (world,) = seen
    assert (world.profile.name, world.sun.start_lmst_h) == ("mer", 14.5)
    assert world.problem == order.problem


def test_what_a_job_keeps_of_its_run_is_what_the_folder_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    order = order_for(tmp_path)
    order = replace(order, run_dir=str(tmp_path / "run"), files_dir=str(tmp_path / "files"))
    read: list[run_work.RunResult] = []
    real = run_work.result_of

    def both(flight: Flight, store: FileStore, stored: Mapping[str, Any]) -> run_work.RunResult:
        read.append(run_work.read_run_folder(flight.folder, store, stored))
        return real(flight, store, stored)

    monkeypatch.setattr(run_work, "result_of", both)
    kept = run_work.work(order, lambda _share, _what: None, lambda: False)
    assert kept == read[0]
    assert kept["products"]


def test_a_run_that_need_not_survive_the_machine_waits_for_no_disk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced: list[int] = []
    monkeypatch.setattr(os, "fsync", synced.append)
    FileJournal.create(tmp_path / "a" / "journal.jsonl", sync=False).close()
    assert synced == []
    FileJournal.create(tmp_path / "b" / "journal.jsonl").close()
    assert len(synced) == 2, "the names of the journal and of its folder"
