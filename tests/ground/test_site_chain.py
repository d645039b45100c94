"""The site chain over REST, on both databases: nothing is lost, and what is tied to a site moves with it."""

from __future__ import annotations

import io
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ground.gdr.history import verify_chains
from ground.resources.missions.value import Mission
from rover_iface.localization.site_frames import (
    LANDING,
    ROVER,
    Alias,
    FrameFile,
    FrameId,
    FrameSolution,
    parse_frame_file,
    print_frame_file,
    site,
)
from tests.ground.conftest import Api, yard
from tests.ground.test_missions_api import problem, upload
from tests.rover_iface.localization.test_site_frames import START, UPRIGHT, turned
from tests.shared import shared

SPREAD = np.diag([1e-3, 1e-3, 0.02, 0.3, 0.2, 0.1]) ** 2
RING = [[1.0, 1.0], [3.0, 1.0], [3.0, 2.5]]


def found(
    frame: FrameId, reference: FrameId, offset: tuple[float, float, float], label: str = "telemetry"
) -> FrameSolution:
    return FrameSolution(label, frame, reference, offset, UPRIGHT, START)


def chain_file() -> FrameFile:
    """Three sites, the second declared after a drive in the first; the third has a better solution."""
    return FrameFile(
        "MER2",
        "Master_SVF",
        (),
        ("adjusted", "telemetry"),
        (
            found(site(1), LANDING, (0.0, 0.0, 0.0)),
            found(site(2), site(1), (2.0, 3.0, 0.1)),
            Alias((1, 41), (2,)),
            found(site(3), site(2), (1.0, 1.0, 0.0)),
            found(site(3), site(2), (1.1, 0.9, 0.0), "adjusted"),
            found(site(3), site(2), (9.0, 9.0, 0.0), "guess"),
        ),
    )


def take_in(api: Api, mission: str, file: FrameFile, name: str = "chain.svf") -> Any:
    content = print_frame_file(file).encode()
    return api.post(f"/missions/{mission}/frame-files", {"upload_id": upload(api, name, content)})


def frames(api: Api, mission: str) -> dict[str, Any]:
    listed = api.get(f"/missions/{mission}/frames?limit=1000")["items"]
    return {f"{frame['name']} {'.'.join(map(str, frame['counter']))}": frame for frame in listed}


def choose(api: Api, frame: str, solution: str | None, **more: Any) -> Any:
    body = {"solution_id": solution, **more}
    answer = api("PUT", f"/frames/{frame}/solution", body, headers={"If-Match": "*"})
    assert answer.status_code == 200, answer.text
    return answer.json()


@pytest.fixture
def chain(api: Api, mission: Mission) -> tuple[Api, str, dict[str, Any]]:
    take_in(api, mission.id, chain_file())
    return api, mission.id, frames(api, mission.id)


def shifted(
    api: Api, known: dict[str, Any], offset: tuple[float, float, float], angle: float = 0.0
) -> dict[str, Any]:
    """Add a solution of site 2 that lies elsewhere and is turned, with a covariance."""
    body = {
        "label": "ground",
        "reference_id": known["SITE_FRAME 1"]["id"],
        "offset_m": list(offset),
        "quaternion": list(turned(angle)),
        "covariance": SPREAD.tolist(),
    }
    made: dict[str, Any] = api.post(f"/frames/{known['SITE_FRAME 2']['id']}/solutions", body)
    return made


def test_a_frame_file_goes_out_as_it_came_in(chain: tuple[Api, str, dict[str, Any]]) -> None:
    api, mission, known = chain
    answer = api("GET", f"/missions/{mission}/frame-files/export")
    assert answer.headers["content-type"] == "application/xml"
    assert parse_frame_file(answer.content) == chain_file()
    third = known["SITE_FRAME 3"]
    history = api.get(f"/missions/{mission}/solutions?frame_id={third['id']}")["items"]
    assert [(s["label"], s["in_use"]) for s in history] == [
        ("telemetry", False),
        ("adjusted", True),
        ("guess", False),
    ]
    assert history[0]["source"]["file_name"] == "chain.svf"
    assert api.get(f"/missions/{mission}")["anchor_frame_id"] == known["SITE_FRAME 0"]["id"]
    assert known["SITE_FRAME 2"]["declared_at"] == [1, 41]
    place = third["place"]
    assert (place["north_m"], place["east_m"], place["up_m"]) == pytest.approx((3.1, 3.9, -0.1))
    assert place["unknown_links"] == 3
    assert place["heading_rad"] == pytest.approx(0.0)


