"""A sol closes over REST: package, training rover, products, what is carried over, and the sol after."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path
from shutil import copytree
from typing import Any

import pytest

from ground.errors import AlreadyExecutedError, InvalidInputError, JobFailedError
from ground.jobs.row import JobRow
from ground.records.actor import Actor, Role
from ground.resources.backups.check_files import sweep_files
from ground.resources.downlinks.ingest_run import ingest_run
from ground.resources.executions import execute_plan
from ground.resources.executions.order import ORDERS, ExecutionWork, Signer
from ground.resources.executions.work import work
from ground.resources.plans.draft import draft_of
from ground.uplink.keys import id_of
from ground.uplink.ledger import locked_ledger
from ground.uplink.package import manifest_text
from ground.uplink.training import TRUST_FILE, TrainedSigner, sign_package, training_trust
from ground.uplink.trust import checked
from mission import Sky, plugins
from rover_iface.errors import RoverError
from rover_iface.registry import require_simulated, simulated_rover_names
from tests.ground.approving import public_text, signed_by_all, team_of
from tests.ground.conftest import Api, yard
from tests.ground.planning import PlannedDay, file_requests, finished, planned
from tests.ground.test_missions_api import problem

OPERATOR = Actor("Operator", Role.OPERATOR)
ORDER = ExecutionWork(
    "run-1",
    mission="m1",
    counter=1,
    rover_dir="/nowhere/rover",
    package_path="/nowhere/package",
    run_dir="/nowhere/run",
    files_dir="/nowhere/files",
    terrain_dir="/nowhere/terrain",
    problem={"budget": {"time_s": 1.0}},
    rover="abstract",
    seed=1,
    rover_profile="reference",
    sky=Sky(),
    signers=(),
)
"""An order for nothing that is there."""


def uplinked(api: Api, mission: Any, keys: Path) -> dict[str, Any]:
    """Return a plan of Planner's that a dry run verified, both people signed and Operator packed."""
    plan = planned(api, mission)
    order = {"plan_id": plan["id"], "seed": 4}
    finished(api, api.post(f"/missions/{mission.id}/runs", order, status=202))
    signed_by_all(api, plan["id"], team_of(keys))
    assert api("POST", f"/plans/{plan['id']}/package", who="Operator").status_code == 200
    return plan


def people_of(api: Api, job: str) -> set[str]:
    """Return whose keys the order of an execution names."""
    with api.repo.database.read() as session:
        return {s.person for s in ORDERS.from_document(session.get_one(JobRow, job).payload).signers}


