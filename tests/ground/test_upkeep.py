"""A service over weeks: each fault has its line and its remedy, and only what nobody needs goes."""

from __future__ import annotations

import json
import random
import shutil
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import select, text

from ground.app.exposition import exposition
from ground.gdr.history import verify_chains
from ground.gdr.repository import Repository, open_repository
from ground.jobs.row import JobRow
from ground.resources.approvals.row import ApprovalRow
from ground.resources.campaigns.row import CampaignRow
from ground.resources.missions.value import Mission
from ground.resources.plans.row import PlanRow
from ground.resources.products.row import ProductRow
from ground.resources.runs.row import RunRow
from ground.resources.sols.row import SolRow
from ground.resources.upkeep.diagnose import diagnose
from ground.resources.upkeep.noted import FILE, note
from ground.resources.upkeep.prune import prune
from ground.resources.upkeep.store_size import StoreSize
from tests.ground.conftest import Api, settings_for

LONG_AGO = datetime.now(UTC) - timedelta(days=60)
MONTH = timedelta(days=30)


def job(mission: str | None, name: str, state: str, when: datetime = LONG_AGO) -> JobRow:
    return JobRow(
        id=name,
        mission_id=mission,
        kind="none",
        payload={},
        subject_kind="",
        subject_id="",
        state=state,
        max_attempts=1,
        time_limit_s=1.0,
        log=[],
        author="t",
        created_utc=when,
        modified_utc=when,
        finished_utc=when,
        lease_until_utc=when,
    )


def plan(mission: str, sol: str, number: int, **given: Any) -> PlanRow:
    told = {
        "state": "computed",
        "created_utc": LONG_AGO,
        "modified_utc": LONG_AGO,
        "parent_id": None,
        **given,
    }
    return PlanRow(
        id=f"pln-{number:04d}",
        mission_id=mission,
        sol_id=sol,
        number=number,
        name="P",
        strategy="optimal",
        max_branches=1,
        time_limit_s=1.0,
        seed=1,
        job_id="",
        inputs_sha256="",
        terrain_sha256="",
        dictionary="",
        rover_profile="k9",
        findings=[],
        request_ids=[],
        planned_request_ids=[],
        left_out={},
        author="t",
        **told,
    )


def run(mission: str, plan_id: str, number: int, **given: Any) -> RunRow:
    told = {
        "kind": "dry_run",
        "state": "succeeded",
        "created_utc": LONG_AGO,
        "modified_utc": LONG_AGO,
        **given,
    }
    return RunRow(
        id=f"run-{number:04d}",
        mission_id=mission,
        plan_id=plan_id,
        rover="abstract",
        seed=1,
        faults=[],
        options_taken=[],
        achieved_request_ids=[],
        crl_sha256="",
        author="t",
        **told,
    )


def sol_of(repo: Repository, mission: Mission) -> str:
    with repo.database.read() as session:
        return session.scalars(select(SolRow.id).where(SolRow.mission_id == mission.id)).one()


# ---- doctor


def well(repo: Repository) -> None:
    for act in ("backup", "audit", "contents"):
        note(repo, act)  # type: ignore[arg-type]


def test_a_service_that_is_well_has_no_finding(repo: Repository, mission: Mission) -> None:
    well(repo)
    assert mission.id
    assert diagnose(repo) == []


def open_to_others(repo: Repository, _mission: Mission) -> None:
    repo.data_dir.chmod(0o755)


def lost_terrain(repo: Repository, mission: Mission) -> None:
    shutil.rmtree(repo.terrain_dir(mission.terrain_id))


def waiting_job(repo: Repository, mission: Mission) -> None:
    with repo.database.write() as session:
        session.add(job(mission.id, "job-1", "queued"))


def orphaned_job(repo: Repository, mission: Mission) -> None:
    with repo.database.write() as session:
        session.add(job(mission.id, "job-1", "running"))


def failed_job(repo: Repository, mission: Mission) -> None:
    with repo.database.write() as session:
        failed = job(mission.id, "job-1", "failed", datetime.now(UTC))
        failed.message = "the terrain has a hole"
        session.add(failed)


def lost_file(repo: Repository, mission: Mission) -> None:
    with repo.database.write() as session:
        session.add(plan(mission.id, sol_of(repo, mission), 1))
        session.flush()
        session.add(run(mission.id, "pln-0001", 1, trace_sha256="ab" * 32))


def stray_folder(repo: Repository, _mission: Mission) -> None:
    (repo.data_dir / "runs" / "run-nobody").mkdir(parents=True)


def old_schema(repo: Repository, _mission: Mission) -> None:
    with repo.database.engine.begin() as connection:
        connection.execute(text("update alembic_version set version_num = '0003'"))


