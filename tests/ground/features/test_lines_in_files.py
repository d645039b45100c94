"""Traverses and ribbons of plans in GeoPackage, KML and GPX: GDAL reads each at the right place."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import shapely

from tests.ground.features.conftest import EARTH, MARS, World
from tests.ground.geo.test_geographic_files import expected, metres_apart
from tests.ground.test_missions_api import problem
from tests.shared import needed

pyogrio = needed("pyogrio")
pyproj = needed("pyproj")
STOPS = [(0.0, 0.0), (5.0, 0.0), (9.0, 0.0)]
BODIES = {"earth": (EARTH, "EPSG:4326"), "mars": (MARS, "IAU_2015:49900")}


def layer_of(
    world: World, folder: Path, mission: str, form: str, layer: str
) -> tuple[str, list[Any], dict[str, Any]]:
    """Return what GDAL reads of a layer: its reference, the lines x before y, the columns."""
    path = folder / f"g.{form}"
    answer = world.api("GET", f"/missions/{mission}/geometry?form={form}&lines=true")
    assert answer.status_code == 200, answer.text
    path.write_bytes(answer.content)
    meta, _, shapes, columns = pyogrio.raw.read(path, layer=layer)
    return meta["crs"], list(shapely.from_wkb(shapes)), dict(zip(meta["fields"], columns, strict=True))


def away_m(body: str, line: Any, crs: str, wanted: Any) -> float:
    """Return how far the worst corner is from where pyproj alone has it."""
    place, degrees = BODIES[body]
    corners = shapely.get_coordinates(line)
    assert len(corners) == len(wanted)
    way = pyproj.Transformer.from_crs(crs, degrees, always_xy=True)
    there = [way.transform(x, y) for x, y in corners]
    return max(
        metres_apart(degrees, found, expected(place, degrees, *site))
        for found, site in zip(there, wanted, strict=True)
    )


@pytest.mark.parametrize(
    ("body", "form", "layer"),
    [
        ("earth", "gpkg", "traverses"),
        ("earth", "kml", "traverses"),
        ("earth", "gpx", "tracks"),
        ("mars", "gpkg", "traverses"),
        ("mars", "kml", "traverses"),
    ],
)
def test_gdal_opens_a_traverse_at_the_right_place(
    world: World, tmp_path: Path, body: str, form: str, layer: str
) -> None:
    crs, lines, columns = layer_of(world, tmp_path, getattr(world, body), form, layer)
    names = list(columns["Name" if form == "kml" else "name"])
    line = lines[names.index("First drive")]
    # KML and GPX know one reference, whatever the body
    assert away_m(body, line, crs if form == "gpkg" else BODIES[body][1], STOPS) < 1e-3


def routes(world: World) -> set[tuple[tuple[float, float], ...]]:
    """Return the routes of the plan's problem, in site metres to the millimetre."""
    plan = world.api.get(f"/plans/{world.plan}")
    legs = world.api.get(f"/problems/{plan['problem_id']}")["document"]["legs"]
    return {tuple((round(x, 3), round(y, 3)) for x, y in leg["route"]) for leg in legs if leg.get("route")}


@pytest.mark.parametrize(("form", "layer"), [("gpkg", "ribbons"), ("kml", "ribbons"), ("gpx", "tracks")])
def test_gdal_opens_the_ribbons_of_a_plan_at_the_right_place(
    world: World, tmp_path: Path, form: str, layer: str
) -> None:
    crs, lines, columns = layer_of(world, tmp_path, world.earth, form, layer)
    names = [str(name) for name in columns["Name" if form == "kml" else "name"]]
    ribbons = [(name, line) for name, line in zip(names, lines, strict=True) if name.startswith("Plan 1, ")]
    told = world.items("ribbons").json()["features"]
    assert len(ribbons) == len(told) > 0
    to_grid = pyproj.Transformer.from_crs(crs, EARTH["crs"], always_xy=True)
    ways = routes(world)
    for _, line in ribbons:
        corners = [to_grid.transform(x, y) for x, y in shapely.get_coordinates(line)]
        site = [(x - EARTH["x"], y - EARTH["y"]) for x, y in corners]
        assert any(
            len(way) == len(site)
            and max(max(abs(a - c), abs(b - d)) for (a, b), (c, d) in zip(way, site, strict=True)) < 2e-3
            for way in ways
        ), site
    if form == "gpkg":
        odds = sorted(feature["properties"]["probability"] for feature in told)
        assert sorted(columns["probability"]) == pytest.approx(odds)
        assert set(columns["plan_id"]) == {world.plan}


@pytest.mark.parametrize("form", ["geojson", "csv"])
def test_a_form_without_lines_says_where_they_are(world: World, form: str) -> None:
    answer = world.api("GET", f"/missions/{world.earth}/geometry?form={form}&lines=true")
    told = problem(answer, 422, "invalid-input")["detail"]
    assert told.startswith(f"{form} holds targets and keep-outs; lines are in gpkg, kml and gpx")


def test_a_file_without_lines_is_as_before(world: World, tmp_path: Path) -> None:
    path = tmp_path / "g.gpkg"
    path.write_bytes(world.api("GET", f"/missions/{world.earth}/geometry?form=gpkg").content)
    assert sorted(pyogrio.list_layers(path)[:, 0]) == ["keep_outs", "targets"]


def test_a_geopackage_of_lines_needs_no_place(world: World, tmp_path: Path) -> None:
    _, lines, _ = layer_of(world, tmp_path, world.nowhere, "gpkg", "traverses")
    assert lines == []
