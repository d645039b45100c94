"""What the simulated rover of a dry run is told of its world."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from ground.errors import JobFailedError
from ground.resources.runs import work as run_work
from ground.resources.runs.order import RunWork
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
