"""One target or keep-out given and told in degrees or a projection: REST, bulk and the command line."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer

from ground.geo.place import Place
from ground.geo.site_frame import site_frame
from ground.resources.missions.value import Mission
from tests.ground.conftest import Api, yard
from tests.ground.geo.test_places_api import UTAH, change
from tests.ground.test_cli_resources import program, run, server  # noqa: F401  fixtures
from tests.ground.test_missions_api import problem
from tests.shared import needed

needed("pyproj")
HERE = site_frame(Place(**UTAH))
MARS = {"crs": "IAU_2015:49900", "x": 77.4508, "y": 18.4447}


@pytest.fixture
def mission(sqlite_api: Api, terrain_folder: Path) -> Mission:
    return yard(sqlite_api.repo, terrain_folder)


@pytest.fixture
def placed(sqlite_api: Api, mission: Mission) -> str:
    assert change(sqlite_api, mission.id, UTAH).status_code == 200
    return mission.id


def at(east: float, north: float, crs: str = "lonlat") -> dict[str, Any]:
    ((x, y),) = HERE.out([(east, north)], crs).tolist()
    return {"crs": crs, "x": x, "y": y}


def patch(api: Api, path: str, body: object) -> Any:
    tag = api("GET", path).headers["etag"]
    return api("PATCH", path, body, headers={"If-Match": tag})


@pytest.mark.parametrize("crs", ["lonlat", "EPSG:32612", "site"])
def test_a_target_is_made_moved_and_told_in_any_reference(sqlite_api: Api, placed: str, crs: str) -> None:
    api = sqlite_api
    made = api.post(f"/missions/{placed}/targets", {"name": "Rock", "at": at(4.0, 1.0, crs)})
    assert (made["position"]["east_m"], made["position"]["north_m"]) == pytest.approx((4.0, 1.0), abs=1e-5)
    assert made["at"] is None
    path = f"/targets/{made['id']}"
    moved = patch(api, path, {"at": at(2.0, -3.0, crs)}).json()
    assert (moved["position"]["east_m"], moved["position"]["north_m"]) == pytest.approx((2.0, -3.0), abs=1e-5)
    told = api.get(f"{path}?crs={crs}")["at"]
    assert told == {"crs": crs, **{axis: pytest.approx(at(2.0, -3.0, crs)[axis], abs=1e-8) for axis in "xy"}}
    again = patch(api, path, {"at": told}).json()["position"]
    assert (again["east_m"], again["north_m"]) == pytest.approx((2.0, -3.0), abs=1e-6)
    assert api.get(f"/missions/{placed}/targets?crs={crs}")["items"][0]["at"]["crs"] == crs
    assert api.get(path)["at"] is None


def test_a_keep_out_is_drawn_moved_and_told_in_degrees(sqlite_api: Api, placed: str) -> None:
    api, ring = sqlite_api, [(6.0, 6.0), (8.0, 6.0), (8.0, 8.5)]
    outline: dict[str, Any] = {"crs": "lonlat", "polygon": HERE.out(ring, "lonlat").tolist()}
    made = api.post(f"/missions/{placed}/keep-outs", {"at": outline})
    assert np.allclose(made["polygon_m"], ring, rtol=0.0, atol=1e-5)
    path = f"/keep-outs/{made['id']}"
    told = api.get(f"{path}?crs=lonlat")["at"]
    assert np.allclose(told["polygon"], outline["polygon"], rtol=0.0, atol=1e-10)
    shifted = HERE.out([(e + 1.0, n) for e, n in ring], "EPSG:32612").tolist()
    moved = patch(api, path, {"at": {"crs": "EPSG:32612", "polygon": shifted}}).json()
    assert moved["polygon_m"][0] == pytest.approx([7.0, 6.0], abs=1e-5)


def test_many_targets_come_in_degrees_as_one_act(sqlite_api: Api, placed: str) -> None:
    given = [{"at": at(float(n), 1.0)} for n in range(3)]
    done = sqlite_api.post(f"/missions/{placed}/targets/bulk", {"create": given}, status=200)
    assert len(done["created"]) == 3
    one = done["created"][0]
    update = [{"id": one["id"], "revision": one["revision"], "changes": {"at": at(5.0, 5.0)}}]
    sqlite_api.post(f"/missions/{placed}/targets/bulk", {"update": update}, status=200)
    assert sqlite_api.get(f"/targets/{one['id']}")["position"]["east_m"] == pytest.approx(5.0, abs=1e-5)
    swapped = {"at": {"crs": "lonlat", "x": UTAH["y"], "y": UTAH["x"]}}
    told = problem(
        sqlite_api("POST", f"/missions/{placed}/targets/bulk", {"create": [given[0], swapped]}),
        422,
        "invalid-input",
    )
    assert "looks swapped" in told["detail"]
    assert len(sqlite_api.get(f"/missions/{placed}/targets")["items"]) == 3


@pytest.mark.parametrize(
    ("body", "why"),
    [
        ({"at": {"crs": "lonlat", "x": UTAH["y"], "y": UTAH["x"]}}, "looks swapped"),
        ({"at": {"crs": "EPSG:32612", "x": 4251500, "y": 518334}}, "looks swapped"),
        ({"at": {"crs": "lonlat", "x": 5.0, "y": 50.0}}, "km from the site"),
        ({"at": {"crs": "lonlat", "x": -110.79, "y": 91.0}}, "latitude of 91"),
        ({"at": MARS}, "no transformation between"),
        ({"at": {"crs": "EPSG:99999999", "x": 1, "y": 1}}, "not a coordinate reference"),
        ({"at": {"crs": "site", "x": 2e5, "y": 1}}, "not within 100000 m"),
        ({"at": at(4.0, 1.0), "east_m": 4.0}, "east_m and at both"),
        ({"at": {"crs": "lonlat", "x": 1.0}}, "/at/y"),
        ({"east_m": 4.0}, "/north_m: north_m is missing"),
        ({"at": None}, "/at"),
    ],
)
def test_a_place_that_cannot_be_is_refused_in_one_line(
    sqlite_api: Api, placed: str, body: object, why: str
) -> None:
    answer = sqlite_api("POST", f"/missions/{placed}/targets", body)
    assert answer.status_code == 422
    told = answer.json()
    assert why in told["detail"] + str(told["errors"])
    assert sqlite_api.get(f"/missions/{placed}/targets")["items"] == []


def test_no_number_is_no_place(sqlite_api: Api, placed: str) -> None:
    for number in ("NaN", "Infinity", "1e400"):
        body = '{"at": {"crs": "lonlat", "x": %s, "y": 38.4}}' % number  # noqa: UP031
        answer = sqlite_api(
            "POST",
            f"/missions/{placed}/targets",
            content=body,
            headers={"Content-Type": "application/json"},
        )
        assert answer.status_code in {400, 422}, number


def test_a_mission_without_a_place_says_so(sqlite_api: Api, mission: Mission) -> None:
    told = sqlite_api("POST", f"/missions/{mission.id}/targets", {"at": at(4.0, 1.0)}).json()
    assert "the mission has no place on a body" in told["detail"]
    assert told["errors"][0]["pointer"] == "/at/crs"
    made = sqlite_api.post(f"/missions/{mission.id}/targets", {"at": {"crs": "site", "x": 4.0, "y": 1.0}})
    told = sqlite_api("GET", f"/targets/{made['id']}?crs=lonlat").json()
    assert "the mission has no place on a body" in told["detail"]
    assert sqlite_api.get(f"/targets/{made['id']}?crs=site")["at"] == {"crs": "site", "x": 4.0, "y": 1.0}


def test_the_command_line_takes_and_shows_degrees(
    run: Callable[..., str],  # noqa: F811
    sqlite_api: Api,
    placed: str,
    program: typer.Typer,  # noqa: F811
) -> None:
    assert program is not None
    here, there = at(4.0, 1.0), at(2.0, -3.0, "EPSG:32612")
    degrees = ("--lonlat", "--", repr(here["x"]), repr(here["y"]))
    target = run("target", "add", placed, "--name", "Rock", *degrees).split()[0]
    shown = run("target", "list", placed, "--lonlat")
    assert shown.endswith(f"lonlat  {here['x']:.10g},{here['y']:.10g}")
    metres = ("--crs", "EPSG:32612", f"x={there['x']!r}", f"y={there['y']!r}", "notes=moved")
    assert run("target", "set", target, *metres) == f"{target} revision 2"
    told = json.loads(run("target", "show", target, "--crs", "EPSG:32612"))
    assert (told["at"]["x"], told["notes"]) == (pytest.approx(there["x"], abs=1e-4), "moved")
    assert "name two references" in run("target", "list", placed, "--lonlat", "--crs", "site", code=2)
    assert "X Y" in run("target", "set", target, "--lonlat", "x=1", code=2)
    ring = [f"{x!r},{y!r}" for x, y in HERE.out([(6, 6), (8, 6), (8, 8)], "lonlat").tolist()]
    keep_out = run("keep-out", "add", placed, "--lonlat", "--", *ring)
    assert run("keep-out", "list", placed, "--lonlat").count(",") == 3
    wider = [f"{x!r},{y!r}" for x, y in HERE.out([(6, 6), (9, 6), (8, 8)], "EPSG:32612").tolist()]
    run("keep-out", "set", keep_out, "--crs", "EPSG:32612", *wider)
    assert sqlite_api.get(f"/keep-outs/{keep_out}")["polygon_m"][1][0] == pytest.approx(9.0, abs=1e-5)
