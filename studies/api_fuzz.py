"""The interface asked at random, link by link and with uploads: no 500, nothing that its document leaves out.

    .venv/bin/python -m studies.api_fuzz --processor-s 3600
    .venv/bin/python -m studies.api_fuzz --processor-s 3600 --database postgresql://postgres@127.0.0.1/postgres

schemathesis walks from answer to request by the links of the document and those it infers; what it asks is
put on ids that exist (those of answers before), and each upload is a real file, half of them damaged. The
service runs beside the walks, and so does its worker between them; every 40 walks a process ends, with the
memory that schemathesis took, and another goes on in the same database. A finding is a status of 500 or more,
a status, media type or content that the document does not promise, or a job that fails of an error; each is
printed once, with what was asked. With PostgreSQL the study works in a database of its own on that server.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import logging
import multiprocessing
import random
import secrets
import tempfile
import time
import zipfile
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import hypothesis
import numpy as np
import schemathesis
from hypothesis import HealthCheck, Phase
from hypothesis.errors import FlakyStrategyDefinition
from schemathesis.checks import not_a_server_error
from schemathesis.core.failures import Failure, FailureGroup
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    response_headers_conformance,
    response_schema_conformance,
    status_code_conformance,
)
from sqlalchemy import select
from starlette.testclient import TestClient

from ground.app.service import JOB_KINDS, build_app
from ground.gdr.migrate import migrate
from ground.gdr.repository import Repository, open_repository
from ground.jobs.row import JobRow
from ground.jobs.worker import Worker
from ground.resources.people.accounts import ensure_profiles
from ground.settings import load_settings
from studies.common.databases import own_database

CHECKS = [
    not_a_server_error,
    status_code_conformance,
    content_type_conformance,
    response_headers_conformance,
    response_schema_conformance,
]
KNOWN = 0.75
"""Share of variables of a path and members of a body that are put on an id that exists."""
LATEST = 40
"""Ids of a kind that are remembered; older ones were mostly deleted."""
DAMAGED = 0.5
LONG_S = 300.0
"""A panorama may be painted on a busy machine."""
PLANNING_S = 5.0
"""A plan may be asked to take an hour, in which nothing else is asked."""
PEOPLE = ("Planner", "Flight Director", "Administrator", "Viewer", "Operator", "Scientist")
SCENARIOS = 10
STEPS = 12
SHARE = 0.6
"""Share of the operations that a walk knows. Hypothesis looks at 10,000 rules of a machine only, and
the links between all operations are more: those that begin a walk would never be found."""
SAME = 40
"""Walks of one process on one choice of operations: schemathesis keeps 50 to 180 MB for a body."""
ENDLESS = "/events"
"""Streams of what is there do not end; they are asked for what is not."""
STAYS = ("/missions/{mission_id}", "/people/{person_id}")
"""What everything else hangs on is deleted one time in twenty."""


PREFIXES = {
    "msn": "mission_id",
    "sol": "sol_id",
    "tgt": "target_id",
    "req": "observation_request_id",
    "kpo": "keep_out_id",
    "frm": "frame_id",
    "pln": "plan_id",
    "run": "run_id",
    "prb": "problem_id",
    "upl": "upload_id",
    "prs": "person_id",
}
"""The variable that takes an id, by its prefix."""


@dataclass
class Ids:
    """What answers named: ids by the name of the variable that takes one."""

    rng: random.Random
    found: dict[str, list[str]] = field(default_factory=lambda: defaultdict(list))

    def learn(self, value: object, name: str = "") -> None:
        """Remember the ids in an answer."""
        if isinstance(value, dict):
            for key, part in value.items():
                self.learn(part, key)
        elif isinstance(value, list):
            for part in value[:20]:
                self.learn(part, name)
        elif isinstance(value, str) and 5 < len(value) <= 40 and value[3:4] == "-" and value.isascii():
            for key in {PREFIXES.get(value[:3], ""), value[:3], name} - {"", "id"}:
                if value not in self.found[key]:
                    self.found[key] = [*self.found[key], value][-LATEST:]

    def one(self, name: str) -> str | None:
        """Return an id for a variable or member of that name."""
        known = self.found.get(name) or self.found.get(name.removesuffix("s"))
        return self.rng.choice(known) if known else None

    def put(self, value: Any) -> Any:
        """Return a body with some of its ids put on such as exist."""
        if not isinstance(value, dict):
            return value
        out = dict(value)
        for key, part in value.items():
            known = self.one(key)
            if known is not None and isinstance(part, str) and self.rng.random() < KNOWN:
                out[key] = known
            elif known is not None and isinstance(part, list) and self.rng.random() < KNOWN:
                out[key] = [known] if part and isinstance(part[0], str) else part
            elif isinstance(part, dict):
                out[key] = self.put(part)
        return out


def zipped(files: Mapping[str, bytes]) -> bytes:
    """Return an archive of files."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return out.getvalue()