def newer_schema(repo: Repository, _mission: Mission) -> None:
    with repo.database.engine.begin() as connection:
        connection.execute(text("update alembic_version set version_num = '9999'"))


def no_backup_lately(repo: Repository, _mission: Mission) -> None:
    told = json.loads((repo.data_dir / FILE).read_text())
    told["backup"]["utc"] = LONG_AGO.isoformat()
    (repo.data_dir / FILE).write_text(json.dumps(told))


def faulty_history(repo: Repository, _mission: Mission) -> None:
    note(repo, "audit", 3)


def unreadable_notes(repo: Repository, _mission: Mission) -> None:
    (repo.data_dir / FILE).write_text('{"backup": {"utc": 7}')


@pytest.mark.parametrize(
    ("spoil", "what", "remedy"),
    [
        (open_to_others, "others of this machine can look into", "chmod 700"),
        (lost_terrain, "the folder of terrain", "backup"),
        (waiting_job, "a job has waited", "outcrop worker"),
        (orphaned_job, "lost their worker", "outcrop worker"),
        (failed_job, "the terrain has a hole", "outcrop job list"),
        (lost_file, "lack their file", "outcrop check"),
        (stray_folder, "belong to no record", "--sweep"),
        (old_schema, "at revision 0003", "outcrop migrate"),
        (newer_schema, "newer than this program", "newer version"),
        (no_backup_lately, "the last backup was on", "outcrop backup"),
        (faulty_history, "found 3 faults", "outcrop audit verify"),
        (unreadable_notes, "there was no backup yet", "outcrop backup"),
    ],
)
def test_each_fault_is_told_with_its_remedy(
    spoil: Callable[[Repository, Mission], None],
    what: str,
    remedy: str,
    repo: Repository,
    mission: Mission,
) -> None:
    well(repo)
    spoil(repo, mission)
    found = diagnose(repo)
    assert any(what in finding.what and remedy in finding.remedy for finding in found), found
    assert len(found) == 1 or spoil is unreadable_notes


def test_a_database_that_does_not_answer_is_named_without_its_password(tmp_path: Path) -> None:
    (tmp_path / "data").mkdir(mode=0o700)
    address = "postgresql+psycopg://me:secret@127.0.0.1:9/none"
    (finding,) = diagnose(open_repository(settings_for(tmp_path / "data", address)))
    assert "does not answer" in finding.what
    assert "secret" not in finding.what


def test_the_server_is_not_ready_on_a_schema_of_another_version(api: Api) -> None:
    assert api.get("/readyz")["status"] == "ok"
    old_schema(api.repo, None)  # type: ignore[arg-type]
    answer = api("GET", "/readyz")
    assert answer.status_code == 503
    assert "revision 0003" in answer.json()["detail"]


def test_metrics_tell_the_age_of_the_last_backup_and_of_the_job_that_waits_longest(
    api: Api, mission: Mission
) -> None:
    well(api.repo)
    faulty_history(api.repo, mission)
    waiting_job(api.repo, mission)
    told = api("GET", "/metrics").text
    value = {name: float(number) for name, _, number in (line.rpartition(" ") for line in told.splitlines())
             if not name.startswith("#")}  # fmt: skip
    assert value['outcrop_upkeep_faults{act="audit"}'] == 3
    assert 0 <= value['outcrop_upkeep_age_seconds{act="backup"}'] < 600
    assert value["outcrop_job_oldest_waiting_seconds"] == pytest.approx(60 * 86400, rel=0.01)
    assert value["outcrop_database_bytes"] > 100_000
    assert value["outcrop_disk_free_bytes"] > 0
    assert value["outcrop_history_events"] >= 2


def test_metrics_tell_how_large_the_files_of_the_data_folder_are(repo: Repository) -> None:
    size = StoreSize(repo.data_dir)
    size.known()
    size.wait()
    before = size.known()
    assert before is not None
    (repo.data_dir / "runs" / "deep").mkdir(parents=True)
    (repo.data_dir / "runs" / "deep" / "trace").write_bytes(bytes(12_345))
    assert size.known() == before, "it is not counted for each who asks"
    size.EVERY_S = 0.0
    size.known()
    size.wait()
    assert size.known() == before + 12_345
    told = exposition(repo, size)[0].decode()
    assert f"outcrop_store_bytes {float(before + 12_345)}" in told


def test_a_data_folder_that_was_taken_away_holds_nothing(tmp_path: Path) -> None:
    size = StoreSize(tmp_path / "gone")
    size.known()
    size.wait()
    assert size.known() == 0


# ---- prune


