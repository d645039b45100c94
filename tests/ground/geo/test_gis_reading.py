"""GeoPackage, KML and GPX in: our own files come back where they were; bad ones are named."""

from __future__ import annotations

import sqlite3
import sys
import tomllib
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from ground.errors import InvalidInputError, UnavailableError
from ground.geo.place import Place
from ground.resources.geometry_files.site_geometry import read_shapes
from tests.ground.conftest import Api, yard
from tests.ground.geo.test_places_api import UTAH, change
from tests.ground.test_missions_api import upload
from tests.shared import needed

needed("pyproj")
needed("pyogrio")
needed("defusedxml")
RING = [[6.0, 6.0], [8.0, 6.0], [8.0, 8.5]]
HERE = Place("EPSG:4326", -110.79, 38.41)
GPX = '<gpx version="1.1"><wpt lat="{}" lon="{}"><name>R</name></wpt></gpx>'


@pytest.mark.parametrize("form", ["gpkg", "kml", "gpx"])
def test_what_goes_out_comes_in_where_it_was(sqlite_api: Api, terrain_folder: Path, form: str) -> None:
    api = sqlite_api
    one, other = (yard(api.repo, terrain_folder, name).id for name in ("One", "Other"))
    for mission in (one, other):
        assert change(api, mission, UTAH).status_code == 200
    api.post(f"/missions/{one}/targets", {"name": "Größe", "east_m": 4.0, "north_m": 1.0, "notes": "a"})
    api.post(f"/missions/{one}/keep-outs", {"name": "Sand", "polygon_m": RING})
    file = api("GET", f"/missions/{one}/geometry?form={form}").content
    made = api.post(f"/missions/{other}/geometry", {"upload_id": upload(api, f"g.{form}", file)})
    ((target,), (keep_out,)) = made["targets"], made["keep_outs"]
    assert (target["name"], keep_out["name"]) == ("Größe", "Sand")
    assert target["notes"].startswith("a")
    place = target["position"]["east_m"], target["position"]["north_m"]
    assert place == pytest.approx((4.0, 1.0), abs=1e-3)
    corners = sorted(keep_out["polygon_m"], key=lambda corner: [round(x, 3) for x in corner])
    assert np.allclose(corners, sorted(RING), rtol=0.0, atol=1e-3)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ('<!DOCTYPE a [<!ENTITY b "c">]><kml>&b;</kml>', "DTD or entities"),
        ("<kml><Placemark>", "damaged XML"),
        ("<svg/>", "kml and gpx are read"),
        (
            "<kml><Placemark><name>a</name><Placemark><name>b</name></Placemark></Placemark></kml>",
            "a Placemark 'b' within a Placemark",
        ),
        ("<kml>" + "<Folder>" * 100 + "</Folder>" * 100 + "</kml>", "nests elements more than 100 deep"),
        ("<gpx>" + "<x>" * 200_000 + "</x>" * 200_000 + "</gpx>", "nests elements more than 100 deep"),
        (GPX.format(-110.79, 38.41), "swapped"),
        (GPX.format("nan", -110.79), "row 1"),
        (GPX.format("", ""), "row 1"),
        ("<gpx><trk><name>t</name></trk></gpx>", "row 1: a target is a Point"),
        ("<kml><Placemark><name>x</name></Placemark></kml>", "row 1: a target is a Point"),
    ],
)
def test_a_file_that_cannot_be_used_is_refused_with_the_reason(text: str, why: str) -> None:
    with pytest.raises(InvalidInputError, match=why):
        read_shapes(text.encode(), site=HERE)


def test_a_damaged_geopackage_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="damaged"):
        read_shapes(b"SQLite format 3\x00" + bytes(200), site=HERE)


def test_a_geopackage_with_a_view_that_never_ends_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "endless.gpkg"
    with closing(sqlite3.connect(file)) as base:
        base.execute("CREATE TABLE gpkg_contents (table_name TEXT, data_type TEXT)")
        base.execute(
            "CREATE VIEW rocks AS WITH RECURSIVE n(k) AS (SELECT 1 UNION ALL SELECT k + 1 FROM n) "
            "SELECT k FROM n"
        )
        base.commit()
    with pytest.raises(InvalidInputError, match="has views, which are not read: rocks"):
        read_shapes(file.read_bytes(), site=HERE)


@pytest.mark.parametrize(
    ("package", "content"), [("defusedxml", b"<kml/>"), ("pyogrio", b"SQLite format 3\x00" + bytes(200))]
)
def test_the_extra_that_is_missing_is_named_and_has_the_package(
    monkeypatch: pytest.MonkeyPatch, package: str, content: bytes
) -> None:
    for name in [package, *(name for name in sys.modules if name.startswith(f"{package}."))]:
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(UnavailableError, match=rf"{package}: pip install 'outcrop\[geo\]'"):
        read_shapes(content, site=HERE)
    project = tomllib.loads((Path(__file__).parents[3] / "pyproject.toml").read_text())["project"]
    assert any(line.startswith(package) for line in project["optional-dependencies"]["geo"])
