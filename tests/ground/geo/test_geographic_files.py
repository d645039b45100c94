"""Targets and keep-outs in and out in any reference; GIS files are read back by GDAL."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import sqlite3
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

from ground.errors import InvalidInputError
from ground.geo import references
from ground.geo.place import Place
from ground.geo.references import _reference
from ground.geo.site_frame import site_frame
from ground.resources.geometry_files.site_geometry import read_shapes
from tests.ground.conftest import Api, yard
from tests.ground.geo.test_places_api import change
from tests.ground.test_exchange import RING, fill
from tests.ground.test_missions_api import problem, upload
from tests.shared import needed

pyproj = needed("pyproj")
pyogrio = needed("pyogrio")

PLACES = {
    "Earth": {"crs": "EPSG:32612", "x": 518_334.0, "y": 4_251_500.0, "rotation_rad": 0.4},
    "Moon": {"crs": "IAU_2015:30100", "x": 31.0, "y": -84.6},
    "Mars": {"crs": "IAU_2015:49900", "x": 77.45, "y": 18.44},
}
EARTH = PLACES["Earth"]
DEGREES = {"Earth": "EPSG:4326", "Moon": "IAU_2015:30100", "Mars": "IAU_2015:49900"}


@pytest.fixture
def api(sqlite_api: Api) -> Api:
    return sqlite_api


def placed(api: Api, terrain_folder: Path, place: Any, name: str = "Yard") -> str:
    mission = yard(api.repo, terrain_folder, name).id
    answer = change(api, mission, place)
    assert answer.status_code == 200, answer.text
    return mission


def expected(place: Any, degrees: str, east: float, north: float) -> tuple[float, float]:
    """Work out longitude and latitude of a site point by pyproj alone, another way than the product's."""
    turn = place.get("rotation_rad", 0.0)
    if pyproj.CRS(place["crs"]).is_projected:
        x = place["x"] + east * np.cos(turn) - north * np.sin(turn)
        y = place["y"] + east * np.sin(turn) + north * np.cos(turn)
        lat, lon = pyproj.Transformer.from_crs(place["crs"], degrees).transform(x, y)
        return lon, lat
    geod = pyproj.CRS(place["crs"]).get_geod()
    azimuth = np.degrees(np.arctan2(east, north))
    lon, lat, _ = geod.fwd(place["x"], place["y"], azimuth, np.hypot(east, north))
    return lon, lat


def metres_apart(degrees: str, one: Any, other: Any) -> float:
    return float(pyproj.CRS(degrees).get_geod().inv(*one, *other)[2])


def positions(api: Api, mission: str) -> np.ndarray:
    found = sorted(api.get(f"/missions/{mission}/targets")["items"], key=lambda t: t["name"])
    return np.array([[t["position"]["east_m"], t["position"]["north_m"]] for t in found])


@pytest.mark.parametrize("body", PLACES)
@pytest.mark.parametrize(
    ("form", "crs"), [("geojson", "lonlat"), ("csv", "lonlat"), ("geojson", None), ("csv", "own")]
)
def test_what_goes_out_in_a_reference_comes_in_within_a_millimetre(
    api: Api, terrain_folder: Path, body: str, form: str, crs: str | None
) -> None:
    place = PLACES[body]
    mission = placed(api, terrain_folder, place)
    fill(api, mission)
    query = "" if crs is None else f"&crs={place['crs'] if crs == 'own' else crs}"
    file = api("GET", f"/missions/{mission}/geometry?form={form}{query}")
    assert file.status_code == 200, file.text
    other = placed(api, terrain_folder, place, "Other")
    made = api.post(f"/missions/{other}/geometry", {"upload_id": upload(api, f"g.{form}", file.content)})
    assert np.abs(positions(api, other) - positions(api, mission)).max() < 1e-3
    assert np.abs(np.array(made["keep_outs"][0]["polygon_m"]) - RING).max() < 1e-3


