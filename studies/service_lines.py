"""Two servers, three workers, two missions on PostgreSQL: what silence costs, who waits, what a run takes.

    .venv/bin/python -m studies.service_lines --database postgresql://postgres@127.0.0.1/postgres

Each is a process of its own, started as people start it. In turn: transactions and processor time while
nobody does anything; processor time and disk of a dry run; memory of the workers over 300 jobs; how long
after the row the progress of a job comes to a stream of the other server; when a path network and a dry run
of one mission begin while 40 plans of the other wait. Prints a line for each, with the limit that was asked.

`--of DIR --only-dry-runs` measures the service of another checkout in the same minutes: machines differ, what
one version costs beside another does not.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import psycopg

from studies.common.bare_loop import BareLoop, beside, made_day
from studies.common.databases import own_database
from studies.common.processes import answers, children, cpu_of, free_port, resident_mib, size_of, until

ROOT = Path(__file__).parents[1]
WORKERS = 3
PLANS = 40
PLAN_S = 20.0
"""Time limit of a plan that keeps a worker busy."""
BLOCK = 10
"""Dry runs between two looks at how fast the machine is."""
SETTLING_S, BUSY_SHARE, SETTLED_WITHIN_S = 20.0, 0.05, 300.0
"""Warm-ups end, pools fill: over when so long no more than this share of a core was used, or an error.

