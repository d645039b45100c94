"""Fixes in degrees against poses of odometry, heights told apart, and the command on files."""

from __future__ import annotations

import json
import math
import struct
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from ground.cli.main import app, register_all
from ground.errors import InvalidInputError
from ground.geo.fixes import read_fixes
from ground.geo.heights import convert_heights
from ground.geo.place import Place
from ground.geo.references import reference
from tests.shared import needed

pyproj = needed("pyproj")

MARS = Place("IAU_2015:49900", 77.45, 18.44, height_m=-2570.0, heights="areoid")
EARTH = Place("EPSG:32612", 518_334.0, 4_251_500.0, rotation_rad=0.3, height_m=1400.0, heights="ellipsoid")
HEAD = "name,lon,lat,height_m,heights,sigma_m\n"


@pytest.fixture(scope="module")
def outcrop() -> CliRunner:
    register_all()
    return CliRunner()


def test_the_command_finds_turn_and_shift_that_pyproj_made_and_names_the_outlier(
    outcrop: CliRunner, tmp_path: Path
) -> None:
    rng = np.random.default_rng(11)
    poses = rng.uniform(-60, 60, (9, 3)) * [1, 1, 0.05]
    yaw = 0.7
    utm = pyproj.CRS("EPSG:32612")
    out = pyproj.Transformer.from_crs(utm, "EPSG:4326", always_xy=True)
    scale = pyproj.Proj(utm).get_factors(*out.transform(518_334.0, 4_251_500.0)).meridional_scale
    lines, way = [HEAD.strip()], ["name,x_m,y_m,z_m,sigma_m"]
    for k, (x, y, z) in enumerate(poses):
        # straight to the map, another way than the product's: turn by yaw, scale, shift, in UTM
        east = 518_400.0 + scale * (x * math.cos(yaw) - y * math.sin(yaw))
        north = 4_251_450.0 + scale * (x * math.sin(yaw) + y * math.cos(yaw)) + (30.0 if k == 4 else 0.0)
        lon, lat = out.transform(east, north)
        lines.append(f"p{k},{lon:.10f},{lat:.10f},{1410.0 + scale * z:.4f},ellipsoid,0.5")
        way.append(f"p{k},{x},{y},{z},0.05")
    (tmp_path / "fixes.csv").write_text("\n".join(lines))
    (tmp_path / "poses.csv").write_text("\n".join(way))
    place = json.dumps(
        {"crs": "EPSG:32612", "x": 518_334.0, "y": 4_251_500.0, "rotation_rad": 0.3, "height_m": 1400.0}
        | {"heights": "ellipsoid"}
    )
    files = [str(tmp_path / "fixes.csv"), str(tmp_path / "poses.csv"), "--out", str(tmp_path / "answer")]
    result = outcrop.invoke(app, ["align", *files, "--place", place])
    assert result.exit_code == 0, result.output
    assert "8 of 9 fixes agree; left out: p4" in result.output
    found = json.loads((tmp_path / "answer" / "alignment.json").read_text())
    assert found["yaw_rad"] == pytest.approx(yaw - 0.3, abs=2e-6)
    c, s = math.cos(0.3), math.sin(0.3)
    assert found["shift_m"] == pytest.approx([66 * c - 50 * s, -66 * s - 50 * c, 10.0], abs=0.002)
    assert [f["name"] for f in found["fixes"] if not f["used"]] == ["p4"]
    assert (tmp_path / "answer" / "alignment.png").stat().st_size > 5_000


def test_a_covariance_is_turned_to_the_axes_of_the_site() -> None:
    table = "name,lon,lat,cov_ee,cov_en,cov_nn\na,-110.79,38.41,4,0,1\n"
    place = Place("EPSG:4326", -110.79, 38.41, rotation_rad=math.pi / 2)
    fixes, _ = read_fixes(table, place)
    assert fixes.covariance_m2[0][:2, :2] == pytest.approx(np.array([[1.0, 0.0], [0.0, 4.0]]), abs=1e-6)
    assert math.isnan(fixes.places_m[0, 2])


@pytest.mark.parametrize(
    ("table", "place", "word"),
    [
        (HEAD + "a,77.45,18.44,10,geoid,1\n", MARS, "geoids are those of the Earth"),
        (HEAD + "a,77.45,18.44,10,ellipsoid,1\n", MARS, "no grid of the areoid"),
        (HEAD + "a,-110.79,38.41,10,geoid,1\n", EARTH, "us_nga_egm96_15.tif, which is not installed"),
        (HEAD + "a,-110.79,38.41,10,areoid,1\n", EARTH, "areoid is that of Mars"),
        (HEAD + "a,-110.79,38.41,10,,1\n", EARTH, "heights over unknown"),
        (HEAD + "a,38.41,-110.79,10,ellipsoid,1\n", EARTH, "swapped"),
        (HEAD + "a,-110.79,nan,10,ellipsoid,1\n", EARTH, "lat is nan"),
        (HEAD + "a,-110.79,38.41,10,ellipsoid,0\n", EARTH, "no standard deviation"),
        (HEAD + "a,-110.79,38.41,10,navd,1\n", EARTH, "heights is 'navd'"),
        (HEAD + "a,-110.79,38.41,,,1\na,-110.79,38.41,,,1\n", EARTH, "'a' twice"),
    ],
)
def test_a_table_of_no_use_is_refused_with_its_row_and_the_reason(
    table: str, place: Place, word: str
) -> None:
    with pytest.raises(InvalidInputError, match="a") as told:
        read_fixes(table, place)
    assert word in told.value.message


def test_heights_over_the_geoid_are_converted_by_its_grid_where_that_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A grid of our own, in the form that PROJ has long had for EGM96: 15 degrees, 7 m all over."""
    rows, columns, step = 13, 25, 15.0
    values = np.full((rows, columns), 7.0, dtype=">f4")
    head = struct.pack(">ddddii", -90.0, -180.0, step, step, rows, columns)
    (tmp_path / "egm96_15.gtx").write_bytes(head + values.tobytes())
    before = pyproj.datadir.get_data_dir()
    pyproj.datadir.append_data_dir(str(tmp_path))
    try:
        found = convert_heights([[-110.79, 38.41]], [100.0], "geoid", "ellipsoid", reference("EPSG:32612"))
        back = convert_heights([[-110.79, 38.41]], found, "ellipsoid", "geoid", reference("EPSG:32612"))
    finally:
        pyproj.datadir.set_data_dir(before)
    assert found == pytest.approx([107.0], abs=1e-3)
    assert back == pytest.approx([100.0], abs=1e-3)


def test_heights_over_the_sphere_of_mars_are_those_of_the_geocentric_distance() -> None:
    graphic = pyproj.CRS.from_proj4("+proj=longlat +a=3396190 +b=3376200 +no_defs")
    crs = reference(graphic.to_wkt())
    geocentric = pyproj.CRS.from_proj4("+proj=geocent +a=3396190 +b=3376200 +no_defs")
    to = pyproj.Transformer.from_crs(graphic, geocentric, always_xy=True)
    for latitude, height in ((0.0, 0.0), (45.0, -2000.0), (-70.0, 3000.0)):
        place = [[10.0, latitude]]
        found = convert_heights(place, [height], "ellipsoid", "sphere", crs)
        truth = np.linalg.norm(to.transform(10.0, latitude, height)) - 3_396_190.0
        assert found == pytest.approx([truth], abs=0.3)
        assert convert_heights(place, found, "sphere", "ellipsoid", crs) == pytest.approx([height])