@pytest.mark.parametrize(
    ("name", "where"), [("mer2_master.svf", ""), ("mer2_site_137_master.rvf", "?site=137")]
)
def test_spirits_files_go_out_element_for_element(
    sqlite_api: Api, terrain_folder: Path, name: str, where: str
) -> None:
    content = shared(f"data/terrain/mer_spirit/{name}").read_bytes()
    mission = yard(sqlite_api.repo, terrain_folder).id
    body = {"upload_id": upload(sqlite_api, name, content)}
    record = sqlite_api.post(f"/missions/{mission}/frame-files", body)
    exported = sqlite_api("GET", f"/missions/{mission}/frame-files/export{where}")
    assert parse_frame_file(exported.content) == parse_frame_file(content)
    again = sqlite_api.post(f"/missions/{mission}/frame-files", body)
    assert (again["added"], again["known"]) == (0, record["added"])
    assert parse_frame_file(sqlite_api("GET", f"/missions/{mission}/frame-files/export{where}").content) == (
        parse_frame_file(content)
    )
    if not where:
        last = frames(sqlite_api, mission)["SITE_FRAME 138"]["place"]
        assert (last["north_m"], last["east_m"]) == pytest.approx((-2034.054, 3104.650), abs=1e-3)


def test_rover_poses_and_the_sites_they_are_in_come_from_two_files(
    chain: tuple[Api, str, dict[str, Any]],
) -> None:
    api, mission, _ = chain
    poses = FrameFile(
        "MER2",
        "Master_RVF",
        (2,),
        ("telemetry",),
        (
            found(FrameId(ROVER, (2, 10)), site(2), (4.0, 0.0, 0.0)),
            found(FrameId(ROVER, (2, 10, 7)), site(2), (4.0, 0.0, 0.0)),
        ),
    )
    take_in(api, mission, poses, "site2.rvf")
    known = frames(api, mission)
    assert (known["ROVER_FRAME 2.10"]["level"], known["ROVER_FRAME 2.10.7"]["level"]) == ("drive", "pose")
    assert known["ROVER_FRAME 2.10"]["place"]["north_m"] == pytest.approx(6.0)
    listed = api.get(f"/missions/{mission}/frames?level=drive&site=2")["items"]
    assert [frame["counter"] for frame in listed] == [[2, 10]]
    assert parse_frame_file(api("GET", f"/missions/{mission}/frame-files/export").content) == chain_file()
    assert parse_frame_file(api("GET", f"/missions/{mission}/frame-files/export?site=2").content) == poses
    answer = api("GET", f"/missions/{mission}/frame-files/export?site=8")
    assert "no rover poses in site 8" in problem(answer, 404, "not-found")["detail"]


def test_an_import_moves_nothing_and_a_file_that_grew_adds_what_is_new(
    chain: tuple[Api, str, dict[str, Any]],
) -> None:
    api, mission, known = chain
    more = found(site(4), site(3), (1.0, 0.0, 0.0))
    better = found(site(2), site(1), (2.5, 3.0, 0.1), "adjusted")
    grown = FrameFile(
        "MER2", "Master_SVF", (), ("adjusted", "telemetry"), (*chain_file().records, more, better)
    )
    record = take_in(api, mission, grown)
    assert (record["added"], record["known"]) == (2, 5)
    now = frames(api, mission)
    assert now["SITE_FRAME 2"]["solution_id"] == known["SITE_FRAME 2"]["solution_id"]
    assert now["SITE_FRAME 4"]["place"]["north_m"] == pytest.approx(4.1)