The first start of a checkout compiles kernels, which takes longer than any fixed time.
"""


class Site:
    """The processes, and two missions."""

    def __init__(self, folder: Path, database: str, checkout: Path) -> None:
        self.folder, self.database = folder, database
        self.environment = {
            **os.environ,
            "OUTCROP_DATA_DIR": str(folder / "data"),
            "OUTCROP_DATABASE_URL": database,
            "OUTCROP_WORKERS": "1",
            "OUTCROP_LOG_LEVEL": "warning",
            "PYTHONPATH": str(checkout),
        }
        self.run("migrate").wait()
        self.ports = (free_port(), free_port())
        self.servers = [self.run("serve", "--no-worker", "--port", str(port)) for port in self.ports]
        self.workers = [self.run("worker") for _ in range(WORKERS)]
        self.clients = [
            httpx.Client(
                base_url=f"http://127.0.0.1:{port}/api/v1",
                headers={"X-Outcrop-Person": "Planner"},
                timeout=600.0,  # a first terrain waits for kernels that are compiled
                trust_env=False,
            )
            for port in self.ports
        ]
        self.stats = psycopg.connect(
            database.replace("postgresql+psycopg", "postgresql"), autocommit=True, dbname="postgres"
        )
        self.rows = psycopg.connect(database.replace("postgresql+psycopg", "postgresql"), autocommit=True)
        self.missions: list[str] = []

    def open(self) -> None:
        """Wait for the servers and make the missions."""
        for client in self.clients:
            until(lambda client=client: answers(client, "/missions"), "a server")
        self.missions = [self.mission(name) for name in ("Busy", "Other")]

    def run(self, *command: str) -> subprocess.Popen[bytes]:
        with (self.folder / f"{command[0]}.log").open("ab") as log:
            given = [sys.executable, "-m", "ground.cli", *command]
            return subprocess.Popen(given, env=self.environment, cwd=self.folder, stdout=log, stderr=log)

    def end(self) -> None:
        for process in (*self.servers, *self.workers):
            process.terminate()
        for process in (*self.servers, *self.workers):
            process.wait(60)
        self.stats.close()
        self.rows.close()

    def post(self, path: str, body: Any, server: int = 0) -> Any:
        answer = self.clients[server].post(path, json=body)
        assert answer.is_success, answer.text
        return answer.json()

    def mission(self, name: str) -> str:
        ground = {"source": "generated", "seed": 7, "size_m": 48.0, "rock_cover": 0.05}
        made = self.post("/missions", {"name": name, "rover_profile": "k9", "terrain": ground})["id"]
        self.post(f"/missions/{made}/sols", {})
        for east_m, north_m in ((4.0, 0.0), (-3.3, 3.0), (0.4, -5.0), (3.3, 4.4)):
            at = {"east_m": east_m, "north_m": north_m}
            target = self.post(f"/missions/{made}/targets", at)["id"]
            asked = {"target_id": target, "instrument": "science_camera", "value": 5.0}
            self.post(f"/missions/{made}/observation-requests", asked)
        return str(made)

    def row(self, job: str) -> tuple[str, int, float | None, float | None]:
        """Return state, revision and when a job was made and begun, in seconds."""
        times = "extract(epoch FROM created_utc), extract(epoch FROM started_utc)"
        query = f"SELECT state, revision, {times} FROM jobs WHERE id = %s"
        found = self.rows.execute(query, (job,)).fetchone()
        assert found is not None
        return found[0], found[1], found[2], found[3]

    def over(self, *jobs: str) -> None:
        """Wait until jobs are over, all of them well."""
        for job in jobs:
            until(lambda job=job: self.row(job)[0] not in ("queued", "running"), f"job {job}")
            assert self.row(job)[0] == "succeeded", self.clients[0].get(f"/jobs/{job}").json()

    def transactions(self) -> int:
        name = self.database.rsplit("/", 1)[1].split("?")[0]
        query = "SELECT xact_commit + xact_rollback FROM pg_stat_database WHERE datname = %s"
        found = self.stats.execute(query, (name,)).fetchone()
        assert found is not None
        return int(found[0])

    def cpu_s(self) -> float:
        """Return the processor seconds of all processes and their children, also of those that ended."""
        return sum(cpu_of(pid) for p in (*self.servers, *self.workers) for pid in (p.pid, *children(p.pid)))

    def memory_mib(self) -> list[float]:
        """Return what each worker has in memory, with its processes."""
        return [sum(resident_mib(pid) for pid in (p.pid, *children(p.pid))) for p in self.workers]


def settle(site: Site) -> None:
    """Wait until the processes have done what each start brings with it."""
    until_s = time.monotonic() + SETTLED_WITHIN_S
    while True:
        used = site.cpu_s()
        time.sleep(SETTLING_S)
        used = site.cpu_s() - used
        if used <= BUSY_SHARE * SETTLING_S:
            return
        assert time.monotonic() < until_s, f"still at work: {used:.1f} s of a processor in {SETTLING_S:.0f} s"


def silence(site: Site, seconds: float) -> None:
    """Count what is asked of the database while nobody does anything."""
    settle(site)
    before, used = site.transactions(), site.cpu_s()
    time.sleep(seconds)
    asked, used = site.transactions() - before, site.cpu_s() - used
    print(
        f"silence of {seconds:.0f} s: {asked / seconds:.2f} transactions a second (1 asked), "
        f"{100 * used / seconds:.2f} % of a core in all (0.5 asked)",
        flush=True,
    )


@contextmanager
def busy(site: Site) -> Iterator[list[str]]:
    """Have 40 plans of the first mission wait; those left are cancelled in the end."""
    order = {"iterations": 100_000, "time_limit_s": PLAN_S, "max_branches": 3}
    jobs = [site.post(f"/missions/{site.missions[0]}/plans", order)["id"] for _ in range(PLANS)]
    until(lambda: sum(site.row(job)[0] == "running" for job in jobs) == WORKERS, "plans that run")
    try:
        yield jobs
    finally:
        for job in reversed(jobs):
            site.clients[0].post(f"/jobs/{job}/cancel")
        until(lambda: all(site.row(job)[0] not in ("queued", "running") for job in jobs), "plans that stop")


def waits(site: Site, plan: str, times: int) -> None:
    """Ask for work of the second mission while 40 plans of the first wait."""
    other = f"/missions/{site.missions[1]}"
    waited: dict[str, list[float]] = {"path network": [], "dry run": []}
    with busy(site):
        for number in range(times):
            for name, path, body in (
                ("path network", f"{other}/path-networks", {}),
                ("dry run", f"{other}/runs", {"plan_id": plan, "rover": "abstract", "seed": number + 1}),
            ):
                job = site.post(path, body, server=number % 2)["id"]
                until(lambda job=job: site.row(job)[3] is not None, name)
                _, _, made, begun = site.row(job)
                assert made is not None
                assert begun is not None
                waited[name].append(begun - made)
                site.over(job)
    for name, took in waited.items():
        print(f"{name} beside {PLANS} plans: begun after at most {max(took):.2f} s of {times} (2 asked)")


def streams(site: Site, times: int) -> None:
    """Follow plans on the second server; compare with when their rows changed."""
    late: list[float] = []
    order = {"iterations": 100_000, "time_limit_s": 6.0, "max_branches": 3}
    for _ in range(times):
        job = site.post(f"/missions/{site.missions[0]}/plans", order)["id"]
        changed: dict[int, float] = {}
        over = threading.Event()

        def look(job: str = job, changed: dict[int, float] = changed, over: threading.Event = over) -> None:
            with psycopg.connect(site.rows.info.dsn, password="", autocommit=True) as rows:
                while not over.wait(0.004):
                    found = rows.execute("SELECT revision FROM jobs WHERE id = %s", (job,)).fetchone()
                    if found is not None:
                        changed.setdefault(found[0], time.monotonic())

        looker = threading.Thread(target=look)
        looker.start()
        came: dict[int, float] = {}
        with site.clients[1].stream("GET", f"/jobs/{job}/events") as answer:
            for line in answer.iter_lines():
                if line.startswith("data:"):
                    told = json.loads(line[5:])
                    came.setdefault(told["revision"], time.monotonic())
                    if told["state"] not in ("queued", "running"):
                        break
        over.set()
        looker.join()
        late += [came[revision] - at for revision, at in changed.items() if revision in came and revision > 1]
    late.sort()
    worst = late[min(len(late) - 1, round(0.95 * len(late)))]
    print(
        f"progress on the other server: {len(late)} changes of {times} plans, median "
        f"{1000 * statistics.median(late):.0f} ms, p95 {1000 * worst:.0f} ms (300 asked)"
    )


def dry_runs(site: Site, plan: str, count: int) -> None:
    """Fly a plan so often, one after the other, when each process has loaded what the work needs.

    The bare loop is looped between them, for a machine may be half as fast a minute later.
    """
    other = f"/missions/{site.missions[1]}/runs"
    bare = BareLoop(made_day(site.folder, 1))
    first = [{"plan_id": plan, "rover": "abstract", "seed": 1 + k} for k in range(8 * WORKERS)]
    site.over(*(site.post(other, order)["id"] for order in first))
    time.sleep(2.0)
    spent_s: list[float] = []
    bare_ms: list[float] = []
    size = size_of(site.folder / "data")
    for block in range(0, count, BLOCK):
        used = site.cpu_s()
        for seed in range(block, block + BLOCK):
            site.over(site.post(other, {"plan_id": plan, "rover": "abstract", "seed": 100 + seed})["id"])
        spent_s.append((site.cpu_s() - used) / BLOCK)
        bare_ms.append(bare.ms(30))
    size = size_of(site.folder / "data") - size
    took_s, loop_ms = statistics.fmean(spent_s), statistics.fmean(bare_ms)
    print(
        f"{len(spent_s) * BLOCK} dry runs: {took_s:.3f} s of processor time each, servers and workers (0.06 "
        f"asked; {min(spent_s):.3f} to {max(spent_s):.3f}), {beside(1000 * took_s, 60.0, loop_ms)}; "
        f"{size / len(spent_s) / BLOCK / 1000:.0f} kB (200 asked)",
        flush=True,
    )


def memory(site: Site, plan: str, count: int, first: int) -> None:
    """Compare the workers' memory after the first jobs and after all."""
    other = f"/missions/{site.missions[1]}/runs"
    early: list[float] = []
    for number in range(0, count, 10):
        orders = [{"plan_id": plan, "rover": "abstract", "seed": 1000 + number + k} for k in range(10)]
        site.over(*(site.post(other, order)["id"] for order in orders))
        if number + 10 == first:
            early = site.memory_mib()
    late = site.memory_mib()
    told = ", ".join(f"{a:.0f} -> {b:.0f} MiB" for a, b in zip(early, late, strict=True))
    growth = max(b / a - 1.0 for a, b in zip(early, late, strict=True))
    print(f"memory after {first} and {count} jobs: {told}; most {100 * growth:+.1f} % (5 asked)")


