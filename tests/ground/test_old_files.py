"""What version 0.1.0 wrote still opens: archives, queued jobs of each kind, run folders, packages.

`fixtures/v0.1.0/` was made by that version on a small yard. `mission.zip` is an archive of a mission with
targets, requests, keep-out, drive rule, plan and dry run; `repository.zip` a whole repository as SQL (its
data folder written as `@DATA@`) with one queued job of each kind; `package.zip` and `run.zip` are a signed
package and its execution; `expected.json` is what that version made of them, but for the plan's text: drives
are at most 1.5 % longer than the shortest since, where they were 3 %, and its calibration, as rates of losses
and of drives that fail are fitted with other beliefs since. Pictures had 160 pixels a side then and have 128
now, so their digests are not compared.
"""

from __future__ import annotations

import json
import re
import sqlite3
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import update

from ground.app.service import JOB_KINDS
from ground.errors import ArchiveError
from ground.gdr.history import verify_chains
from ground.gdr.migrate import migrate
from ground.gdr.repository import Repository, open_repository
from ground.records.actor import SYSTEM_ACTOR
from ground.resources.history.verify_rows import verify_rows
from ground.resources.mission_archives.import_mission import import_mission
from ground.resources.targets.row import TargetRow
from ground.uplink.execute import Place, execute_package
from ground.uplink.keys import load_public, make_key
from ground.uplink.trust import allow, change_trust, new_trust, write_trust
from tests.ground.conftest import Api, open_api, settings_for

OLD = Path(__file__).parent / "fixtures" / "v0.1.0"
SINCE = {"execution", "fly_campaign", "import_recording", "live"}
"""Kinds of jobs that the old version did not have."""
EXPECTED: dict[str, Any] = json.loads((OLD / "expected.json").read_text(encoding="utf-8"))
DIGEST = re.compile(rb'"[0-9a-f]{64}"')


def nearly(document: Any) -> Any:
    """Return a document with numbers of six digits.

    The last bits of a fit are the processor's; a plan's value is now read off grids that end where plans end.
    """
    if isinstance(document, dict):
        return {name: nearly(member) for name, member in document.items()}
    return float(f"{document:.5e}") if isinstance(document, float) else document


@pytest.fixture
def old_api(tmp_path: Path) -> Iterator[Api]:
    """Give the old repository, brought to the schema of this version."""
    data = tmp_path / "data"
    with zipfile.ZipFile(OLD / "repository.zip") as archive:
        archive.extractall(data)
    database = sqlite3.connect(data / "outcrop.db")
    database.executescript((data / "outcrop.sql").read_text(encoding="utf-8").replace("@DATA@", str(data)))
    database.close()
    repository = open_repository(settings_for(data))
    migrate(repository.database)
    yield from open_api(repository)
    repository.database.dispose()


def test_a_job_of_each_kind_queued_by_the_old_version_ends_as_it_did_there(old_api: Api) -> None:
    assert set(JOB_KINDS) - set(EXPECTED["jobs"]) == SINCE
    assert old_api.jobs() == len(EXPECTED["jobs"])
    for kind, expected in EXPECTED["jobs"].items():
        job = old_api.get(f"/jobs/{expected['job']}")
        assert (job["kind"], job["state"]) == (kind, expected["state"]), job["problem"]
        if job["state"] == "failed":
            assert job["problem"]["detail"] == expected["detail"]
            continue
        assert job["result_url"] == expected["result_url"]
        result = old_api.get(job["result_url"].removeprefix("/api/v1"))
        result["segments"] = len(result.get("segments", ()))
        made = {name: value for name, value in expected.items() if name not in {"job", "state", "result_url"}}
        assert nearly({name: result[name] for name in made}) == nearly(made), kind


def test_old_history_still_agrees_with_itself(old_api: Api) -> None:
    with old_api.repo.database.read() as session:
        assert verify_chains(session)[1] == verify_rows(session).faults == []
    with old_api.repo.database.write() as session:
        session.execute(update(TargetRow).where(TargetRow.name == "Near").values(up_m=0.25))
    with old_api.repo.database.read() as session:
        (fault,) = verify_rows(session).faults
    assert fault.reason == "its up_m is not what its last event says"


def test_an_old_archive_comes_in_with_plan_run_and_products(repo: Repository) -> None:
    mission = import_mission(repo, SYSTEM_ACTOR, OLD / "mission.zip")
    assert mission.counts.targets == 2
    assert mission.counts.observation_requests == 3
    (rule,) = mission.drive_rules
    assert rule.via_m == [[1.0, -2.0]]
    for api in open_api(repo):
        plan = api.get(f"/plans/{EXPECTED['plan']}")
        assert plan["crl_sha256"] == EXPECTED["crl_sha256"]
        run = api.get(f"/runs/{EXPECTED['run']}")
        assert (run["outcome"], run["utility"]) == ("SUCCEEDED", EXPECTED["run_utility"])
        assert api.get(f"/runs/{EXPECTED['run']}/snapshot")["over"]
        products = api.get(f"/missions/{mission.id}/products")["items"]
        assert products
        assert all(api("GET", product["file_url"]).status_code == 200 for product in products)
        assert api.get(f"/plans/{EXPECTED['plan']}/summary")


def test_an_old_package_runs_where_it_is_allowed_by_name_and_leaves_the_old_journal(tmp_path: Path) -> None:
    with zipfile.ZipFile(OLD / "run.zip") as archive:
        archive.extractall(tmp_path / "old")
    (tmp_path / "world").mkdir()
    (tmp_path / "world" / "world.json").write_bytes((OLD / "world.json").read_bytes())
    root, trust = make_key(tmp_path / "root.key"), tmp_path / "trust.json"
    trust.write_bytes(write_trust(new_trust("old", {"Root": root}), [root]))
    place = Place("abstract", tmp_path / "world", trust, seed=4)
    with pytest.raises(ArchiveError, match="package/1, which the trust file does not allow by name"):
        execute_package(OLD / "package.zip", place, tmp_path / "new")
    server = load_public(str(OLD / "uplink.pub"))
    by_name = change_trust(trust.read_bytes(), [root], lambda d: allow(d, "Server", server, ["package/1"]))
    trust.write_bytes(by_name)
    _, flight = execute_package(OLD / "package.zip", place, tmp_path / "new")
    assert flight.outcome.utility == EXPECTED["flight_utility"]
    for name in ("trace.jsonl", "telemetry.jsonl", "products.jsonl"):
        new, old = ((tmp_path / which / name).read_bytes() for which in ("new", "old"))
        assert DIGEST.sub(b"", new) == DIGEST.sub(b"", old)


def test_an_old_run_folder_is_taken_in(old_api: Api) -> None:
    sent = old_api("POST", "/uploads?file_name=run.zip", content=(OLD / "run.zip").read_bytes())
    run = old_api.post("/runs/ingest", {"upload_id": sent.json()["id"]}, who="Administrator")
    assert (run["kind"], run["utility"]) == ("execution", EXPECTED["flight_utility"])
    assert old_api.get(f"/runs/{run['id']}/trace")["events"]