def geotiff() -> bytes:
    """Return a small elevation model."""
    import rasterio
    from rasterio.transform import from_origin

    heights = np.linspace(0.0, 0.4, 64 * 64, dtype=np.float32).reshape(64, 64)
    shape = {"height": 64, "width": 64, "count": 1, "dtype": "float32"}
    with rasterio.MemoryFile() as memory:
        with memory.open(driver="GTiff", transform=from_origin(-8.0, 8.0, 0.25, 0.25), **shape) as file:
            file.write(heights, 1)
        found: bytes = memory.read()
    return found


def files_of(client: TestClient, mission_id: str, plan_id: str, run_folder: bytes) -> dict[str, bytes]:
    """Return a file of every form that the service takes."""
    base = f"/api/v1/missions/{mission_id}"
    tiff = geotiff()
    return {
        "mission.zip": client.get(f"{base}/archive").content,
        "places.geojson": client.get(f"{base}/geometry").content,
        "places.csv": client.get(f"{base}/geometry?form=csv").content,
        "sites.svf": client.get(f"{base}/frame-files/export").content,
        "dem.tif": tiff,
        "terrain.zip": zipped({"terrain.tif": tiff}),
        "run.zip": run_folder,
        "plan.crl": client.get(f"/api/v1/plans/{plan_id}/crl").content,
        "mesh.obj": b"v 0 0 0\nv 9 0 0\nv 9 9 0\nv 0 9 0\nf 1 2 3\nf 1 3 4\n",
        "empty.bin": b"",
    }


