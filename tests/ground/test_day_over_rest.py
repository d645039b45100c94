"""A whole day over REST: plan, dry run, approval, uplink, execution, downlink; on both databases."""

from __future__ import annotations

import io
import json
import zipfile
from pathlib import Path

import pytest

from ground.errors import AlreadyExecutedError
from ground.gdr.history import verify_chains
from ground.resources.history.verify_rows import verify_rows
from ground.resources.missions.value import Mission
from ground.uplink.execute import Place, execute_package
from tests.ground.approving import hand_in, signed_by_all, team_of
from tests.ground.conftest import Api
from tests.ground.planning import file_requests, finished, planned
from tests.ground.test_missions_api import problem, upload


def test_a_plan_keeps_to_the_chance_of_an_overrun_that_was_asked_for(api: Api, mission: Mission) -> None:
    file_requests(api, mission)
    free = planned(api, mission)
    assert api.get(f"/plans/{free['id']}/summary")["max_overrun_probability"] is None
    bound = planned(api, mission, max_overrun_probability=0.02)
    summary = api.get(f"/plans/{bound['id']}/summary")
    assert summary["max_overrun_probability"] == 0.02
    assert summary["overrun_probability"] <= 0.02
    document = api.get(f"/problems/{bound['problem_id']}")["document"]
    assert document["max_overrun_probability"] == 0.02
    changed = {"what_if": {"time_budget_s": 0.8 * document["budget"]["time_s"]}, "parent_id": bound["id"]}
    child = planned(api, mission, **changed)
    assert api.get(f"/plans/{child['id']}/summary")["max_overrun_probability"] == 0.02
    for wrong in (0.0, 1.0, -0.1, "0.1"):
        answer = api(
            "POST",
            f"/missions/{mission.id}/plans",
            {"iterations": 3, "max_overrun_probability": wrong},
        )
        assert "max_overrun_probability" in str(problem(answer, 422, "invalid-input")["errors"])