@pytest.mark.parametrize("body", PLACES)
@pytest.mark.parametrize("form", ["geojson", "gpkg", "kml"])
def test_gdal_opens_a_file_at_the_right_place(
    api: Api, terrain_folder: Path, tmp_path: Path, body: str, form: str
) -> None:
    place = PLACES[body]
    mission = placed(api, terrain_folder, place)
    fill(api, mission)
    query = "&crs=lonlat" if form == "geojson" else ""
    path = tmp_path / f"g.{form}"
    path.write_bytes(api("GET", f"/missions/{mission}/geometry?form={form}{query}").content)
    layer = None if form == "geojson" else "targets"
    meta, _, shapes, fields = pyogrio.raw.read(path, layer=layer)
    found = [g for g in shapely.from_wkb(shapes) if g.geom_type == "Point"]
    assert len(found) == 2
    crs = DEGREES[body] if form == "kml" else meta["crs"]
    if form == "gpkg":
        assert pyproj.CRS(crs).equals(pyproj.CRS(place["crs"]), ignore_axis_order=True)
    to_degrees = pyproj.Transformer.from_crs(crs, DEGREES[body], always_xy=True)
    sites = [[4.1, 0.1 + 0.2], [-3.0, 2.0]]
    for point, site in zip(found, sites, strict=True):
        there = to_degrees.transform(point.x, point.y)
        assert metres_apart(DEGREES[body], there, expected(place, DEGREES[body], *site)) < 1e-3
    if form != "geojson":
        _, _, rings, _ = pyogrio.raw.read(path, layer="keep_outs")
        (ring,) = shapely.from_wkb(rings)
        corners = [to_degrees.transform(*c[:2]) for c in ring.exterior.coords[:-1]]
        wanted = [expected(place, DEGREES[body], *site) for site in RING]
        away = [min(metres_apart(DEGREES[body], c, w) for c in corners) for w in wanted]
        assert max(away) < 1e-3
        names = fields[list(meta["fields"]).index("name" if form == "gpkg" else "Name")]
        assert len(set(names)) == 2


def test_gdal_reads_waypoints_and_routes_of_a_gpx(api: Api, terrain_folder: Path, tmp_path: Path) -> None:
    mission = placed(api, terrain_folder, EARTH)
    fill(api, mission)
    path = tmp_path / "g.gpx"
    path.write_bytes(api("GET", f"/missions/{mission}/geometry?form=gpx").content)
    _, _, points, _ = pyogrio.raw.read(path, layer="waypoints")
    first = shapely.from_wkb(points)[0]
    wanted = expected(EARTH, "EPSG:4326", 4.1, 0.1 + 0.2)
    assert metres_apart("EPSG:4326", (first.x, first.y), wanted) < 1e-3
    _, _, routes, _ = pyogrio.raw.read(path, layer="routes")
    assert shapely.from_wkb(routes)[0].is_closed


def test_gpx_of_another_body_is_refused(api: Api, terrain_folder: Path) -> None:
    mission = placed(api, terrain_folder, PLACES["Mars"])
    told = problem(api("GET", f"/missions/{mission}/geometry?form=gpx"), 422, "invalid-input")
    assert "GPX is of the Earth alone; the site lies in Mars" in told["detail"]


@pytest.mark.parametrize("query", ["form=kml", "form=gpx", "crs=lonlat", "crs=EPSG:4326"])
def test_a_mission_without_a_place_says_so(api: Api, terrain_folder: Path, query: str) -> None:
    mission = yard(api.repo, terrain_folder).id
    told = problem(api("GET", f"/missions/{mission}/geometry?{query}"), 422, "invalid-input")
    assert "has no place on a body" in told["detail"]


def features(*points: Any, **more: Any) -> bytes:
    made = [
        {"type": "Feature", "properties": {}, "geometry": {"type": "Point", "coordinates": point}}
        for point in points
    ]
    return json.dumps({"type": "FeatureCollection", **more, "features": made}).encode()


def named(text: str) -> Any:
    return {"type": "name", "properties": {"name": text}}


