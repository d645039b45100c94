"""Any act can be taken back, not only the last; where a later one rests on it the refusal names that."""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest
from sqlalchemy import select, text

from ground.gdr.repository import Repository
from ground.records.actor import SYSTEM_ACTOR, Actor, Role
from ground.records.edit import open_for_change, update
from ground.resources.frames.row import FrameRow
from ground.resources.history.undo import redo, undo
from ground.resources.kinds import KINDS
from ground.resources.mission_archives.import_mission import import_mission
from ground.resources.missions.value import Mission
from ground.resources.solutions.choose_solution import GivenSolution, insert_solution
from ground.resources.targets.bodies import TargetCreate
from ground.resources.targets.create_target import create_target
from ground.resources.targets.row import TargetRow
from studies.flipped_bits import ARCHIVE
from studies.undo_in_any_order import BAD, digest, study
from tests.ground.conftest import PLANNER, Api


def last(api: Api, mission: Mission) -> int:
    return int(api.get(f"/missions/{mission.id}/history?newest_first=true&limit=1")["items"][0]["seq"])


@pytest.fixture
def rock(api: Api, mission: Mission) -> dict[str, Any]:
    made: dict[str, Any] = api.post(
        f"/missions/{mission.id}/targets", {"east_m": 1.0, "north_m": 1.0, "name": "Rock"}
    )
    return made


def change(api: Api, path: str, given: dict[str, Any]) -> None:
    answer = api("PATCH", path, given, headers={"If-Match": "*"})
    assert answer.status_code == 200, answer.text


def test_an_act_of_any_age_is_taken_back_and_later_ones_stay(
    api: Api, mission: Mission, rock: dict[str, Any]
) -> None:
    change(api, f"/targets/{rock['id']}", {"notes": "flat"})
    notes = last(api, mission)
    change(api, f"/targets/{rock['id']}", {"name": "Slab"})
    api.post(f"/missions/{mission.id}/undo", {"event": notes}, 200)
    found = api.get(f"/targets/{rock['id']}")
    assert (found["name"], found["notes"]) == ("Slab", "")
    api.post(f"/missions/{mission.id}/redo", {"event": notes}, 200)
    assert api.get(f"/targets/{rock['id']}")["notes"] == "flat"
    answer = api("POST", f"/missions/{mission.id}/redo", {"event": notes})
    assert (answer.status_code, "stands" in answer.json()["detail"]) == (409, True)


def test_a_later_act_that_rests_on_it_is_named(api: Api, mission: Mission, rock: dict[str, Any]) -> None:
    made = last(api, mission)
    request = {"target_id": rock["id"], "instrument": "science_camera", "value": 1.0}
    api.post(f"/missions/{mission.id}/observation-requests", request)
    resting = last(api, mission)
    answer = api("POST", f"/missions/{mission.id}/undo", {"event": made})
    assert (answer.status_code, answer.json()["event"]) == (409, resting)
    assert f"act {resting} (create observation request" in answer.json()["detail"]
    api.post(f"/missions/{mission.id}/undo", {"event": resting}, 200)
    api.post(f"/missions/{mission.id}/undo", {"event": made}, 200)
    assert api.get(f"/missions/{mission.id}/targets")["items"] == []


def test_a_name_that_was_taken_since_names_who_took_it(
    api: Api, mission: Mission, rock: dict[str, Any]
) -> None:
    assert api("DELETE", f"/targets/{rock['id']}", headers={"If-Match": "*"}).status_code == 204
    gone = last(api, mission)
    api.post(f"/missions/{mission.id}/targets", {"east_m": 2.0, "north_m": 1.0, "name": "Rock"})
    answer = api("POST", f"/missions/{mission.id}/undo", {"event": gone})
    assert (answer.status_code, answer.json()["event"]) == (409, last(api, mission))


def test_a_circle_of_requests_does_not_come_back(api: Api, mission: Mission, rock: dict[str, Any]) -> None:
    url = f"/missions/{mission.id}/observation-requests"
    given = {"target_id": rock["id"], "instrument": "science_camera", "value": 1.0}
    a, b = (api.post(url, given)["id"] for _ in range(2))
    change(api, f"/observation-requests/{a}", {"after": [b]})
    change(api, f"/observation-requests/{a}", {"after": []})
    taken_out = last(api, mission)
    change(api, f"/observation-requests/{b}", {"after": [a]})
    answer = api("POST", f"/missions/{mission.id}/undo", {"event": taken_out})
    assert (answer.status_code, answer.json()["event"]) == (409, last(api, mission))


def test_what_is_no_act_of_people_is_refused_by_name(api: Api, mission: Mission) -> None:
    answer = api("POST", f"/missions/{mission.id}/undo", {"event": 1})
    assert (answer.status_code, "cannot be undone" in answer.json()["detail"]) == (409, True)
    assert api("POST", f"/missions/{mission.id}/undo", {"event": 999}).status_code == 404
    rock = {"east_m": 1.0, "north_m": 1.0}
    api.post(f"/missions/{mission.id}/targets", rock, who="Scientist")
    event = {"event": last(api, mission)}
    assert api("POST", f"/missions/{mission.id}/undo", event).status_code == 409
    api.post(f"/missions/{mission.id}/undo", {**event, "anyone": True}, 200)