def test_a_day_goes_from_targets_to_products_and_back(api: Api, mission: Mission, tmp_path: Path) -> None:
    requests = file_requests(api, mission)

    # Planning
    plan = planned(api, mission)
    assert (plan["state"], plan["status"], plan["stale"]) == ("computed", "planned", False)
    assert set(plan["planned_request_ids"]) == {r["id"] for r in requests.values()}
    url = f"/plans/{plan['id']}"
    assert api.get(f"{url}/tree")["format"] == "plan-tree/2"
    assert api.get(f"{url}/summary")["crl_sha256"] == plan["crl_sha256"]
    assert api("GET", f"{url}/crl").text.startswith("(plan :id pln-")
    assert api.get(f"/observation-requests/{requests['Near']['id']}")["state"] == "planned"
    network = api.get(f"/path-networks/{plan['network_id']}")
    assert {"start"} < {n["id"] for n in network["nodes"]}
    assert network["segments"]
    assert api.get(f"/problems/{plan['problem_id']}")["document"]["format"] == "problem/2"

    # Dry run: the same seed gives the same run
    order = {"plan_id": plan["id"], "seed": 4}
    runs = [
        api.get(finished(api, api.post(f"/missions/{mission.id}/runs", order, status=202))["result_url"])
        for _ in range(2)
    ]
    assert runs[0]["outcome"] == "SUCCEEDED"
    assert runs[0]["utility"] == runs[1]["utility"]
    run = runs[0]
    telemetry = api.get(f"/runs/{run['id']}/telemetry")
    assert telemetry["complete"]
    assert len(telemetry["t_s"]) == len(telemetry["east_m"]) == len(telemetry["battery_j"]) > 5
    trace = api.get(f"/runs/{run['id']}/trace")
    assert trace["events"][0]["event"] == "start"
    stream = api("GET", f"/runs/{run['id']}/events").text
    assert stream.count("event: trace") == len(trace["events"])
    assert "event: end" in stream
    products = api.get(f"/missions/{mission.id}/products?run_id={run['id']}")["items"]
    assert products
    for product in products:
        file = api("GET", product["file_url"])
        assert file.headers["etag"] == f'"{product["sha256"]}"'
        assert len(file.content) == product["size_bytes"]
        lineage = api.get(f"/products/{product['id']}/lineage")
        kinds = {n["kind"] for n in lineage["nodes"]}
        assert kinds == {"target", "observation_request", "plan", "run", "task", "product"}
        back = api.get(f"/targets/{product['target_id']}/lineage")
        assert product["id"] in {n["id"] for n in back["nodes"]}
    part = api("GET", products[-1]["file_url"], headers={"Range": "bytes=0-3"})
    assert (part.status_code, part.content) == (206, file.content[:4])
    assert api.get(url)["state"] == "verified"

    # Approval by a second person's signature, bound to the text
    team = team_of(tmp_path / "keys")
    by = (api, plan["id"])
    problem(hand_in(*by, "approver", "Planner", team.author), 403, "forbidden")
    wrong = hand_in(*by, "approver", "Flight Director", team.approver, sha256="0" * 64)
    problem(wrong, 422, "invalid-input")
    problem(api("POST", f"{url}/package", who="Operator"), 409, "wrong-state")
    signed = signed_by_all(api, plan["id"], team)
    assert [(s["role"], s["person"]) for s in signed["signatures"]] == [
        ("author", "Planner"),
        ("verifier", "Planner"),
        ("approver", "Flight Director"),
    ]
    (approval,) = api.get(f"/missions/{mission.id}/approvals")["items"]
    assert (approval["approver"], approval["void"]) == ("Flight Director", False)
    assert api.get(f"{url}/statement") == signed

    # Uplink: the same package however often it is asked for
    package = api("POST", f"{url}/package", who="Operator")
    assert package.status_code == 200, package.text
    assert api("POST", f"{url}/package", who="Operator").content == package.content
    assert api.get(url)["state"] == "uplinked"

    # Execution without the ground
    (tmp_path / "package.zip").write_bytes(package.content)
    world = tmp_path / "world"
    world.mkdir()
    document = api.get(f"/problems/{plan['problem_id']}")["document"]
    ground = str(api.repo.terrain_dir(mission.terrain_id))
    (world / "world.json").write_text(
        json.dumps({"format": "world/1", "name": "yard", "terrain": ground, "problem": document})
    )
    place = Place("abstract", world, team.trust, seed=4)
    _, flight = execute_package(tmp_path / "package.zip", place, tmp_path / "run")
    assert flight.outcome.utility == run["utility"]
    with pytest.raises(AlreadyExecutedError, match="was executed before"):
        execute_package(tmp_path / "package.zip", place, tmp_path / "again")

    # Downlink
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for file_ in sorted((tmp_path / "run").rglob("*")):
            archive.write(file_, file_.relative_to(tmp_path))
    taken = api.post(
        "/runs/ingest", {"upload_id": upload(api, "run.zip", out.getvalue())}, who="Administrator"
    )
    assert (taken["kind"], taken["utility"]) == ("execution", run["utility"])
    again = api(
        "POST", "/runs/ingest", {"upload_id": upload(api, "run.zip", out.getvalue())}, who="Administrator"
    )
    problem(again, 409, "already-executed")
    assert api.get(url)["state"] == "executed"
    streamed = api("GET", f"/runs/{taken['id']}/events").text
    assert streamed.count("event: trace") == len(api.get(f"/runs/{taken['id']}/trace")["events"])
    assert api.get(f"/runs/{taken['id']}/snapshot")["outcome"] == taken["outcome"]
    came = api.get(f"/missions/{mission.id}/products?run_id={taken['id']}")["items"]
    assert {p["sha256"] for p in came} == {p["sha256"] for p in products}
    assert not [p for p in came if p["orphan"]]
    states = {n: api.get(f"/observation-requests/{r['id']}")["state"] for n, r in requests.items()}
    answered = {p["request_id"] for p in came}
    assert states == {n: "satisfied" if r["id"] in answered else states[n] for n, r in requests.items()}
    assert set(states.values()) <= {"satisfied", "failed", "attempted", "open"}
    with api.repo.database.read() as session:
        assert verify_chains(session)[1] == verify_rows(session).faults == []


def test_any_edit_voids_an_approval(sqlite_api: Api, terrain_folder: Path, tmp_path: Path) -> None:
    from tests.ground.conftest import yard

    api = sqlite_api
    mission = yard(api.repo, terrain_folder)
    requests = file_requests(api, mission)
    plan = planned(api, mission)
    run = {"plan_id": plan["id"], "seed": 4}
    finished(api, api.post(f"/missions/{mission.id}/runs", run, status=202))
    team, url = team_of(tmp_path / "keys"), f"/plans/{plan['id']}"
    broken = [rule["rule"] for rule in api.get(f"{url}/flight-rules") if not rule["holds"]]
    if broken:
        refused = hand_in(api, plan["id"], "approver", "Flight Director", team.approver)
        assert broken[0] in problem(refused, 409, "wrong-state")["detail"]
    signed_by_all(api, plan["id"], team)
    api(
        "PATCH", f"/observation-requests/{requests['Near']['id']}", {"value": 21.0}, headers={"If-Match": "*"}
    )
    assert api.get(url)["stale"] is True
    assert api.get(f"/missions/{mission.id}/approvals")["items"][0]["void"] is True
    answer = problem(api("POST", f"{url}/package", who="Operator"), 409, "wrong-state")
    assert "was edited since" in answer["detail"]


