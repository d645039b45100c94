"""Weeks of sols on one server: it is not to grow, slow down or lose anything.

    .venv/bin/python -m studies.soak --sols 24 --minutes 60
    .venv/bin/python -m studies.soak --sols 24 --minutes 60 --database postgresql://postgres@127.0.0.1/postgres

One `outcrop serve` with its worker, and people who do over REST what a sol is made of: targets and requests,
a bulk of edits that is taken back, a plan, a dry run, three signatures, a package that a simulated rover
carries out, its run taken in, an archive, the next sol. What is left of a sol's share of the time somebody
reads. After each sol the same requests are asked, beside such that ask nothing, and their processor time is
noted; then nobody asks until the server has given back what it freed, and its memory and open files are
noted. In the end the history is verified, `outcrop prune` removes what it may, and every product is opened
from its target.
"""

from __future__ import annotations

import argparse
import io
import json
import os
import random
import secrets
import statistics
import subprocess
import sys
import tempfile
import time
import zipfile
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import httpx

from ground.spare_memory import LOOK_S
from ground.uplink.execute import Place, execute_package
from ground.uplink.training import Team, make_team
from studies.common.databases import own_database
from studies.common.processes import answers, children, cpu_of, free_port, resident_mib, size_of, until
from tests.ground.approving import signed_by_all

ROOT = Path(__file__).parents[1]
ROUNDS, PROBES, BARE = 25, 100, 200
"""After each sol, in turn: requests of which the processor time is noted, and such that ask nothing.

A machine is not as fast all day, and what else it does comes in bursts: the median of the ratios of the two
says more than either. Over 6 rounds together the ratio lay between 0.98 and 1.68 from sol to sol.
"""
REST_S = LOOK_S + 5.0
"""Nobody asks for so long before memory is noted: what it holds in the middle of work hangs on the moment."""
FIRST_S = 600.0
"""For an answer: a first terrain in a new checkout waits for kernels that are compiled, in minutes."""
EARLY = 3
"""The sol that the last one is compared with: by then all is loaded."""
COST = "processor time a request, to one that asks nothing"
SHARES = {"memory": 5.0, "open files": 5.0, COST: 15.0}
"""Percent by which the last sol may be above the third."""


class Rest:
    """A client that is called as the tests' own is."""

    def __init__(self, client: httpx.Client) -> None:
        self.client = client

    def __call__(
        self, method: str, path: str, body: Any = None, *, who: str = "Planner", **more: Any
    ) -> httpx.Response:
        headers = {"X-Outcrop-Person": who, **more.pop("headers", {})}
        return self.client.request(method, f"/api/v1{path}", json=body, headers=headers, **more)

    def get(self, path: str) -> Any:
        answer = self("GET", path)
        assert answer.status_code == 200, answer.text
        return answer.json()

    def post(self, path: str, body: Any = None, *, who: str = "Planner", status: int | None = None) -> Any:
        answer = self("POST", path, body, who=who)
        assert answer.is_success if status is None else answer.status_code == status, answer.text
        return answer.json()

    def done(self, job: Mapping[str, Any]) -> dict[str, Any]:
        """Return a job when it is over, and went well."""
        while (now := self.get(f"/jobs/{job['id']}"))["state"] in ("queued", "running"):
            time.sleep(0.1)
        assert now["state"] == "succeeded", now["problem"]
        return dict(now)