def test_a_sol_is_executed_and_the_next_begins_where_it_ended(
    sqlite_api: Api, terrain_folder: Path, tmp_path: Path
) -> None:
    api = sqlite_api
    mission = yard(api.repo, terrain_folder)
    file_requests(api, mission)
    too_soon = planned(api, mission)
    answer = problem(
        api("POST", f"/plans/{too_soon['id']}/execution", {}, who="Operator"), 409, "wrong-state"
    )
    assert "only an uplinked plan is executed" in answer["detail"]

    plan = uplinked(api, mission, tmp_path / "keys")
    url = f"/plans/{plan['id']}/execution"
    assert api("POST", url, {}, who="Planner").status_code == 403
    problem(api("POST", url, {"rover": "hound"}, who="Operator"), 422, "invalid-input")
    job = api.post(url, {"seed": 7}, who="Operator", status=202)["id"]
    for verb in ("cancel", "retry"):
        assert api("POST", f"/jobs/{job}/{verb}", who="Planner").status_code == 403
        assert api("POST", f"/jobs/{job}/{verb}", who="Operator").status_code == 200
    ended = finished(api, {"id": job})
    assert ended["state"] == "succeeded", ended["problem"]
    assert people_of(api, job) == {"Planner", "Flight Director"}
    run = api.get(ended["result_url"].removeprefix("/api/v1"))
    assert run["kind"] == "training"
    assert run["outcome"] == "SUCCEEDED"
    assert run["author"] == "Operator"
    assert api.get(f"/plans/{plan['id']}")["state"] == "uplinked"
    assert "on the training rover" in str(api.get(f"/missions/{mission.id}/observation-requests"))
    problem(api("POST", url, {}, who="Operator"), 409, "already-executed")
    states = {r["id"]: r["state"] for r in api.get(f"/missions/{mission.id}/observation-requests")["items"]}
    assert {states[r] for r in run["achieved_request_ids"]} == {"satisfied"}

    ends = api.get(f"/runs/{run['id']}/telemetry")
    sol = api.post(f"/runs/{run['id']}/next-sol", None, status=201)
    assert sol["number"] == 2
    assert sol["start_pose"]["east_m"] == ends["east_m"][-1]
    assert sol["start_pose"]["heading_rad"] == ends["heading_rad"][-1]
    first = api.get(f"/missions/{mission.id}/sols")["items"][0]
    assert [sol[k] for k in ("time_budget_s", "battery_j")] == [
        first[k] for k in ("time_budget_s", "battery_j")
    ]
    left = [
        r
        for r in api.get(f"/missions/{mission.id}/observation-requests")["items"]
        if r["state"] != "satisfied"
    ]
    assert {r["state"] for r in left} <= {"carried"}
    assert all(r["state_reason"].startswith("carried over from sol 1") for r in left)
    again = problem(api("POST", f"/runs/{run['id']}/next-sol"), 409, "wrong-state")
    assert "sol 2 was opened after sol 1 already" in again["detail"]

    kept = api.repo.run_dir(run["id"])
    with pytest.raises(AlreadyExecutedError, match="taken in before"):
        ingest_run(api.repo, OPERATOR, kept)
    real = tmp_path / "real"
    copytree(kept, real)
    document = json.loads((real / "run.json").read_text())
    assert document.pop("training") is True
    (real / "run.json").write_text(json.dumps(document))
    assert ingest_run(api.repo, OPERATOR, real).kind == "execution", "a real rover's run is taken in still"
    assert api.get(f"/plans/{plan['id']}")["state"] == "executed"
    assert "on the training rover" not in str(api.get(f"/missions/{mission.id}/observation-requests"))

    key = id_of(public_text(team_of(tmp_path / "keys").approver))
    assert api("DELETE", f"/signing-keys/{key}", who="Flight Director").status_code == 204
    with api.repo.database.write() as session:
        execute_plan.begin(session, session.get_one(JobRow, job))
    assert people_of(api, job) == {"Planner"}, "a key revoked since then does not count when it starts again"


def test_no_rover_but_a_simulated_one_of_ours_is_for_training(monkeypatch: pytest.MonkeyPatch) -> None:
    assert simulated_rover_names() == ["abstract", "full", "mujoco", "subframe"]
    real = EntryPoints([EntryPoint(name, "json:loads", "outcrop.rovers") for name in ("hound", "subframe")])
    monkeypatch.setattr(plugins, "entry_points", lambda group: real.select(group=group))
    for name in ("hound", "subframe"):
        with pytest.raises(
            RoverError, match=f"simulated, by one of abstract, full, mujoco; '{name}' is none of them"
        ):
            require_simulated(name)
        order = replace(ORDER, rover=name)
        with pytest.raises(JobFailedError, match="is none of them"):
            work(order, lambda _part, _what: None, lambda: False)
    require_simulated("abstract")


def test_a_rehearsal_ends_no_sol(sqlite_planned_day: PlannedDay) -> None:
    api, mission = sqlite_planned_day.api, sqlite_planned_day.mission
    order = {"plan_id": sqlite_planned_day.plan["id"], "seed": 4}
    job = finished(api, api.post(f"/missions/{mission.id}/runs", order, status=202))
    run = job["result_url"].removeprefix("/api/v1")
    answer = problem(api("POST", f"{run}/next-sol"), 409, "wrong-state")
    assert "a sol ends with an execution" in answer["detail"]


def test_a_training_rover_takes_the_keys_of_its_mission_as_they_stand(tmp_path: Path) -> None:
    team = team_of(tmp_path / "keys")
    ann = TrainedSigner("Ann", public_text(team.author), ("author", "verifier"))
    bob = TrainedSigner("Bob", public_text(team.approver), ("approver",))
    place = training_trust(tmp_path, "m1", [ann, bob])
    assert place.name == TRUST_FILE
    first = place.read_bytes()
    trust = checked(first)
    assert (trust.training, trust.missions, trust.version) == (True, ("m1",), 1)
    training_trust(tmp_path, "m1", [ann, bob])
    assert place.read_bytes() == first
    training_trust(tmp_path, "m1", [ann])
    later = checked(place.read_bytes(), pinned=trust.chain[-1])
    assert later.version == 2
    assert later.roles["approver"]["keys"] == []
    assert (tmp_path / "root.key").stat().st_mode & 0o777 == 0o600
    with pytest.raises(InvalidInputError, match="one key is one person's"):
        training_trust(tmp_path, "m1", [ann, TrainedSigner("Eve", public_text(team.author), ("approver",))])


