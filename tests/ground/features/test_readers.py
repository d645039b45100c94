"""Who reads features: GDAL's own driver at the right place, and people by their rights; Mars; no place."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import shapely
import uvicorn

from ground.app.service import build_app
from ground.gdr.ids import new_id
from ground.geo.place import Place
from ground.geo.site_frame import site_frame
from ground.resources.people.row import PersonRow
from tests.ground.features.conftest import MARS, RING, World
from tests.shared import needed

needed("pyogrio")
pyproj = needed("pyproj")


@pytest.fixture(scope="module")
def address(world: World) -> Iterator[str]:
    """Serve the repository over a socket; give the address of its interface."""
    app = build_app(world.api.repo, with_worker=False)
    running = uvicorn.Server(uvicorn.Config(app, port=0, log_level="error"))
    thread = threading.Thread(target=running.run, daemon=True)
    thread.start()
    while not running.started:
        assert thread.is_alive()
        time.sleep(0.01)
    yield f"http://127.0.0.1:{running.servers[0].sockets[0].getsockname()[1]}/api/v1"
    running.should_exit = True
    thread.join(20.0)


READER = """
import json, sys
import pyogrio
source, layer, options = json.loads(sys.argv[1])
if layer is None:
    print(json.dumps(pyogrio.list_layers(source)[:, 0].tolist()))
else:
    meta, _, shapes, columns = pyogrio.raw.read(source, layer=layer, **options)
    names = meta["fields"].tolist()
    found = dict(zip(names, ([str(v) for v in column] for column in columns)))
    print(json.dumps([meta["crs"], [bytes(shape).hex() for shape in shapes], found]))
"""
"""In a process of its own: the driver keeps the interpreter's lock while it waits for our answer."""


def gdal(address: str, mission: str, layer: str | None, **options: Any) -> Any:
    source = f"OAPIF:{address}/missions/{mission}/features"
    command = [sys.executable, "-c", READER, json.dumps([source, layer, options])]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60.0)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def read(address: str, mission: str, layer: str, **options: Any) -> tuple[str, list[Any], dict[str, Any]]:
    """Return what GDAL reads of a layer: its reference, the geometries x before y, the columns."""
    crs, shapes, columns = gdal(address, mission, layer, **options)
    return crs, [shapely.from_wkb(shape) for shape in shapes], columns


def in_site(shape: Any, crs: str, place: dict[str, Any]) -> Any:
    """Return corners in site metres by pyproj, from what GDAL says they count in."""
    frame = site_frame(Place(**place))
    way = pyproj.Transformer.from_crs(pyproj.CRS(crs), frame.grid, always_xy=True)
    points = shapely.get_coordinates(shape)
    x, y = way.transform(points[:, 0], points[:, 1])
    return (np.column_stack([x, y]) - frame._origin) @ frame._turn


def test_gdal_lists_the_collections(world: World, address: str) -> None:
    assert gdal(address, world.earth, None) == [
        "targets",
        "keep-outs",
        "traverses",
        "footprints",
        "ribbons",
        "runs",
    ]


@pytest.mark.parametrize("crs", [None, "EPSG:4326", "EPSG:32612"])
def test_gdal_opens_targets_and_keep_outs_at_the_right_place(
    world: World, address: str, crs: str | None
) -> None:
    place = {"crs": "EPSG:32612", "x": 518_334.0, "y": 4_251_500.0}
    options = {} if crs is None else {"CRS": crs}
    told, shapes, columns = read(address, world.earth, "targets", **options)
    assert sorted(columns["name"]) == ["Far", "Größe", "Near"]
    near = shapes[columns["name"].index("Near")]
    assert in_site(near, told, place) == pytest.approx(np.array([[4.0, 1.0]]), abs=1e-3)
    told, (ring,), _ = read(address, world.earth, "keep-outs", **options)
    assert in_site(ring, told, place)[:3] == pytest.approx(np.array(RING), abs=1e-3)


def test_gdal_hands_its_filter_to_the_server(world: World, address: str) -> None:
    _, shapes, columns = read(address, world.earth, "targets", where="name = 'Near' AND request_count > 0")
    assert (len(shapes), columns["name"]) == (1, ["Near"])


@pytest.mark.parametrize("options", [{}, {"CRS": "IAU_2015:49900"}])
def test_gdal_opens_a_mission_on_mars_at_the_right_place(world: World, address: str, options: Any) -> None:
    told, (shape,), _ = read(address, world.mars, "targets", **options)
    assert "Mars" in pyproj.CRS(told).to_wkt()
    assert in_site(shape, told, MARS) == pytest.approx(np.array([[4.0, 1.0]]), abs=1e-3)


def test_a_mission_on_mars_is_in_its_own_degrees_and_says_so(world: World) -> None:
    answer = world.items("targets", world.mars)
    assert answer.headers["content-crs"] == "<http://www.opengis.net/def/crs/IAU/2015/49900>"
    lon, lat = site_frame(Place(**MARS)).out([(4.0, 1.0)], "lonlat")[0]  # type: ignore[arg-type]
    (feature,) = answer.json()["features"]
    assert feature["geometry"]["coordinates"] == pytest.approx([lat, lon], abs=1e-9)
    page = world.api.get(f"{world.root(world.mars)}/collections/targets")
    assert page["crs"] == ["http://www.opengis.net/def/crs/IAU/2015/49900"]
    assert page["storageCrs"] == page["crs"][0]


@pytest.mark.parametrize("path", ["", "/collections", "/collections/targets/items"])
def test_a_mission_without_a_place_is_refused_by_that_name(world: World, path: str) -> None:
    answer = world.api("GET", f"{world.root(world.nowhere)}{path}")
    assert answer.status_code == 409
    assert "no place on a body" in answer.json()["detail"]


def test_who_has_no_role_in_a_mission_sees_none_of_it(world: World) -> None:
    api = world.api
    with api.repo.database.write() as session:
        roles = {world.mars: "none"}
        row = PersonRow(id=new_id("psn"), author="", name="Eve", role="viewer", mission_roles=roles)
        session.add(row)
    missing = api("GET", "/missions/msn-none/features", who="Eve")
    for part in ("", "/conformance", "/collections", "/collections/targets", "/collections/targets/items"):
        answer = api("GET", f"{world.root(world.mars)}{part}", who="Eve")
        assert answer.status_code == 404, part
        assert answer.json()["title"] == missing.json()["title"]
    assert api("GET", f"{world.root(world.earth)}/collections/targets/items", who="Eve").status_code == 200