def test_a_choice_carries_along_what_is_tied_and_the_way_back_ends_where_it_began(
    chain: tuple[Api, str, dict[str, Any]],
) -> None:
    api, mission, known = chain
    second, third = known["SITE_FRAME 2"]["id"], known["SITE_FRAME 3"]["id"]
    target = api.post(
        f"/missions/{mission}/targets",
        {"name": "Adirondack", "east_m": 4.0, "north_m": 1.0, "frame_id": third},
    )
    loose = api.post(f"/missions/{mission}/targets", {"east_m": 4.0, "north_m": 1.2})
    ring = api.post(f"/missions/{mission}/keep-outs", {"polygon_m": RING, "frame_id": second})
    request = {"target_id": target["id"], "instrument": "science_camera", "value": 3.0}
    asked = api.post(f"/missions/{mission}/observation-requests", request)
    solution = shifted(api, known, (2.6, 2.4, 0.1), 0.1)

    preview = choose(api, second, solution["id"], preview=True)
    assert preview["preview"]
    assert api.get(f"/targets/{target['id']}") == target
    carried = choose(api, second, solution["id"], reason="panoramas of sol 5")
    assert carried["moved"] == preview["moved"]
    assert [(m["kind"], m["name"]) for m in carried["moved"]] == [
        ("target", "Adirondack"),
        ("keep_out", "Keep-out 1"),
    ]

    # by hand: from site 2's own axes (north, east, nadir) to the landing site's, turned by 0.1 about nadir
    def moved(east: float, north: float) -> tuple[float, float]:
        n, e, c, s = north - 2.0, east - 3.0, math.cos(0.1), math.sin(0.1)
        return 2.4 + s * n + c * e, 2.6 + c * n - s * e

    after = api.get(f"/targets/{target['id']}")
    place = after["position"]
    assert (place["east_m"], place["north_m"]) == pytest.approx(moved(4.0, 1.0), abs=1e-9)
    assert place["up_m"] == pytest.approx(target["position"]["up_m"])
    assert carried["moved"][0]["shift_m"] == pytest.approx(math.dist(moved(4.0, 1.0), (4.0, 1.0)), abs=1e-6)
    grown, own = np.array(after["covariance_m2"]), np.array(target["covariance_m2"])
    # the shift of site 2 (0.3 north, 0.2 east, 0.1 m) and its turn of 0.02 rad over the lever to the target
    lever = math.hypot(4.0 - 3.0, 1.0 - 2.0)
    assert np.trace(grown) - np.trace(own) == pytest.approx(
        0.3**2 + 0.2**2 + 0.1**2 + (0.02 * lever) ** 2, rel=1e-3
    )
    kept = api.get(f"/keep-outs/{ring['id']}")
    assert kept["polygon_m"] == [pytest.approx(moved(*corner), abs=1e-9) for corner in RING]
    assert kept["sigma_m"] == pytest.approx(0.3, abs=0.02)
    assert api.get(f"/targets/{loose['id']}") == loose
    point = api.get(f"/observation-requests/{asked['id']}")["observation_point"]
    assert point != asked["observation_point"]
    events = api.get(f"/missions/{mission}/history?newest_first=true&limit=4")["items"]
    assert [(e["action"], e["kind"]) for e in reversed(events)] == [
        ("choose", "frame"),
        ("carry", "target"),
        ("carry", "observation_request"),
        ("carry", "keep_out"),
    ]
    assert events[-1]["reason"] == "panoramas of sol 5"

    choose(api, second, known["SITE_FRAME 2"]["solution_id"])
    back = api.get(f"/targets/{target['id']}")
    for name in ("position", "normal", "covariance_m2", "slope_rad"):
        one, other = (
            np.array(list(v.values()) if isinstance(v, dict) else v) for v in (back[name], target[name])
        )
        assert one == pytest.approx(other, abs=1e-9), name
    assert api.get(f"/keep-outs/{ring['id']}")["polygon_m"] == [pytest.approx(c, abs=1e-9) for c in RING]
    with api.repo.database.read() as session:
        assert verify_chains(session)[1] == []


def test_undo_takes_back_a_choice_with_all_that_it_moved(chain: tuple[Api, str, dict[str, Any]]) -> None:
    api, mission, known = chain
    second = known["SITE_FRAME 2"]["id"]
    target = api.post(f"/missions/{mission}/targets", {"east_m": 4.0, "north_m": 1.0, "frame_id": second})
    solution = shifted(api, known, (2.6, 2.4, 0.1))
    choose(api, second, solution["id"])
    assert api.get(f"/targets/{target['id']}")["position"] != target["position"]
    api.post(f"/missions/{mission}/undo", {"anyone": True}, 200)
    kept = ("position", "normal", "covariance_m2", "frame_id")
    now = api.get(f"/targets/{target['id']}")
    assert {k: now[k] for k in kept} == {k: target[k] for k in kept}
    assert api.get(f"/frames/{second}")["solution_id"] == known["SITE_FRAME 2"]["solution_id"]
    api.post(f"/missions/{mission}/redo", {"anyone": True}, 200)
    assert api.get(f"/frames/{second}")["solution_id"] == solution["id"]


def test_a_choice_the_priority_would_not_make_goes_out_as_one_more_solution(
    chain: tuple[Api, str, dict[str, Any]], terrain_folder: Path
) -> None:
    api, mission, known = chain
    third = known["SITE_FRAME 3"]["id"]
    history = api.get(f"/missions/{mission}/solutions?frame_id={third}")["items"]
    choose(api, third, history[2]["id"])
    content = api("GET", f"/missions/{mission}/frame-files/export").content
    file = parse_frame_file(content)
    assert file.priority == ("chosen", "adjusted", "telemetry")
    assert file.records[:-1] == chain_file().records
    other = yard(api.repo, terrain_folder, "Other").id
    api.post(f"/missions/{other}/frame-files", {"upload_id": upload(api, "out.svf", content)})
    there = frames(api, other)["SITE_FRAME 3"]["place"]
    assert there == frames(api, mission)["SITE_FRAME 3"]["place"]
    assert there["north_m"] == pytest.approx(11.0)