def test_what_goes_is_what_the_rule_says_of_a_thousand_random_rows(
    repo: Repository, mission: Mission
) -> None:
    seed = 2979809119  # one whose plans have children that go
    rng = random.Random(seed)
    sol, now = sol_of(repo, mission), datetime.now(UTC)
    plans, runs, jobs = [], [], []
    for number in range(1, 61):
        when = rng.choice([LONG_AGO, LONG_AGO, now])
        parent = f"pln-{number - 1:04d}" if number > 1 and rng.random() < 0.15 else None
        state = rng.choice(["draft", "computed", "verified", "computed", "executed"])
        plans.append(plan(mission.id, sol, number, state=state, modified_utc=when, parent_id=parent))
    for number in range(1, 161):
        kind = rng.choices(["dry_run", "execution"], [9, 1])[0]
        when, state = (
            rng.choice([LONG_AGO, LONG_AGO, LONG_AGO, now]),
            rng.choice(["succeeded", "failed", "succeeded"]),
        )
        owner = rng.choice(plans).id
        runs.append(run(mission.id, owner, number, kind=kind, state=state, modified_utc=when))
    for number in range(200):
        state = rng.choice(["succeeded", "failed", "cancelled", "queued", "running"])
        jobs.append(job(mission.id, f"job-{number:04d}", state, rng.choice([LONG_AGO, now])))
    approved = {p.id for p in plans if rng.random() < 0.1}
    flown = {p.id for p in plans if rng.random() < 0.05}
    shown = {r.id for r in runs if rng.random() < 0.2}
    told_plans = [(p.id, p.state, p.modified_utc, p.parent_id) for p in plans]
    told_runs = [(r.id, r.plan_id, r.kind, r.modified_utc) for r in runs]
    told_jobs = [(j.id, j.state, j.finished_utc) for j in jobs]
    with repo.database.write() as session:
        session.add_all(plans)
        session.flush()
        session.add_all([*runs, *jobs])
        session.flush()
        named = {"mission_id": mission.id, "author": "t"}
        for number, owner in enumerate(sorted(approved)):
            digests = dict.fromkeys(
                ("crl_sha256", "terrain_sha256", "dictionary_sha256", "models_sha256"), ""
            )
            session.add(ApprovalRow(id=f"apr-{number}", plan_id=owner, **digests, **named))
        for number, owner in enumerate(sorted(flown)):
            session.add(
                CampaignRow(
                    id=f"cmp-{number}", plan_id=owner, job_id="", state="succeeded", rover="abstract",
                    seed=1, runs=1, crl_sha256="", **named,
                )
            )  # fmt: skip
        for number, owner in enumerate(sorted(shown)):
            session.add(
                ProductRow(
                    id=f"prd-{number}", run_id=owner, task_id="", kind="image", media="image/png",
                    file_name="f", size_bytes=1, sha256="cd" * 32, t_s=0.0, label={}, **named,
                )
            )  # fmt: skip

    # the rule again, row by row
    bound = approved | flown
    old = {r for r, _, _, when in told_runs if when is LONG_AGO}
    free = {
        r for r, owner, kind, _ in told_runs if r in old and kind == "dry_run" and owner not in bound
    } - shown
    newest = max(p for p, *_ in told_plans)
    parents = {parent for *_, parent in told_plans}
    gone_plans = {
        p
        for p, state, when, _ in told_plans
        if state != "executed"
        and when is LONG_AGO
        and p not in bound | parents | {newest}
        and all(r in free for r, owner, *_ in told_runs if owner == p)
    }
    last = {owner: max(r for r, o, *_ in told_runs if o == owner) for _, owner, *_ in told_runs}
    gone_runs = {r for r, owner, *_ in told_runs if r in free and (owner in gone_plans or r != last[owner])}
    gone_jobs = {j for j, state, when in told_jobs if when is LONG_AGO and state not in {"queued", "running"}}

    would = prune(repo, MONTH, dry=True)
    assert (set(would.jobs), set(would.runs), set(would.plans)) == (gone_jobs, gone_runs, gone_plans)
    with repo.database.read() as session:
        assert len(session.scalars(select(PlanRow.id)).all()) == len(plans)
    went = prune(repo, MONTH)
    assert (set(went.jobs), set(went.runs), set(went.plans)) == (gone_jobs, gone_runs, gone_plans)
    with repo.database.read() as session:
        assert set(session.scalars(select(PlanRow.id))) == {p for p, *_ in told_plans} - gone_plans
        assert set(session.scalars(select(RunRow.id))) == {r for r, *_ in told_runs} - gone_runs
        assert set(session.scalars(select(JobRow.id))) == {j for j, *_ in told_jobs} - gone_jobs
        assert len(session.scalars(select(ProductRow.id)).all()) == len(shown)
        assert verify_chains(session)[1] == []
    again = prune(repo, MONTH)
    assert not again.runs
    # The parent of a plan that went is free only now.
    assert set(again.plans) <= {parent for p, *_, parent in told_plans if p in gone_plans}