def test_what_cannot_be_reached_is_left_out_with_its_reason(sqlite_api: Api, terrain_folder: Path) -> None:
    from tests.ground.conftest import yard

    api = sqlite_api
    mission = yard(api.repo, terrain_folder)
    requests = file_requests(api, mission)
    ring = [[1.0, -2.0], [7.0, -2.0], [7.0, 4.0], [1.0, 4.0]]
    api.post(f"/missions/{mission.id}/keep-outs", {"polygon_m": ring})
    plan = planned(api, mission)
    assert requests["Near"]["id"] in plan["left_out"]
    why = api.get(f"/plans/{plan['id']}/why-not/{requests['Near']['id']}")
    assert (why["limit"], why["reason"]) == ("reachability", plan["left_out"][requests["Near"]["id"]])
    inside = api("GET", f"/plans/{plan['id']}/why-not/{requests['Far']['id']}")
    assert "is in the plan" in problem(inside, 422, "invalid-input")["detail"]
    assert plan["planned_request_ids"] == [requests["Far"]["id"]]


def test_a_budget_too_small_for_anything_gives_an_empty_plan_that_says_so(
    sqlite_api: Api, terrain_folder: Path
) -> None:
    from tests.ground.conftest import yard

    api = sqlite_api
    mission = yard(api.repo, terrain_folder)
    requests = file_requests(api, mission)
    sol = api.get(f"/missions/{mission.id}/sols")["items"][0]
    api("PATCH", f"/sols/{sol['id']}", {"time_budget_s": 5.0}, headers={"If-Match": "*"})
    plan = planned(api, mission)
    assert (plan["status"], plan["planned_request_ids"]) == ("empty", [])
    why = api.get(f"/plans/{plan['id']}/why-not/{requests['Near']['id']}")
    assert "time" in why["reason"]
    twin = planned(api, mission, seed=2)
    compared = api.get(f"/plans/{plan['id']}/comparison/{twin['id']}")
    assert (compared["difference"], compared["only_in_a"], compared["only_in_b"]) == (0.0, [], [])
    assert set(plan["left_out"]) == {r["id"] for r in requests.values()}


def test_a_must_do_that_cannot_be_done_fails_the_job_with_the_reason(
    sqlite_api: Api, terrain_folder: Path
) -> None:
    from tests.ground.conftest import yard

    api = sqlite_api
    mission = yard(api.repo, terrain_folder)
    requests = file_requests(api, mission)
    sol = api.get(f"/missions/{mission.id}/sols")["items"][0]
    api("PATCH", f"/sols/{sol['id']}", {"time_budget_s": 5.0}, headers={"If-Match": "*"})
    must = {"must_do": True}
    api("PATCH", f"/observation-requests/{requests['Near']['id']}", must, headers={"If-Match": "*"})
    job = finished(api, api.post(f"/missions/{mission.id}/plans", {"iterations": 1}, status=202))
    assert job["state"] == "failed"
    assert job["problem"]["type"] == "urn:outcrop:problem:plan-infeasible"
    assert api.get(f"/plans/{job['subject_id']}")["status"] == "infeasible"
    problem(api("GET", f"/plans/{job['subject_id']}/tree"), 409, "wrong-state")
    order = {"plan_id": job["subject_id"]}
    problem(api("POST", f"/missions/{mission.id}/runs", order), 409, "wrong-state")


def test_a_run_can_be_given_faults_and_refuses_malformed_ones(sqlite_api: Api, terrain_folder: Path) -> None:
    from tests.ground.conftest import yard

    api = sqlite_api
    mission = yard(api.repo, terrain_folder)
    file_requests(api, mission)
    plan = planned(api, mission)
    bad = {"plan_id": plan["id"], "faults": [{"kind": "slow-drive", "amount": 2.0}]}
    answer = problem(api("POST", f"/missions/{mission.id}/runs", bad), 422, "invalid-input")
    assert answer["errors"][0]["pointer"] == "/faults/0"
    good = {"plan_id": plan["id"], "faults": [{"kind": "camera-failure", "at_s": 1.0}]}
    job = finished(api, api.post(f"/missions/{mission.id}/runs", good, status=202))
    run = api.get(job["result_url"])
    assert run["utility"] == 0.0
    assert api.get(f"/missions/{mission.id}/products?run_id={run['id']}")["items"] == []
    other = {"plan_id": plan["id"], "rover": "nobody"}
    assert (
        "installed are abstract"
        in problem(api("POST", f"/missions/{mission.id}/runs", other), 422, "invalid-input")["detail"]
    )