def test_tied_targets_that_are_moved_or_untied_by_hand_stay_where_they_are_put(
    chain: tuple[Api, str, dict[str, Any]],
) -> None:
    api, mission, known = chain
    second = known["SITE_FRAME 2"]["id"]
    solution = shifted(api, known, (2.6, 2.4, 0.1))
    target = api.post(f"/missions/{mission}/targets", {"east_m": 4.0, "north_m": 1.0})
    change = {"headers": {"If-Match": "*"}}
    tied = api("PATCH", f"/targets/{target['id']}", {"frame_id": second}, **change).json()
    assert tied["position"] == target["position"]
    assert tied["covariance_m2"] == [pytest.approx(line) for line in target["covariance_m2"]]
    choose(api, second, solution["id"])
    moved = api("PATCH", f"/targets/{target['id']}", {"east_m": 2.0, "north_m": -5.0}, **change).json()
    assert moved["position"]["east_m"] == 2.0
    loose = api("PATCH", f"/targets/{target['id']}", {"frame_id": None}, **change).json()
    assert loose["position"] == moved["position"]
    assert np.trace(loose["covariance_m2"]) < np.trace(moved["covariance_m2"]) - 0.1
    choose(api, second, None)
    assert api.get(f"/targets/{target['id']}") == loose


def test_an_uncertain_keep_out_keeps_the_rover_off_more_ground() -> None:
    from ground.resources.keep_outs.rules import kept_clear

    assert kept_clear(RING, 0.0) == RING
    wide = np.array(kept_clear([[0, 0], [2, 0], [2, 2], [0, 2]], 0.25))
    assert (wide.min(), wide.max()) == pytest.approx((-0.5, 2.5))


