"""Campaigns over REST: a job, what its runs say so far, the runs behind a bar, and a flight rule."""

from __future__ import annotations

import csv
import io
import json
import os
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

from ground.app.job_kinds import job_kinds
from ground.campaigns.conduct import Conduct, Plan, make_order
from ground.campaigns.engines import HereEngine
from ground.campaigns.folder import CampaignFolder
from ground.campaigns.inputs import read_case
from ground.campaigns.result import RESULTS
from ground.gdr.migrate import migrate
from ground.gdr.repository import open_repository
from ground.jobs.worker import Worker
from ground.resources.backups.backup import backup
from ground.resources.backups.check_files import check_files, sweep_files
from ground.resources.backups.restore import restore
from ground.resources.campaigns import work as campaign_work
from ground.resources.campaigns.order import ORDERS
from ground.settings import Settings
from tests.ground.campaigns.small import write_small
from tests.ground.conftest import Api, settings_for, yard
from tests.ground.planning import PlannedDay, plan_day
from tests.ground.test_approvals import archive_of, brought_in, without_history
from tests.ground.test_missions_api import problem


def flown(day: PlannedDay, **order: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    api, plan = day.api, day.plan
    body = {"plan_id": plan["id"], "runs": 150, "seed": 5, **order}
    job = api.post(f"/missions/{day.mission.id}/campaigns", body, status=202)
    assert api.jobs() == 1
    return plan, api.get(f"/campaigns/{job['subject_id']}")


def test_a_plan_is_flown_many_times(api: Api, terrain_folder: Path) -> None:
    plan, campaign = flown(plan_day(api, yard(api.repo, terrain_folder)), help_runs=20)
    at = f"/campaigns/{campaign['id']}"
    assert (campaign["state"], campaign["runs_done"]) == ("succeeded", 150)
    document = api.get(f"{at}/result")
    result = RESULTS.from_document(document)
    assert campaign["mean_utility"] == result.utility.mean
    assert result.utility.predicted == plan["expected_utility"]
    assert abs(result.utility.mean - plan["expected_utility"]) < 6 * result.utility.standard_error + 0.5
    table = list(csv.DictReader(io.StringIO(api("GET", f"{at}/runs.csv").text)))
    assert [int(row["seed"]) for row in table] == list(range(5, 155))

    worst = result.worst[0]
    found = api.get(f"{at}/runs?high={worst.utility}")
    assert found["total"] == sum(float(row["utility"]) <= worst.utility for row in table)
    assert {"seed": worst.seed, "why": worst.why}.items() <= found["items"][0].items() or found["total"] > 1
    mode = result.failures[0] if result.failures else None
    if mode is not None and mode.task != "plan":
        assert api.get(f"{at}/runs?task={mode.task}&limit=1")["total"] >= mode.runs
    page = api("GET", f"{at}/report")
    assert page.status_code == 200
    assert "What would help most" in page.text
    assert [c["id"] for c in api.get(f"/missions/{campaign['mission_id']}/campaigns")["items"]] == [
        campaign["id"]
    ]


def test_a_campaign_that_was_stopped_tells_what_it_has(sqlite_planned_day: PlannedDay) -> None:
    api, mission, plan = sqlite_planned_day.api, sqlite_planned_day.mission, sqlite_planned_day.plan
    body = {"plan_id": plan["id"], "runs": 400}
    job = api.post(f"/missions/{mission.id}/campaigns", body, status=202)
    at = f"/campaigns/{job['subject_id']}"
    assert "has no runs yet" in problem(api("GET", f"{at}/result"), 409, "wrong-state")["detail"]
    work = campaign_work.work
    asked = []

    def stopped(order: Any, report: Any, _stop: Any) -> Any:
        return work(order, report, lambda: len(asked) >= 2 or asked.append(1) or False)

    kinds = {n: replace(k, work=stopped) if n == "fly_campaign" else k for n, k in job_kinds().items()}
    Worker(api.repo, kinds, slots=1).run_until_idle()
    document = api.get(f"{at}/result")
    assert 0 < document["runs"] < 400
    assert api.get(f"{at}/runs")["total"] >= document["runs"]
    assert problem(api("GET", f"{at}/runs.csv"), 409, "wrong-state")


def test_a_campaign_that_is_begun_again_tells_the_runs_of_both_attempts(tmp_path: Path) -> None:
    case = read_case(*write_small(tmp_path), "abstract")
    order = make_order(case, 1)
    folder = CampaignFolder(tmp_path / "c")
    folder.open(order, resume=False)
    live = folder.path / campaign_work.LIVE
    for units, told in ((3, 300), (1, 400)):
        left = iter(range(units))
        engine = campaign_work.LiveEngine(HereEngine(), folder, order, 500)
        Conduct(folder, order, Plan(500), should_stop=lambda left=left: next(left, None) is None).run(engine)
        campaign_work.LiveEngine(HereEngine(), folder, order, 500)
        assert json.loads(live.read_text())["runs"] == told


def test_approval_asks_for_a_campaign_where_it_is_set(sqlite_planned_day: PlannedDay) -> None:
    api = sqlite_planned_day.api
    plan, _campaign = flown(sqlite_planned_day)

    def rule() -> dict[str, Any] | None:
        rules = api.get(f"/plans/{plan['id']}/flight-rules")
        rows = rules["items"] if isinstance(rules, dict) else rules
        return next((r for r in rows if r["rule"] == "FR-CAMPAIGN"), None)

    assert rule() is None
    settings: Settings = api.repo.settings
    object.__setattr__(api.repo, "settings", settings.model_copy(update={"approval_runs": 1000}))
    asked = rule()
    assert asked is not None
    assert (asked["holds"], "150 runs; 1,000 are asked for" in asked["detail"]) == (False, True)
    object.__setattr__(api.repo, "settings", settings.model_copy(update={"approval_runs": 100}))
    met = rule()
    assert met is not None
    assert "of 150 runs end over a budget" in met["detail"]
    assert met["holds"] is (met["value"] <= 0.05)


def test_an_order_is_read_as_it_was_written() -> None:
    document = {"folder": "f", "terrain_dir": "t", "crl_text": "", "problem": {}, "rover": "abstract"}
    order = ORDERS.from_document(
        {"format": "campaign-work/1", **document, "rover_profile": "k9", "seed": 1, "runs": 2}
    )
    assert ORDERS.read(json.dumps(ORDERS.document(order))) == order


def test_a_campaign_of_elsewhere_counts_for_no_rule_here(sqlite_planned_day: PlannedDay) -> None:
    """An archive's author may write any result; only what was flown here counts."""
    api = sqlite_planned_day.api
    plan, campaign = flown(sqlite_planned_day)
    settings: Settings = api.repo.settings
    object.__setattr__(api.repo, "settings", settings.model_copy(update={"approval_runs": 100}))

    def rules() -> dict[str, dict[str, Any]]:
        return {r["rule"]: r for r in api.get(f"/plans/{plan['id']}/flight-rules")}

    def forge(rows: dict[str, Any]) -> None:
        (row,) = rows["campaigns"]
        over = next(f for f in row["result"]["frequencies"] if f["what"] == "over budget")
        over |= {"runs": 0, "share": 0.0, "interval": {"low": 0.0, "high": 0.0}}
        row["result"]["runs"] = row["runs"] = 1_000_000
        row["author"] = "Nobody"
        rows["plans"][0]["summary"]["overrun_probability"] = 0.0
        rows["plans"][0]["findings"] = [{"severity": "error", "code": "E999", "message": "never found here"}]
        without_history(rows)

    assert rules()["FR-CAMPAIGN"]["value"] is not None
    whole = archive_of(api, plan["mission_id"], forge)
    assert brought_in(api, plan["mission_id"], whole).status_code == 201
    shown = api.get(f"/campaigns/{campaign['id']}")
    assert (shown["elsewhere"], shown["runs_done"]) == (True, 1_000_000)
    assert shown["author"] == "Nobody (elsewhere)"
    for revision, down in (("0009", True), ("head", False)):  # those of before the column are known by it too
        migrate(api.repo.database, revision, down=down)
    found = rules()
    for rule in ("FR-CAMPAIGN", "FR-OVERRUN"):
        assert (found[rule]["holds"], found[rule]["value"]) == (False, None), found[rule]
        assert "came with an archive" in found[rule]["detail"]
    assert found["FR-CRL"]["holds"]  # read anew: whatever was found elsewhere says nothing
    for what in ("runs", "runs.csv", "report"):
        shutil.rmtree(api.repo.campaign_dir(campaign["id"]), ignore_errors=True)
        told = problem(api("GET", f"/campaigns/{campaign['id']}/{what}"), 409, "wrong-state")["detail"]
        assert told.endswith("are not here: it came in with an archive; its result is")
    order = {"plan_id": plan["id"], "runs": 150, "seed": 5}
    api.post(f"/missions/{plan['mission_id']}/campaigns", order, status=202)
    api.jobs()
    found = rules()  # one that is flown here is flown in the world of the archive's problem
    for rule in ("FR-CAMPAIGN", "FR-OVERRUN"):
        assert (found[rule]["holds"], found[rule]["value"]) == (False, None), found[rule]


def test_of_two_campaigns_that_with_more_runs_flown_counts(sqlite_planned_day: PlannedDay) -> None:
    api = sqlite_planned_day.api
    plan, campaign = flown(sqlite_planned_day, runs=300)
    body = {"plan_id": plan["id"], "runs": 1000, "seed": 5, "until_se": 1000.0}
    api.post(f"/missions/{campaign['mission_id']}/campaigns", body, status=202)
    api.jobs()
    settings: Settings = api.repo.settings
    object.__setattr__(api.repo, "settings", settings.model_copy(update={"approval_runs": 300}))
    (rule,) = [r for r in api.get(f"/plans/{plan['id']}/flight-rules") if r["rule"] == "FR-CAMPAIGN"]
    assert "of 300 runs end over a budget" in rule["detail"]


def test_an_archive_with_a_campaign_of_another_form_is_refused(sqlite_planned_day: PlannedDay) -> None:
    api = sqlite_planned_day.api
    plan, campaign = flown(sqlite_planned_day, runs=10)

    def forge(rows: dict[str, Any]) -> None:
        rows["campaigns"][0]["result"]["frequencies"] = {}
        without_history(rows)

    answer = brought_in(api, plan["mission_id"], archive_of(api, plan["mission_id"], forge))
    assert f"the campaign {campaign['id']} of the archive is malformed" in answer.json()["detail"]


def test_a_backup_brings_the_runs_of_campaigns_back_and_a_sweep_takes_those_of_no_record(
    sqlite_planned_day: PlannedDay, tmp_path: Path
) -> None:
    api = sqlite_planned_day.api
    _plan, campaign = flown(sqlite_planned_day, runs=30)
    folder = api.repo.campaign_dir(campaign["id"])
    (folder / "runs.draft").write_text("left by a crash")
    backup(api.repo, tmp_path / "backup.tar")
    fresh = open_repository(settings_for(tmp_path / "fresh"))
    restore(fresh, tmp_path / "backup.tar")
    there = fresh.campaign_dir(campaign["id"])
    names = {p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file()} - {"runs.draft"}
    assert {p.relative_to(there).as_posix() for p in there.rglob("*") if p.is_file()} == names
    assert all((there / name).read_bytes() == (folder / name).read_bytes() for name in names)
    fresh.database.dispose()

    assert check_files(api.repo).strays == []
    mission = f"/missions/{campaign['mission_id']}"
    assert api("DELETE", mission, headers={"If-Match": "*"}, who="Administrator").status_code == 204
    assert campaign["id"] in check_files(api.repo).strays
    assert campaign["id"] not in sweep_files(api.repo)  # it is fresh
    os.utime(folder, (0, 0))
    assert campaign["id"] in sweep_files(api.repo)
    assert not folder.exists()