def damaged(content: bytes, rng: random.Random) -> bytes:
    """Return a file with some bytes changed, cut off or said twice."""
    if not content:
        return rng.randbytes(20)
    kind, at = rng.randrange(3), rng.randrange(len(content))
    if kind == 0:
        return content[:at]
    if kind == 1:
        return content[:at] + content[at // 2 :]
    changed = bytearray(content)
    for _ in range(rng.randint(1, 4)):
        changed[rng.randrange(len(changed))] = rng.randrange(256)
    return bytes(changed)


def fill(client: TestClient, repo: Repository) -> tuple[str, str, bytes]:
    """Work through a day, so that there is something of every kind; return mission, plan, folder of a run."""

    def post(path: str, body: object, *, who: str = "Planner") -> Any:
        answer = client.post(f"/api/v1{path}", json=body, headers={"X-Outcrop-Person": who})
        assert answer.is_success, answer.text
        return answer.json()

    def done(job: Any) -> Any:
        Worker(repo, JOB_KINDS, slots=1).run_until_idle()
        over = client.get(f"/api/v1/jobs/{job['id']}").json()
        assert over["state"] == "succeeded", over["problem"]
        return over["subject_id"]

    terrain = {"source": "generated", "seed": 1, "size_m": 48.0, "rock_cover": 0.0}
    mission = post("/missions", {"name": "Fuzz", "terrain": terrain})["id"]
    base = f"/missions/{mission}"
    post(f"{base}/sols", {})
    for name, east, north, instrument in (("Near", 3.0, 1.0, "microscopic_imager"), ("Far", 2.0, -5.0, "")):
        target = post(f"{base}/targets", {"name": name, "east_m": east, "north_m": north})["id"]
        asked = {"target_id": target, "instrument": instrument or "science_camera", "value": 5.0}
        post(f"{base}/observation-requests", asked)
        post(f"{base}/comments", {"subject_kind": "target", "subject_id": target, "text": "a float?"})
    post(f"{base}/keep-outs", {"polygon_m": [[6, 6], [8, 6], [8, 8]]})
    frame = post(f"{base}/frames", {"name": "SITE_FRAME", "counter": [1]})["id"]
    post(f"{base}/frames", {"name": "ROVER_FRAME", "counter": [1, 2]})
    plan = done(post(f"{base}/plans", {"iterations": 2, "time_limit_s": 60.0, "max_branches": 1}))
    run = done(post(f"{base}/runs", {"plan_id": plan, "rover": "abstract", "seed": 3}))
    done(post(f"{base}/path-networks", {}))
    folder = repo.run_dir(run)
    content = {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}
    assert frame
    return mission, plan, zipped(content)


def brief(body: Any) -> Any:
    """Return a body that asks for seconds of planning where it asked for up to an hour."""
    if isinstance(body, dict):
        asked = body.get("time_limit_s")
        if isinstance(asked, (int, float)) and asked > PLANNING_S:
            return {**body, "time_limit_s": PLANNING_S}
    return body


DOTS = (".", "..")
"""Ids that a client takes out of an address (RFC 3986, 5.2.4): what is asked then is another operation."""
METHODS = ("get", "put", "post", "patch", "delete")


def document() -> dict[str, Any]:
    """Return the paths of the interface's document."""
    found = json.loads((Path(__file__).parents[1] / "ground/openapi.json").read_text())["paths"]
    return dict(found)


@dataclass
class Found:
    """What came of walks so far."""

    used_s: float = 0.0
    walks: int = 0
    statuses: Counter[int] = field(default_factory=Counter)
    asked: Counter[str] = field(default_factory=Counter)
    findings: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Order:
    """Where a process walks, from which seed, with which files, and for how long at most."""

    folder: Path
    database: str
    seed: int
    mission: str
    files: dict[str, bytes]
    processor_s: float


class Walks:
    """State machines over the service."""

    def __init__(self, repo: Repository, order: Order, found: Found) -> None:
        self.repo, self.seed, self.files = repo, order.seed, order.files
        self.rng = random.Random(order.seed + found.walks)
        self.ids = Ids(self.rng)
        self.app = build_app(repo, with_worker=False)
        client, mission = TestClient(self.app), order.mission
        listed = document()
        for path in listed:
            if "get" in listed[path] and path.count("{") == path.count("{mission_id}"):
                answer = client.get(path.replace("{mission_id}", mission)) if ENDLESS not in path else None
                if answer is not None and "json" in answer.headers.get("content-type", ""):
                    self.ids.learn(answer.json())
        self.schema = schemathesis.openapi.from_asgi("/api/v1/openapi.json", self.app)
        # Made-up keys and sessions would be refused before anything else is asked.
        self.schema.config.generation.with_security_parameters = False
        self.found = found
        self.statuses, self.asked, self.findings = found.statuses, found.asked, found.findings

    def prepare(self, case: schemathesis.Case) -> None:
        """Put a case on what exists."""
        path, rng = case.operation.path, self.rng
        for name in case.path_parameters or {}:
            known = self.ids.one(name)
            spared = path.endswith(ENDLESS) or (
                case.method == "DELETE" and path.endswith(STAYS) and rng.random() < 0.95
            )
            if known is not None and not spared and rng.random() < KNOWN:
                case.path_parameters[name] = known
            elif spared or case.path_parameters[name] in DOTS:
                case.path_parameters[name] = "none-such"
        headers = {**(case.headers or {}), "X-Outcrop-Person": rng.choice([*PEOPLE, *PEOPLE[:3] * 3])}
        if case.method in {"PATCH", "PUT", "DELETE"} and rng.random() < KNOWN:
            headers["If-Match"] = "*"
        if case.method == "POST" and rng.random() < 0.2:
            headers["Idempotency-Key"] = secrets.token_hex(8)
        if "Prefer" in headers:
            headers["Prefer"] = "wait=0"
        case.headers = headers
        if case.operation.definition.raw.get("operationId") == "create_upload":
            name = rng.choice(list(self.files))
            content = self.files[name]
            case.body = damaged(content, rng) if rng.random() < DAMAGED else content
            case.query = {"file_name": name}
        else:
            case.body = brief(self.ids.put(case.body))
            case.query = self.ids.put(case.query)

    def judge(self, response: Any, case: schemathesis.Case) -> None:
        """Count an answer, learn its ids, and keep what is not as the document says."""
        self.statuses[response.status_code] += 1
        self.asked[case.operation.label] += 1
        if response.status_code < 300 and "json" in str(response.headers.get("content-type")):
            self.ids.learn(response.json())
        try:
            case.validate_response(response, checks=CHECKS)
        except (FailureGroup, Failure) as err:
            failures: Sequence[Any] = err.exceptions if isinstance(err, FailureGroup) else [err]
            for failure in failures:
                name = f"{case.operation.label}: {type(failure).__name__} {response.status_code}"
                if name not in self.findings:
                    text = f"{failure}\n{case.as_curl_command()}\n{response.text[:600]}"
                    self.findings[name] = text
                    print(f"--- {name}\n{text}\n", flush=True)

    def machine(self) -> Any:
        """Return the state machine of a part of the document, whose walks do not end at a finding."""
        walks = self
        labels = [found.ok().label for found in self.schema.get_all_operations()]
        known = set(self.rng.sample(labels, round(SHARE * len(labels))))
        part = self.schema.include(lambda context: context.operation.label in known)

        class Machine(part.as_state_machine()):
            def before_call(self, case: schemathesis.Case) -> None:
                walks.prepare(case)

            def get_call_kwargs(self, _case: schemathesis.Case) -> dict[str, Any]:
                return {"timeout": LONG_S}

            def validate_response(self, response: Any, case: schemathesis.Case, **_more: Any) -> None:
                walks.judge(response, case)

        return Machine

    def run(self, processor_s: float) -> None:
        """Do some walks on one choice of operations, until so much processor time is used in all."""
        began, before, machine = time.process_time(), self.found.used_s, self.machine()
        for _ in range(SAME):
            hypothesis.seed(self.seed + self.found.walks)(machine)
            self.found.walks += 1
            options = hypothesis.settings(
                max_examples=SCENARIOS,
                stateful_step_count=STEPS,
                deadline=None,
                database=None,
                phases=[Phase.generate],
                suppress_health_check=list(HealthCheck),
            )
            with contextlib.suppress(FlakyStrategyDefinition):  # what is asked depends on answers before
                machine.run(settings=options)
            self.each_alone()
            self.work()
            self.found.used_s = before + time.process_time() - began
            if self.found.walks % 10 == 0:
                total = sum(self.statuses.values())
                print(f"{self.found.used_s:.0f} s, {total} requests, {dict(self.statuses)}", flush=True)
            if self.found.used_s >= processor_s:
                return

    def each_alone(self) -> None:
        """Ask a few operations for themselves: a walk seldom comes to those that nothing leads to."""
        every = [found.ok() for found in self.schema.get_all_operations()]
        rarest = sorted(every, key=lambda operation: self.asked[operation.label])[:12]
        for operation in rarest:

            @hypothesis.seed(self.rng.randrange(2**31))
            @hypothesis.settings(
                max_examples=4,
                deadline=None,
                database=None,
                phases=[Phase.generate],
                suppress_health_check=list(HealthCheck),
            )
            @hypothesis.given(case=operation.as_strategy())
            def ask(case: schemathesis.Case) -> None:
                self.prepare(case)
                self.judge(case.call(timeout=LONG_S), case)

            with contextlib.suppress(FlakyStrategyDefinition):
                ask()

    def work(self) -> None:
        """Do a job or two that wait, and cancel the rest: a plan may take minutes."""
        worker = Worker(self.repo, JOB_KINDS, slots=1)
        worker.folder.mkdir(parents=True, exist_ok=True)
        worker.step()
        with self.repo.database.read() as session:
            failed = session.scalars(select(JobRow).where(JobRow.state == "failed")).all()
        for row in failed:
            if (row.problem or {}).get("type", "").endswith("internal-error"):
                self.findings.setdefault(
                    f"job {row.kind}: {row.problem['detail'][:80]}", str(row.payload)[:600]
                )
        client = TestClient(self.app)
        for mission in self.ids.found["mission_id"]:
            waiting = client.get(f"/api/v1/missions/{mission}/jobs?state=queued&limit=1000")
            for job in waiting.json().get("items", []):
                client.post(f"/api/v1/jobs/{job['id']}/cancel")


@contextlib.contextmanager
def own_repository(folder: Path, address: str) -> Iterator[Repository]:
    """Give a repository that is there already."""
    repo = open_repository(
        load_settings(data_dir=folder, database_url=address, executor="inline", job_time_limit_s=10.0)
    )
    try:
        yield repo
    finally:
        repo.database.dispose()


def begun(folder: Path, address: str, seed: int, processor_s: float) -> Order:
    """Make what is walked through, and return how."""
    with own_repository(folder, address) as repo:
        migrate(repo.database)
        ensure_profiles(repo)
        client = TestClient(build_app(repo, with_worker=False))
        mission, plan, run = fill(client, repo)
        return Order(folder, address, seed, mission, files_of(client, mission, plan, run), processor_s)


def walked(order: Order, found: Found) -> Found:
    """Walk on, in a process of its own."""
    logging.disable(logging.WARNING)
    with own_repository(order.folder, order.database) as repo:
        Walks(repo, order, found).run(order.processor_s)
    return found


def main() -> None:
    """Print the findings and the counts; end with 1 if there is a finding."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--processor-s", type=float, default=600.0)
    parser.add_argument("--seed", type=int, default=secrets.randbelow(2**31))
    parser.add_argument("--database", default="", help="a PostgreSQL server; empty = SQLite")
    asked = parser.parse_args()
    logging.disable(logging.WARNING)
    print(f"seed {asked.seed}", flush=True)
    found, processes = Found(), multiprocessing.get_context("spawn")
    with (
        own_database(asked.database) as own,
        tempfile.TemporaryDirectory(prefix="outcrop-fuzz-") as folder,
    ):
        order = begun(Path(folder), own, asked.seed, asked.processor_s)
        while found.used_s < asked.processor_s:
            with ProcessPoolExecutor(1, mp_context=processes) as pool:
                found = pool.submit(walked, order, found).result()
    total = sum(len(set(METHODS) & set(path)) for path in document().values())
    print(
        f"{'postgresql' if asked.database else 'sqlite'}, seed {asked.seed}: {found.used_s:.0f} s of "
        f"processor time, {sum(found.statuses.values())} requests to {len(found.asked)} of {total} "
        f"operations, statuses {dict(sorted(found.statuses.items()))}, {len(found.findings)} findings"
    )
    for name in sorted(found.findings):
        print(f"  {name}")
    raise SystemExit(1 if found.findings else 0)


if __name__ == "__main__":
    main()