def geotiff(*, placed: bool = True) -> bytes:
    import warnings

    import rasterio
    from affine import Affine

    out = io.BytesIO()
    where = {"transform": Affine(0.5, 0.0, -1.0, 0.0, -0.5, 3.0)} if placed else {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with rasterio.open(
            out, "w", driver="GTiff", width=8, height=4, count=1, dtype="float32", **where
        ) as file:
            file.write(np.zeros((1, 4, 8), np.float32))
    return out.getvalue()


def test_a_map_lies_where_its_site_lies(chain: tuple[Api, str, dict[str, Any]]) -> None:
    api, mission, known = chain
    second = known["SITE_FRAME 2"]["id"]
    body = {"frame_id": second, "upload_id": upload(api, "dem.tif", geotiff())}
    made = api.post(f"/missions/{mission}/site-maps", body)
    assert made["name"] == "dem"
    corners = [[2.0, 3.0], [6.0, 3.0], [6.0, 5.0], [2.0, 5.0]]
    assert made["outline_m"] == [pytest.approx(c) for c in corners]
    choose(api, second, shifted(api, known, (3.0, 3.0, 0.1))["id"])
    now = api.get(f"/site-maps/{made['id']}")
    assert now["outline_m"] == [pytest.approx([e, n + 1.0]) for e, n in corners]
    assert now["sigma_m"] == pytest.approx(0.3, abs=0.02)
    file = api("GET", f"/site-maps/{made['id']}/file")
    assert file.content == geotiff()
    body = {"frame_id": second, "upload_id": upload(api, "bare.tif", geotiff(placed=False))}
    answer = problem(api("POST", f"/missions/{mission}/site-maps", body), 422, "invalid-input")
    assert "does not say where it lies" in answer["detail"]
    body = {"frame_id": second, "upload_id": upload(api, "x.tif", b"no picture")}
    assert (
        "not a GeoTIFF"
        in problem(api("POST", f"/missions/{mission}/site-maps", body), 422, "invalid-input")["detail"]
    )


def test_choices_need_the_revision_that_was_seen_and_the_right_to_make_them(
    chain: tuple[Api, str, dict[str, Any]],
) -> None:
    api, _, known = chain
    frame = known["SITE_FRAME 2"]
    body = {"solution_id": frame["solution_id"]}
    problem(api("PUT", f"/frames/{frame['id']}/solution", body), 428, "precondition-required")
    stale = api("PUT", f"/frames/{frame['id']}/solution", body, headers={"If-Match": '"7"'})
    assert problem(stale, 412, "stale-revision")["current"]["id"] == frame["id"]
    answer = api("PUT", f"/frames/{frame['id']}/solution", body, headers={"If-Match": "*"}, who="Scientist")
    problem(answer, 403, "forbidden")
    other = {"solution_id": known["SITE_FRAME 3"]["solution_id"]}
    answer = api("PUT", f"/frames/{frame['id']}/solution", other, headers={"If-Match": "*"})
    assert "SITE_FRAME 2 has no solution" in problem(answer, 422, "invalid-input")["detail"]


def test_what_would_make_no_chain_is_refused(chain: tuple[Api, str, dict[str, Any]]) -> None:
    api, mission, known = chain
    second = known["SITE_FRAME 2"]["id"]
    circle = {
        "label": "circle",
        "reference_id": known["SITE_FRAME 3"]["id"],
        "offset_m": [0.0, 0.0, 0.0],
        "quaternion": list(UPRIGHT),
    }
    made = api.post(f"/frames/{second}/solutions", circle)
    api.post(f"/missions/{mission}/targets", {"east_m": 4.0, "north_m": 1.0, "frame_id": second})
    answer = api("PUT", f"/frames/{second}/solution", {"solution_id": made["id"]}, headers={"If-Match": "*"})
    assert "refers back to itself" in problem(answer, 409, "wrong-state")["detail"]
    answer = api("PUT", f"/frames/{second}/solution", {"solution_id": None}, headers={"If-Match": "*"})
    assert re.search("no solution in use ties", problem(answer, 409, "wrong-state")["detail"])
    wrong = {**circle, "quaternion": [0.5, 0.0, 0.0, 0.0]}
    answer = problem(api("POST", f"/frames/{second}/solutions", wrong), 422, "invalid-input")
    assert "quaternion of length 0.5" in answer["detail"]
    wrong = {**circle, "covariance": (-np.eye(6)).tolist()}
    answer = problem(api("POST", f"/frames/{second}/solutions", wrong), 422, "invalid-input")
    assert answer["errors"][0]["pointer"] == "/covariance"
    turning = FrameFile(
        "MER2",
        "Master_SVF",
        (),
        ("telemetry",),
        (found(site(8), site(9), (0.0, 0.0, 0.0)), found(site(9), site(8), (0.0, 0.0, 0.0))),
    )
    body = {"upload_id": upload(api, "c.svf", print_frame_file(turning).encode())}
    answer = problem(api("POST", f"/missions/{mission}/frame-files", body), 422, "invalid-input")
    assert "refers back to itself" in answer["detail"]
    body = {"upload_id": upload(api, "c.svf", b"<rmc_file")}
    problem(api("POST", f"/missions/{mission}/frame-files", body), 422, "invalid-input")
    assert "SITE_FRAME 8" not in frames(api, mission)


def test_the_anchor_changes_only_while_nothing_is_tied(chain: tuple[Api, str, dict[str, Any]]) -> None:
    api, mission, known = chain
    change = {"headers": {"If-Match": "*"}}
    second = known["SITE_FRAME 2"]["id"]
    assert api("PATCH", f"/missions/{mission}", {"anchor_frame_id": second}, **change).status_code == 200
    place = frames(api, mission)["SITE_FRAME 1"]["place"]
    assert (place["north_m"], place["east_m"], place["up_m"]) == pytest.approx((-2.0, -3.0, 0.1))
    api.post(f"/missions/{mission}/targets", {"east_m": 4.0, "north_m": 1.0, "frame_id": second})
    answer = api("PATCH", f"/missions/{mission}", {"anchor_frame_id": None}, **change)
    assert "1 targets are tied" in problem(answer, 409, "wrong-state")["detail"]


def test_frames_can_be_named_by_hand(api: Api, mission: Mission) -> None:
    made = api.post(f"/missions/{mission.id}/frames", {"name": "SITE_FRAME", "counter": [0]})
    assert api.get(f"/missions/{mission.id}")["anchor_frame_id"] == made["id"]
    assert made["place"]["unknown_links"] == 0
    stop = api.post(f"/missions/{mission.id}/frames", {"name": "ROVER_FRAME", "counter": [0, 4]})
    assert (stop["level"], stop["place"], stop["reason"][:24]) == ("drive", None, "no solution in use ties ")
    again = api("POST", f"/missions/{mission.id}/frames", {"name": "ROVER_FRAME", "counter": [0, 4]})
    problem(again, 409, "name-taken")
    wrong = api("POST", f"/missions/{mission.id}/frames", {"name": "SITE_FRAME", "counter": [0, 4]})
    assert "takes 1 to 1" in problem(wrong, 422, "invalid-input")["detail"]
