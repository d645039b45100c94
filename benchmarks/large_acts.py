"""Large acts: a bulk of many targets, its undo, a copy of a large mission; processor time, and who waits.

    python -m benchmarks.large_acts [--targets 3000] [--copied 10000] [--database URL]

While the mission is copied another thread opens sols and tells how long each write took.
"""

from __future__ import annotations

import argparse
import random
import statistics
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from sqlalchemy import insert, select

from ground.app.service import spare_full_collections
from ground.gdr.ids import new_id
from ground.gdr.migrate import migrate
from ground.gdr.repository import Repository, open_repository
from ground.gdr.seals import seal_values
from ground.records.actor import Actor, Role
from ground.records.bulk import bulk_form, write_many
from ground.resources.history.undo import undo
from ground.resources.kinds import KINDS
from ground.resources.mission_archives.copy_mission import copy_mission
from ground.resources.mission_setup.create_mission import GeneratedTerrain, create_mission
from ground.resources.people.accounts import ensure_profiles
from ground.resources.sols.create_sol import create_sol
from ground.resources.targets.create_target import create_target
from ground.settings import load_settings

PLANNER = Actor("Planner", Role.PLANNER)
TARGET = KINDS["target"]


def timed(label: str, act: Callable[[], Any]) -> None:
    """Do it, and print what it took."""
    wall, used = time.perf_counter(), time.thread_time()
    act()
    used, wall = time.thread_time() - used, time.perf_counter() - wall
    print(f"{label}: {used:.2f} s of processor time, {wall:.2f} s", flush=True)


def fill(repo: Repository, mission_id: str, count: int) -> None:
    """Give a mission so many targets, each with numbers of its own."""
    table: Any = TARGET.row.__table__
    chance = random.Random(1)
    numbers = ("east_m", "north_m", "up_m", "slope_rad")
    with repo.database.write() as session:
        some = [dict(row) for row in session.execute(select(table).limit(200)).mappings()]
        rows = [
            {
                **some[n % len(some)],
                **{name: chance.uniform(0.0, 1.0) for name in numbers},
                "normal": [chance.uniform(-1.0, 1.0) for _ in range(3)],
                "covariance_m2": [[chance.uniform(0.0, 0.01) for _ in range(3)] for _ in range(3)],
                "id": new_id("tgt"),
                "mission_id": mission_id,
                "name": f"F{n}",
            }
            for n in range(count)
        ]
        session.execute(insert(table), rows)
        seal_values(session, mission_id, table, rows)


class Writer(threading.Thread):
    """Somebody who writes again and again."""

    def __init__(self, repo: Repository, mission_id: str) -> None:
        super().__init__(daemon=True)
        self.took_ms: list[float] = []
        self.done = threading.Event()
        self._repo, self._mission = repo, mission_id

    def run(self) -> None:
        while not self.done.wait(0.01):
            began = time.perf_counter()
            create_sol(self._repo, PLANNER, self._mission)
            self.took_ms.append(1000 * (time.perf_counter() - began))


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--targets", type=int, default=3000)
    parser.add_argument("--copied", type=int, default=10_000)
    parser.add_argument("--database", default="", help="an empty one; SQLite in a folder of its own")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        repo = open_repository(
            load_settings(data_dir=Path(folder), database_url=given.database, executor="inline")
        )
        migrate(repo.database)
        ensure_profiles(repo)
        measure(repo, given.targets, given.copied)
        repo.database.dispose()


def measure(repo: Repository, targets: int, copied: int) -> None:
    """Do the large acts one after the other."""
    spare_full_collections()  # as the service does when it has started
    source = GeneratedTerrain(seed=1, size_m=48.0)
    first, large, other = (create_mission(repo, PLANNER, name=n, source=source).id for n in "ABC")
    rows = [
        {"name": f"R{n}", "east_m": -6 + 0.12 * (n % 100), "north_m": -6 + 0.12 * (n // 100)}
        for n in range(targets)
    ]
    form = bulk_form(TARGET).model_validate({"create": rows})
    timed(f"bulk of {targets}", lambda: write_many(repo, PLANNER, TARGET, first, create_target, form))
    fill(repo, large, copied)
    timed("undo of the bulk", lambda: undo(repo, PLANNER, first))
    timed(f"copy of {copied}", lambda: copy_mission(repo, PLANNER, large, name="Copy"))
    writer = Writer(repo, other)
    writer.start()
    time.sleep(2.0)
    alone = len(writer.took_ms)
    timed(f"copy of {copied} while somebody writes", lambda: copy_mission(repo, PLANNER, large, name="Again"))
    writer.done.set()
    writer.join()
    for label, took in (("alone", writer.took_ms[:alone]), ("beside the copy", writer.took_ms[alone:])):
        middle, longest = statistics.median(took), max(took)
        print(f"writes {label}: {len(took)}, median {middle:.0f} ms, longest {longest:.0f} ms")


if __name__ == "__main__":
    main()