class Mission:
    """One mission, sol after sol."""

    def __init__(self, rest: Rest, folder: Path, data: Path, seed: int) -> None:
        self.rest, self.folder, self.data, self.rng = rest, folder, data, random.Random(seed)
        self.team: Team = make_team(folder / "keys", training=False)
        ground = {"source": "generated", "seed": seed % 1000, "size_m": 96.0, "rock_cover": 0.0}
        made = rest.post("/missions", {"name": "Soak", "rover_profile": "k9", "terrain": ground})
        self.id, self.terrain = made["id"], made["terrain_id"]
        rest.post(f"/missions/{self.id}/sols", {})
        self.seed = seed

    def sol(self, number: int) -> None:
        """Do all that a sol is made of."""
        rest, base = self.rest, f"/missions/{self.id}"
        self.ask_for_observations(number)
        order = {"iterations": 20, "time_limit_s": 60.0, "max_branches": 2, "seed": number}
        plan = rest.done(rest.post(f"{base}/plans", order))["subject_id"]
        rest.done(rest.post(f"{base}/runs", {"plan_id": plan, "rover": "abstract", "seed": number}))
        signed_by_all(rest, plan, self.team)
        package = rest("POST", f"/plans/{plan}/package", who="Operator")
        assert package.status_code == 200, package.text
        run = self.carried_out(number, plan, package.content)
        archive = rest("GET", f"{base}/archive")
        assert archive.status_code == 200, archive.text
        opened = rest("POST", f"/runs/{run}/next-sol")
        assert opened.status_code == 201, opened.text

    def ask_for_observations(self, number: int) -> None:
        """File three targets with a request each, near the rover; edit them all and take that back."""
        rest, base = self.rest, f"/missions/{self.id}"
        pose = rest.get(f"{base}/sols?limit=1000")["items"][-1]["start_pose"] or {}
        names = []
        for k, instrument in enumerate(("science_camera", "microscopic_imager", "science_camera")):
            place = {
                axis: max(-40.0, min(40.0, pose.get(axis, 0.0) + self.rng.uniform(-6.0, 6.0)))
                for axis in ("east_m", "north_m")
            }
            target = rest.post(f"{base}/targets", {"name": f"S{number}-{k}", **place})
            names.append(target["id"])
            asked = {"target_id": target["id"], "instrument": instrument, "value": 3.0 + 5.0 * k}
            rest.post(f"{base}/observation-requests", asked)
        before = [rest.get(f"/targets/{name}")["notes"] for name in names]
        change = [{"id": name, "revision": 1, "changes": {"notes": "to be taken back"}} for name in names]
        rest.post(f"{base}/targets/bulk", {"update": change})
        rest.post(f"{base}/undo", {})
        assert [rest.get(f"/targets/{name}")["notes"] for name in names] == before

    def carried_out(self, number: int, plan: str, package: bytes) -> str:
        """Have a simulated rover execute a package, and take its run in; return the run."""
        folder = self.folder / f"sol-{number}"
        (folder / "world").mkdir(parents=True)
        (folder / "package.zip").write_bytes(package)
        problem = self.rest.get(f"/problems/{self.rest.get(f'/plans/{plan}')['problem_id']}")["document"]
        world = {
            "format": "world/1",
            "name": "soak",
            "terrain": str(self.data / "terrains" / self.terrain),
            "problem": problem,
        }
        (folder / "world" / "world.json").write_text(json.dumps(world))
        place = Place("abstract", folder / "world", self.team.trust, seed=number)
        execute_package(folder / "package.zip", place, folder / "run")
        out = io.BytesIO()
        with zipfile.ZipFile(out, "w") as archive:
            for file in sorted((folder / "run").rglob("*")):
                archive.write(file, file.relative_to(folder))
        kept = self.rest("POST", "/uploads?file_name=run.zip", content=out.getvalue())
        assert kept.status_code == 201, kept.text
        taken = self.rest.post("/runs/ingest", {"upload_id": kept.json()["id"]}, who="Administrator")
        return str(taken["id"])

    def ask(self, count: int) -> None:
        """Ask what people ask most, kinds of requests in turn; each answer is as long in every sol."""
        base = f"/missions/{self.id}"
        some = self.rest.get(f"{base}/targets?limit=3")["items"]
        paths = [*(f"/targets/{t['id']}" for t in some), f"{base}/targets?limit=3", f"{base}/plans?limit=1"]
        for k in range(count):
            self.rest.get(paths[k % len(paths)])

    def untied(self) -> list[str]:
        """Return the products that cannot be opened, or do not lead to their request."""
        found, cursor = [], ""
        while True:
            page = self.rest.get(f"/missions/{self.id}/products?limit=200{cursor}")
            for product in page["items"]:
                file = self.rest("GET", product["file_url"].removeprefix("/api/v1"))
                lineage = self.rest.get(f"/products/{product['id']}/lineage")
                kinds = {node["kind"] for node in lineage["nodes"]}
                if file.status_code != 200 or (product["request_id"] and "observation_request" not in kinds):
                    found.append(product["id"])
            if not page.get("next_cursor"):
                return found
            cursor = f"&cursor={page['next_cursor']}"


def state_of(server: subprocess.Popen[bytes]) -> tuple[float, int]:
    """Return memory in MiB and open files of a server and its processes."""
    pids = (server.pid, *children(server.pid))
    return sum(map(resident_mib, pids)), sum(
        sum(1 for _ in Path(f"/proc/{pid}/fd").iterdir()) for pid in pids
    )