LON, LAT = expected(EARTH, "EPSG:4326", 4.0, 1.0)


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (
            features([LON, LAT], [LAT, LON], frame="lonlat"),
            "row 2: .*looks swapped: longitude before latitude",
        ),
        (
            features([4_251_500, 518_334], crs=named("EPSG:32612")),
            r"row 1: .*looks swapped: x \(east\) before y",
        ),
        (features([LON, LAT], crs=named("IAU_2015:49900")), "^there is no transformation between Mars"),
        (features([LON, float("nan")], frame="lonlat"), "row 1: .*no numbers"),
        (features([LON, LAT], crs=named("EPSG:123456")), "not a coordinate reference that is known"),
        (features([LON, LAT], crs={"type": "link"}), "crs is not a name"),
        (features([LON, LAT], frame="moon"), "frame is 'moon'"),
        (features([LON, LAT], frame="site", crs=named("EPSG:4326")), "counts in the site frame and in"),
        (features([LON, LAT + 3], frame="lonlat"), r"row 1: .* 333 km from the site"),
        (b"kind,name,crs,x,y\ntarget,A,EPSG:4326,west,1\n", "row 2: x is not a number"),
    ],
)
def test_files_in_the_wrong_reference_are_refused_whole_and_named(
    api: Api, terrain_folder: Path, content: bytes, why: str
) -> None:
    import re

    mission = placed(api, terrain_folder, EARTH)
    name = "g.csv" if content.startswith(b"kind") else "g.geojson"
    answer = api("POST", f"/missions/{mission}/geometry", {"upload_id": upload(api, name, content)})
    assert re.search(why, problem(answer, 422, "invalid-input")["detail"])
    assert api.get(f"/missions/{mission}/targets")["items"] == []


def test_a_person_says_what_a_file_that_names_nothing_counts_in(api: Api, terrain_folder: Path) -> None:
    mission = placed(api, terrain_folder, EARTH)
    table = f"kind,name,x,y\ntarget,A,{LON!r},{LAT!r}\n".encode()
    for number, (name, content) in enumerate([("a.csv", table), ("a.geojson", features([LON, LAT]))], 1):
        body = {"upload_id": upload(api, name, content), "crs": "EPSG:4326"}
        api.post(f"/missions/{mission}/geometry", body)
        assert positions(api, mission)[-1] == pytest.approx([4.0, 1.0], abs=1e-3)
        assert len(positions(api, mission)) == number


def test_old_geojson_names_longitude_and_latitude_by_an_urn(api: Api, terrain_folder: Path) -> None:
    """As QGIS writes it."""
    mission = placed(api, terrain_folder, EARTH)
    content = features([LON, LAT], crs=named("urn:ogc:def:crs:OGC:1.3:CRS84"))
    api.post(f"/missions/{mission}/geometry", {"upload_id": upload(api, "q.geojson", content)})
    assert positions(api, mission)[0] == pytest.approx([4.0, 1.0], abs=1e-3)


def test_heights_go_out_only_if_it_is_known_what_they_count_from(api: Api, terrain_folder: Path) -> None:
    for heights, dimensions in (("ellipsoid", 3), ("geoid", 2), ("unknown", 2)):
        place = {**EARTH, "height_m": 1400.0, "heights": heights}
        mission = placed(api, terrain_folder, place, heights)
        fill(api, mission)
        file = api.get(f"/missions/{mission}/geometry?crs=lonlat")
        point = next(f for f in file["features"] if f["geometry"]["type"] == "Point")["geometry"][
            "coordinates"
        ]
        assert len(point) == dimensions
        if dimensions == 3:
            up = api.get(f"/missions/{mission}/targets")["items"][0]["position"]["up_m"]
            assert point[2] == pytest.approx(1400.0 + up)


def test_a_table_in_degrees_has_columns_that_say_so(api: Api, terrain_folder: Path) -> None:
    mission = placed(api, terrain_folder, EARTH)
    fill(api, mission)
    file = api("GET", f"/missions/{mission}/geometry?form=csv&crs=lonlat").text
    rows = list(csv.DictReader(io.StringIO(file)))
    assert {row["crs"] for row in rows} == {"lonlat"}
    assert "east_m" not in rows[0]


@pytest.mark.parametrize("form", ["geojson", "csv"])
def test_site_metres_need_no_pyproj(
    api: Api, terrain_folder: Path, monkeypatch: pytest.MonkeyPatch, form: str
) -> None:
    """The base install has no pyproj: a mission with a place still exchanges site metres."""
    mission = placed(api, terrain_folder, EARTH)
    other = placed(api, terrain_folder, EARTH, "Other")
    fill(api, mission)
    site_frame.cache_clear()
    _reference.cache_clear()
    monkeypatch.setitem(sys.modules, "pyproj", None)
    file = api("GET", f"/missions/{mission}/geometry?form={form}")
    assert file.status_code == 200, file.text
    assert api("GET", f"/missions/{mission}/geometry?form={form}&crs=site").content == file.content
    body = {"upload_id": upload(api, f"g.{form}", file.content)}
    assert len(api.post(f"/missions/{other}/geometry", body)["targets"]) == 2
    told = api("GET", f"/missions/{mission}/geometry?form={form}&crs=lonlat")
    assert (told.status_code, "pip install 'outcrop[geo]'" in told.json()["detail"]) == (503, True)