def test_a_frame_does_not_go_with_solutions_that_a_job_made(api: Api, mission: Mission) -> None:
    url = f"/missions/{mission.id}/frames"
    site, other = (api.post(url, {"name": "SITE_FRAME", "counter": [n]})["id"] for n in (1, 2))
    made = last(api, mission)
    given = GivenSolution("adjusted", site, [1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0])
    with api.repo.database.write() as session:
        frame = session.get_one(FrameRow, other)
        solution = insert_solution(session, SYSTEM_ACTOR, frame, given, {"kind": "traverse"}).id
    answer = api("POST", f"/missions/{mission.id}/undo", {"event": made})
    assert (answer.status_code, answer.json()["event"]) == (409, last(api, mission))
    assert f"localization solution {solution} by system) rests on it" in answer.json()["detail"]
    assert api.get(f"/solutions/{solution}")["frame_id"] == other


def test_a_large_act_is_taken_back_whole_and_however_far_back(
    repo: Repository, mission: Mission, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ground.resources.history.undo.LOOK_BACK", 3)
    given = [TargetCreate(east_m=0.1 * n, north_m=1.0) for n in range(8)]
    with repo.database.act(lambda _session: None):
        for body in given:
            create_target(repo, PLANNER, mission.id, body)
    scientist = Actor("Scientist", Role.SCIENTIST)
    for body in given:
        create_target(repo, scientist, mission.id, body)
    assert len(undo(repo, PLANNER, mission.id)) == 8
    assert len(redo(repo, PLANNER, mission.id)) == 8
    assert len(undo(repo, PLANNER, mission.id)) == 8
    assert len(undo(repo, scientist, mission.id)) == 1
    with repo.database.read() as session:
        assert len(session.scalars(select(TargetRow)).all()) == 7


def blocked(repo: Repository) -> bool:
    """Return whether somebody waits for a lock; on the embedded database a writer always does."""
    if repo.database.is_sqlite:
        return True
    waits = "SELECT count(*) FROM pg_stat_activity WHERE datname = current_database()"
    with repo.database.engine.connect() as connection:
        return bool(connection.scalar(text(f"{waits} AND wait_event_type = 'Lock'")))


def test_an_edit_and_an_undo_at_the_same_time_do_not_wait_for_each_other(
    repo: Repository, mission: Mission
) -> None:
    target = create_target(repo, PLANNER, mission.id, TargetCreate(east_m=1.0, north_m=1.0, name="Rock"))
    kind = KINDS["target"]
    with ThreadPoolExecutor(1) as pool:
        with repo.database.write() as session:
            row = open_for_change(session, PLANNER, kind, target.id, None)
            undone = pool.submit(undo, repo, PLANNER, mission.id)
            end = time.monotonic() + 60.0
            while not blocked(repo):
                assert time.monotonic() < end
                time.sleep(0.01)
            update(session, PLANNER, kind, row, {"name": "Slab"})
        assert [event.action for event in undone.result(60.0)] == ["undo"]
    with repo.database.read() as session:
        assert session.get_one(TargetRow, target.id).name == "Rock"


def test_random_acts_taken_back_in_random_order_leave_the_first_mission(repo: Repository) -> None:
    found = study(repo, 40, 11)
    assert found["undone"] == found["acts"] > 30
    assert [found[name] for name in BAD] == [0, 0, 0, 0]


def test_the_digest_sees_a_change(api: Api, mission: Mission, repo: Repository, rock: dict[str, Any]) -> None:
    before = digest(repo, mission.id)
    change(api, f"/targets/{rock['id']}", {"notes": "flat"})
    assert digest(repo, mission.id) != before


def test_a_mission_is_looked_at_as_any_event_left_it(
    api: Api, mission: Mission, rock: dict[str, Any]
) -> None:
    made = last(api, mission)
    change(api, f"/targets/{rock['id']}", {"name": "Slab"})
    renamed = last(api, mission)
    assert api("DELETE", f"/targets/{rock['id']}", headers={"If-Match": "*"}).status_code == 204
    gone = last(api, mission)
    api.post(f"/missions/{mission.id}/undo", {}, 200)
    url = f"/missions/{mission.id}/as-of"

    def names(event: int) -> list[str]:
        return [target["name"] for target in api.get(f"{url}/{event}")["parts"].get("targets", [])]

    assert [names(event) for event in (1, made, renamed, gone, gone + 1)] == [
        [],
        ["Rock"],
        ["Slab"],
        [],
        ["Slab"],
    ]
    assert api.get(f"{url}/{made}")["mission"]["name"] == "Yard"
    assert api("GET", f"{url}/999").status_code == 404
    copy = api.post(f"/missions/{mission.id}/copy", {"name": "Copy"})["id"]
    newest = int(api.get(f"/missions/{copy}/history?newest_first=true&limit=1")["items"][0]["seq"])
    parts = api.get(f"/missions/{copy}/as-of/{newest}")["parts"]
    assert [target["name"] for target in parts["targets"]] == ["Slab"]


def test_what_came_with_an_archive_is_there_as_of_its_import(api: Api) -> None:
    mission = import_mission(api.repo, SYSTEM_ACTOR, ARCHIVE).id
    newest = int(api.get(f"/missions/{mission}/history?newest_first=true&limit=1")["items"][0]["seq"])
    (near, *_) = api.get(f"/missions/{mission}/targets")["items"]
    change(api, f"/targets/{near['id']}", {"name": "Slab"})
    assert api("DELETE", f"/targets/{near['id']}", headers={"If-Match": "*"}).status_code == 204
    parts = api.get(f"/missions/{mission}/as-of/{newest}")["parts"]
    assert {target["name"] for target in parts["targets"]} == {"Near", "Far"}
    assert len(parts["observation_requests"]) == 3
