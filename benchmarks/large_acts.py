"""Large acts: a bulk of many targets, its undo, a copy of a large mission; processor time, and who waits.

While the mission is copied another thread opens sols and tells how long each write took. `--database` is a
PostgreSQL server, on which a database is made and dropped; default a fresh SQLite file.
"""

from __future__ import annotations

import random
import statistics
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

from sqlalchemy import insert, select

from benchmarks.common.figure import Figure, command
from benchmarks.common.served import place, repository
from ground.app.service import spare_full_collections
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
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

PLANNER = Actor("Planner", Role.PLANNER)
TARGET = KINDS["target"]
COPY_MOST_S = {10_000: 0.2}
WRITE_MOST_MS = {10_000: 50.0}
"""What somebody else may wait beside the copy of so many targets."""
QUICK = {"targets": 50, "copied": 500}
BUDGET_S = 300.0


def timed(act: Callable[[], Any]) -> float:
    """Return the processor seconds of this thread that something takes."""
    began = time.thread_time()
    act()
    return time.thread_time() - began


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


def figures(targets: int = 3000, copied: int = 10_000, database: str = "") -> Iterator[Figure]:
    """Do the large acts one after the other, and yield what each took."""
    with place(database) as environment, repository(environment) as repo:
        ensure_profiles(repo)
        spare_full_collections()  # as the service does when it has started
        source = GeneratedTerrain(seed=1, size_m=48.0)
        first, large, other = (create_mission(repo, PLANNER, name=n, source=source).id for n in "ABC")
        rows = [
            {"name": f"R{n}", "east_m": -6 + 0.12 * (n % 100), "north_m": -6 + 0.12 * (n // 100)}
            for n in range(targets)
        ]
        form = bulk_form(TARGET).model_validate({"create": rows})
        took_s = timed(lambda: write_many(repo, PLANNER, TARGET, first, create_target, form))
        yield Figure(f"bulk of {targets:,} targets", took_s, "s")
        fill(repo, large, copied)
        yield Figure("undo of the bulk", timed(lambda: undo(repo, PLANNER, first)), "s")
        took_s = timed(lambda: copy_mission(repo, PLANNER, large, name="Copy"))
        yield Figure(f"copy of {copied:,} targets", took_s, "s", COPY_MOST_S.get(copied))
        writer = Writer(repo, other)
        writer.start()
        time.sleep(2.0)
        alone = len(writer.took_ms)
        copy_mission(repo, PLANNER, large, name="Again")
        writer.done.set()
        writer.join()
        beside = writer.took_ms[alone:]
        yield Figure("a write alone, median", statistics.median(writer.took_ms[:alone]), "ms")
        yield Figure("a write alone, longest", max(writer.took_ms[:alone]), "ms")
        yield Figure("a write beside a copy, median", statistics.median(beside), "ms")
        yield Figure("a write beside a copy, longest", max(beside), "ms", WRITE_MOST_MS.get(copied))


if __name__ == "__main__":
    command(figures, QUICK, BUDGET_S)