@pytest.mark.parametrize(
    "name", ["ada@example.org", "Bob (elsewhere)", "O\N{RIGHT SINGLE QUOTATION MARK}Neil"]
)
def test_a_name_that_no_trust_file_holds_stops_nobody_else(tmp_path: Path, name: str) -> None:
    team = team_of(tmp_path / "keys")
    ann = TrainedSigner("Ann", public_text(team.author), ("author", "verifier"))
    odd = TrainedSigner(name, public_text(team.approver), ("approver",))
    trust = checked(training_trust(tmp_path, "m1", [ann, odd]).read_bytes())
    assert {key["person"] for key in trust.keys.values()} == {"Training", "Ann"}
    renamed = replace(odd, person="Ada")
    trust = checked(training_trust(tmp_path, "m1", [ann, renamed]).read_bytes())
    assert {key["person"] for key in trust.keys.values()} == {"Training", "Ann", "Ada"}
    later = checked(training_trust(tmp_path, "m1", [ann, replace(odd, person="Bea")]).read_bytes())
    assert {key["person"] for key in later.keys.values()} == {"Training", "Ann", "Bea"}

    about = {"mission": "m1", "plan": "p1", "counter": 1, "author": "Ann", "expires_utc": "2999-01-01T00:00Z"}
    package = tmp_path / "package"
    package.write_bytes(sign_package(team, manifest_text(about, "", "{}"), "", "{}"))
    signers = tuple(Signer(s.person, s.public, s.roles) for s in (ann, odd))
    order = replace(ORDER, rover_dir=str(tmp_path / "rover"), package_path=str(package), signers=signers)
    with pytest.raises(JobFailedError) as refused:
        work(order, lambda _part, _what: None, lambda: False)
    sentence = str(refused.value)
    assert "the package needs approver signatures of 1 trusted people, has 0; what" in sentence
    assert f"{name!r} signed does not count" in sentence


def test_trust_file_and_world_are_written_by_who_has_the_ledger(tmp_path: Path) -> None:
    home, package = tmp_path / "rover", tmp_path / "package"
    home.mkdir()
    team = team_of(tmp_path / "keys")
    about = {"mission": "m1", "plan": "p1", "counter": 1}
    package.write_bytes(sign_package(team, manifest_text(about, "", "{}"), "", "{}"))
    order = replace(ORDER, rover_dir=str(home), package_path=str(package))
    with locked_ledger(home, "another package"):
        before = {path.name for path in home.iterdir()}
        with pytest.raises(JobFailedError, match=r"is busy: .* does another package"):
            work(order, lambda _part, _what: None, lambda: False)
        assert {path.name for path in home.iterdir()} == before
    nowhere = replace(order, rover_dir=str(package / "rover"))
    with pytest.raises(JobFailedError, match=r"package: (File exists|Not a directory)"):
        work(nowhere, lambda _part, _what: None, lambda: False)


def test_what_a_deleted_mission_left_is_swept(sqlite_api: Api, terrain_folder: Path) -> None:
    repo = sqlite_api.repo
    mission = yard(repo, terrain_folder)
    file_requests(sqlite_api, mission)
    url = f"/missions/{mission.id}/plans"
    plan = sqlite_api.post(url, {"time_limit_s": 60.0}, status=202)["subject_id"]
    kept, left = repo.training_dir(mission.id), repo.training_dir("msn-gone")
    drafts = draft_of(repo, plan), draft_of(repo, "pln-gone")
    for folder in (kept, left, repo.job_dir()):
        folder.mkdir(parents=True, exist_ok=True)
    for path in drafts:
        path.write_text("{}")
    for path in (kept, left, *drafts):
        os.utime(path, (0.0, 0.0))
    assert sorted(sweep_files(repo)) == sorted([left.name, drafts[1].name])
    assert [path.exists() for path in (kept, left, *drafts)] == [True, False, True, False]