def costs(server: subprocess.Popen[bytes], mission: Mission) -> tuple[float, float]:
    """Return the milliseconds of a usual request, and how many that ask nothing cost as much."""
    used, ratios = 0.0, []
    for _ in range(ROUNDS):
        start = cpu_of(server.pid)
        mission.ask(PROBES)
        middle = cpu_of(server.pid)
        for _ in range(BARE):
            mission.rest.client.get("/healthz")
        used += middle - start
        ratios.append((middle - start) / PROBES * BARE / (cpu_of(server.pid) - middle))
    return 1000 * used / (ROUNDS * PROBES), statistics.median(ratios)


def study(folder: Path, database: str, sols: int, minutes: float, seed: int) -> bool:
    """Run the sols and print a line for each; return whether all holds."""
    data, port = folder / "data", free_port()
    environment = {
        **os.environ,
        "OUTCROP_DATA_DIR": str(data),
        "OUTCROP_DATABASE_URL": database,
        "OUTCROP_LOG_LEVEL": "warning",
        "PYTHONPATH": str(ROOT),
    }

    def outcrop(*command: str) -> str:
        given = [sys.executable, "-m", "ground.cli", *command]
        ended = subprocess.run(
            given, env=environment, cwd=folder, capture_output=True, text=True, check=False
        )
        assert ended.returncode == 0, ended.stdout + ended.stderr
        return ended.stdout.strip()

    outcrop("migrate")
    with ExitStack() as stack:
        log = stack.enter_context((folder / "server.log").open("ab"))
        given = [sys.executable, "-m", "ground.cli", "serve", "--port", str(port)]
        server = subprocess.Popen(given, env=environment, cwd=folder, stdout=log, stderr=log)
        stack.callback(server.wait)
        stack.callback(server.terminate)
        client = httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=FIRST_S, trust_env=False)
        stack.callback(client.close)
        until(lambda: answers(client, "/api/v1/missions"), "the server")
        rest = Rest(client)
        mission = Mission(rest, folder, data, seed)
        early: dict[str, float] = {}
        late: dict[str, float] = {}
        for number in range(1, sols + 1):
            began, size = time.monotonic(), size_of(data)
            mission.sol(number)
            while time.monotonic() - began + REST_S < 60.0 * minutes / sols:
                mission.ask(5)
                time.sleep(0.5)
            request_ms, ratio = costs(server, mission)
            time.sleep(REST_S)
            memory_mib, files = state_of(server)
            late = {"memory": memory_mib, "open files": files, COST: ratio}
            early = late if number == EARLY else early
            print(
                f"sol {number}: {memory_mib:.0f} MiB, {files} files, {request_ms:.2f} ms a request, "
                f"{ratio:.2f} times one that asks nothing, "
                f"{(size_of(data) - size) / 1000:.0f} kB more",
                flush=True,
            )
        products = rest.get(f"/missions/{mission.id}/products?limit=1&count=true")["total"]
        before = size_of(data)
        print(outcrop("audit", "verify"))
        print(outcrop("prune", "--older-than", "0").splitlines()[-1], f"({before - size_of(data)} bytes)")
        untied = mission.untied()
        print(outcrop("audit", "verify"))
        print(f"{products} products after prune, {len(untied)} that do not tie: {untied[:5]}")
        errors = (folder / "server.log").read_text(errors="replace").count("Traceback")
        print(f"tracebacks of the server: {errors}")
    grown = {name: 100.0 * (late[name] / early[name] - 1.0) for name in early}
    for name, percent in grown.items():
        print(f"{name}, sol {EARLY} to sol {sols}: {percent:+.1f} % ({SHARES[name]:g} allowed)")
    return not untied and not errors and all(grown[name] <= SHARES[name] for name in grown)


def main() -> None:
    """Run the study; end with 1 if something grew, slowed down or was lost."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sols", type=int, default=24)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=secrets.randbelow(2**31))
    parser.add_argument("--database", default="", help="a PostgreSQL server; empty = SQLite")
    asked = parser.parse_args()
    if asked.sols <= EARLY:
        parser.error(f"--sols is {asked.sols}; the last sol is compared with sol {EARLY}")
    print(f"seed {asked.seed}, load {os.getloadavg()[0]:.1f}", flush=True)
    with (
        own_database(asked.database) as own,
        tempfile.TemporaryDirectory(prefix="outcrop-soak-") as folder,
    ):
        holds = study(Path(folder), own, asked.sols, asked.minutes, asked.seed)
    raise SystemExit(0 if holds else 1)


if __name__ == "__main__":
    main()