def main() -> None:
    """Start all, measure, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--database", required=True, help="a PostgreSQL server; a database of its own is made"
    )
    parser.add_argument("--silence-s", type=float, default=120.0)
    parser.add_argument("--times", type=int, default=5)
    parser.add_argument("--runs", type=int, default=50)
    parser.add_argument("--jobs", type=int, default=300)
    parser.add_argument("--only-dry-runs", action="store_true")
    parser.add_argument("--of", type=Path, default=ROOT, help="a checkout whose service is measured instead")
    given = parser.parse_args()
    with own_database(given.database) as address, tempfile.TemporaryDirectory() as folder:
        site = Site(Path(folder), address, given.of.resolve())
        try:
            site.open()
            print(f"load {os.getloadavg()[0]:.1f}")
            if given.only_dry_runs:
                settle(site)
            else:
                silence(site, given.silence_s)
            order = {"iterations": 200, "time_limit_s": 60.0, "max_branches": 2}
            job = site.post(f"/missions/{site.missions[1]}/plans", order)
            site.over(job["id"])
            plan = site.clients[0].get(f"/jobs/{job['id']}").json()["subject_id"]
            dry_runs(site, plan, given.runs)
            if given.only_dry_runs:
                return
            memory(site, plan, given.jobs, first=20)
            streams(site, given.times)
            waits(site, plan, given.times)
        finally:
            site.end()


if __name__ == "__main__":
    main()
