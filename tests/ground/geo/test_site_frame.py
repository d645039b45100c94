"""The site frame against pyproj's own geodesics and projections."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ground.errors import InvalidInputError
from ground.geo.place import Place
from ground.geo.site_frame import SiteFrame, site_frame
from tests.shared import needed

pyproj = needed("pyproj")

EARTH = Place("EPSG:4326", -110.79, 38.41)
UTM = Place("EPSG:32612", 518_334.0, 4_251_500.0, rotation_rad=0.3)
MOON = Place("IAU_2015:30100", 31.0, -84.6)
MARS = Place("IAU_2015:49900", 77.45, 18.44, rotation_rad=-1.2)
MARS_MAP = Place("IAU_2015:49910", 4_590_000.0, 1_093_000.0)
PLACES = [EARTH, UTM, MOON, MARS, MARS_MAP]
reach = st.floats(-10_000, 10_000)


@pytest.mark.parametrize("place", PLACES, ids=lambda place: place.crs)
@settings(max_examples=40, deadline=None)
@given(points=st.lists(st.tuples(reach, reach), min_size=1, max_size=20))
def test_there_and_back_is_within_a_millimetre_over_ten_kilometres(
    place: Place, points: list[tuple[float, float]]
) -> None:
    frame = site_frame(place)
    back = frame.into(frame.out(points, "lonlat"), "lonlat")
    assert np.abs(back - np.array(points)).max() < 1e-3


@pytest.mark.parametrize("place", [EARTH, MOON, MARS], ids=lambda place: place.crs)
def test_site_metres_are_the_geodesics_from_the_origin(place: Place) -> None:
    """Distance and direction by pyproj's geodesics: another way to the same numbers."""
    frame = site_frame(place)
    rng = np.random.default_rng(20)
    site = rng.uniform(-10_000, 10_000, (500, 2))
    lonlat = frame.out(site, "lonlat")
    geod = pyproj.CRS(place.crs).get_geod()
    start = np.full(500, place.x), np.full(500, place.y)
    azimuth, _, metres = geod.inv(*start, lonlat[:, 0], lonlat[:, 1])
    turn = np.radians(azimuth) + place.rotation_rad  # clockwise from the site's north
    expected = np.column_stack([metres * np.sin(turn), metres * np.cos(turn)])
    assert np.abs(expected - site).max() < 1e-3


def test_a_projection_is_shifted_and_turned() -> None:
    frame = site_frame(UTM)
    c, s = math.cos(0.3), math.sin(0.3)
    there = frame.out([[100.0, 0.0], [0.0, 100.0]], "EPSG:32612")
    assert there == pytest.approx(
        np.array([[UTM.x + 100 * c, UTM.y + 100 * s], [UTM.x - 100 * s, UTM.y + 100 * c]]), abs=1e-6
    )
    to_degrees = pyproj.Transformer.from_crs("EPSG:32612", "EPSG:4326")  # latitude first: its own order
    lat, lon = to_degrees.transform(*there[0])
    assert frame.out([[100.0, 0.0]], "lonlat")[0] == pytest.approx([lon, lat], abs=1e-10)


def test_swapped_axes_are_named() -> None:
    with pytest.raises(InvalidInputError, match=r"looks swapped: longitude before latitude"):
        site_frame(EARTH).into([[38.41, -110.79]], "lonlat")
    with pytest.raises(InvalidInputError, match=r"looks swapped: longitude before latitude"):
        site_frame(MARS).into([[18.44, 77.45]], "lonlat")
    with pytest.raises(InvalidInputError, match=r"looks swapped: x \(east\) before y"):
        site_frame(UTM).into([[4_251_500.0, 518_334.0]], "EPSG:32612")
    with pytest.raises(InvalidInputError, match="longitude and latitude look swapped"):
        SiteFrame(Place("EPSG:4326", 38.41, -110.79))


def test_a_reference_on_another_body_is_refused_by_the_names_of_both() -> None:
    with pytest.raises(
        InvalidInputError, match=r"no transformation between WGS 84 and .*Mars .*Mars vs Earth"
    ):
        site_frame(MARS).into([[77.45, 18.44]], "EPSG:4326")
    with pytest.raises(InvalidInputError, match=r"no transformation between"):
        site_frame(MOON).out([[0.0, 0.0]], "IAU_2015:49900")


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_points_that_are_no_numbers_are_named_by_their_row(value: float) -> None:
    with pytest.raises(InvalidInputError, match=r"point 2 is .*: no numbers"):
        site_frame(EARTH).into([[-110.79, 38.41], [value, 38.4]], "lonlat")


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("EPSG:999999", "not a coordinate reference that is known"),
        ("nonsense", "names no coordinate reference"),
        ("+proj=utm +zone=12 +nadgrids=/etc/passwd", "names no coordinate reference"),
        ("IAU_2015:49901", "counts longitude to the west"),
        ("EPSG:2263", "not in metres"),
        ("EPSG:4978", "neither in degrees nor a map projection"),
        ("GEOGCS[" + "x" * 9000, "longer than 8000"),
    ],
)
def test_a_reference_of_no_use_is_named(text: str, why: str) -> None:
    with pytest.raises(InvalidInputError, match=why):
        SiteFrame(Place(text, 0.0, 0.0))


def test_a_point_far_away_is_told_with_its_distance() -> None:
    with pytest.raises(InvalidInputError, match=r"\d+ km from the site; at most 100 km"):
        site_frame(EARTH).into([[-100.0, 38.41]], "lonlat")


def test_a_million_points_are_brought_over_in_seconds() -> None:
    points = np.random.default_rng(1).uniform(-5000, 5000, (1_000_000, 2))
    assert np.abs(site_frame(UTM).into(site_frame(UTM).out(points, "lonlat"), "lonlat") - points).max() < 1e-3


def test_the_scale_of_a_projection_is_that_of_the_geodesics() -> None:
    """Against geodesics round the origin, another way. EPSG:3857 counts on a sphere: up to 0.7 % off."""
    places = [UTM, MARS_MAP, Place("EPSG:3857", -12_333_000.0, 4_635_000.0), Place("EPSG:3413", 0.0, 0.0)]
    for place in [*places, Place(pyproj.CRS("EPSG:32612+5773").to_wkt(), UTM.x, UTM.y)]:
        frame = SiteFrame(place)
        ring = 100.0 * np.array([[math.cos(a), math.sin(a)] for a in np.linspace(0, np.pi, 181)])
        degrees = frame.crs.geodetic_crs
        to_degrees = pyproj.Transformer.from_crs(frame.crs, degrees, always_xy=True).transform
        geod = degrees.get_geod()
        ends = [to_degrees(*(np.array([place.x, place.y]) + k * ring).T) for k in (-1, 1)]
        metres = geod.inv(*ends[0], *ends[1])[2]
        scales = 200.0 / metres
        assert frame.stretch == pytest.approx(
            scales[np.abs(scales - 1.0).argmax()], rel=7e-3 if place.crs == "EPSG:3857" else 1e-4
        )


@pytest.mark.parametrize("origin", [(1e8, 1e8), (2e7, 0.0), (-1e8, 0.0)])
def test_an_origin_out_of_reach_of_its_projection_is_refused(origin: tuple[float, float]) -> None:
    with pytest.raises(InvalidInputError, match=r"of no use at|metres for a metre"):
        SiteFrame(Place("EPSG:32612", *origin)).require_true_metres(0.01)