@pytest.mark.parametrize(
    ("content", "notes"),
    [
        (b"kind,name,east_m,north_m,x,polygon\ntarget,A,4,1,seven,P2\n", "x: seven\npolygon: P2"),
        (b"kind,name,east_m,north_m,crs\ntarget,A,4,1,site\n", ""),
        (features([4, 1]).replace(b"{}", b'{"x": 7, "crs": "old"}'), "x: 7\ncrs: old"),
        (f"kind,name,crs,x,y,lab\ntarget,A,EPSG:4326,{LON!r},{LAT!r},L9\n".encode(), "lab: L9"),
    ],
)
def test_only_what_says_the_place_is_left_out_of_the_notes(
    api: Api, terrain_folder: Path, content: bytes, notes: str
) -> None:
    mission = placed(api, terrain_folder, EARTH)
    made = api.post(f"/missions/{mission}/geometry", {"upload_id": upload(api, "g.csv", content)})
    assert made["targets"][0]["notes"] == notes


@pytest.mark.parametrize("text", ['GEOGCS["\ud800"]', "EPSG:\ud800", 'GEOGCS["\0"]'])
def test_a_reference_that_is_no_text_is_refused(api: Api, terrain_folder: Path, text: str) -> None:
    mission = placed(api, terrain_folder, EARTH)
    for content in (features([LON, LAT], crs=text), features([LON, LAT], crs=named(text))):
        answer = api("POST", f"/missions/{mission}/geometry", {"upload_id": upload(api, "g.json", content)})
        assert "coordinate reference" in problem(answer, 422, "invalid-input")["detail"]


def table(*references: str) -> bytes:
    rows = (f"target,T{row},{crs},{LON!r},{LAT!r}" for row, crs in enumerate(references))
    return "\n".join(["kind,name,crs,x,y", *rows]).encode()


def test_a_bad_reference_names_its_rows_and_a_table_has_few(api: Api, terrain_folder: Path) -> None:
    mission = placed(api, terrain_folder, EARTH)

    def told(content: bytes) -> str:
        answer = api("POST", f"/missions/{mission}/geometry", {"upload_id": upload(api, "g.csv", content)})
        detail: str = problem(answer, 422, "invalid-input")["detail"]
        return detail

    detail = told(table("EPSG:4326", "EPSG:123456", "lonlat", "EPSG:123456", "IAU_2015:49900"))
    assert "3 of 5 rows" in detail
    for row, why in (
        (3, "'EPSG:123456' is no"),
        (5, "'EPSG:123456' is no"),
        (6, "there is no transformation"),
    ):
        assert f"row {row}: {why}" in detail
    assert "17 references; 16 are allowed" in told(table(*(f"EPSG:{32601 + k}" for k in range(17))))


def test_references_are_looked_up_once_a_file(monkeypatch: pytest.MonkeyPatch) -> None:
    """A transformation that is none takes pyproj 8 ms to refuse; a file has up to 5000 rows."""
    asked: list[Any] = []
    found = references.transformer

    def asking(*two: Any) -> Any:
        asked.append(two)
        return found(*two)

    monkeypatch.setattr("ground.geo.site_frame.transformer", asking)
    with pytest.raises(InvalidInputError, match="500 of 500 rows"):
        read_shapes(table(*["IAU_2015:49900"] * 500), site=Place("EPSG:32612", 518_334.0, 4_251_500.0))
    assert len(asked) == 1


def test_a_geopackage_without_a_place_is_undefined_cartesian(
    api: Api, terrain_folder: Path, tmp_path: Path
) -> None:
    """GeoPackage 1.3, requirement 11: srs_id -1 is for undefined Cartesian references."""
    mission = yard(api.repo, terrain_folder).id
    fill(api, mission)
    path = tmp_path / "g.gpkg"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        path.write_bytes(api("GET", f"/missions/{mission}/geometry?form=gpkg").content)
    with contextlib.closing(sqlite3.connect(path)) as file:
        assert file.execute("select distinct srs_id from gpkg_geometry_columns").fetchall() == [(-1,)]
    (first, _) = shapely.from_wkb(pyogrio.raw.read(path, layer="targets")[2])
    assert (first.x, first.y) == (4.1, 0.1 + 0.2)
