"""Where sun and Earth stand over a site, and how long light is on its way, by SPICE kernels."""

from __future__ import annotations

import math
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mission.sky import SunCourse
from neighbours.geodata.errors import GeodataError, MissingExtraError

Floats = NDArray[np.float64]
MARS_PCK = Path(__file__).with_name("mars_iau2009.tpc")
"""Orientation of Mars for those whose kernels hold none."""
CORRECTION = "LT+S"
"""What is seen: with light time and the aberration by the site's own speed."""
BODIES = {"MARS": ("499", "4"), "MOON": ("301",), "EARTH": ("399",)}
"""Body and where its centre is looked up: Mars' barycentre is within 0.3 m of the planet's own centre."""
STEP_S = 600.0
"""Between the samples of a course; four of them in a cubic leave less than 1e-6 rad."""
MAX_SAMPLES = 2_000
_POOL = threading.RLock()
"""SPICE has one pool of kernels for a process."""


@dataclass(frozen=True, slots=True)
class Site:
    """A point on a body: its name as SPICE has it, planetographic longitude (east) and latitude, height."""

    body: str
    longitude_deg: float
    latitude_deg: float
    height_m: float = 0.0

    def __post_init__(self) -> None:
        if self.body not in BODIES:
            raise GeodataError(f"body is {self.body[:40]!r}; known are {', '.join(BODIES)}")
        if not (abs(self.latitude_deg) <= 90.0 and abs(self.longitude_deg) <= 360.0):
            raise GeodataError(
                f"the site is at longitude {self.longitude_deg:g}, latitude {self.latitude_deg:g}; "
                "a latitude is within 90 degrees"
            )


@dataclass(frozen=True, slots=True)
class Seen:
    """What is seen from a site: unit vectors (n, 3) east-north-up, light times (n,) s, by SPICE."""

    sun: Floats
    earth: Floats | None
    """None on Earth itself."""
    sun_light_time_s: Floats
    earth_light_time_s: Floats | None


def look(kernels: Sequence[Path], site: Site, times: Sequence[datetime]) -> Seen:
    """Return directions of sun and Earth and their light times at moments.

    Parameters
    ----------
    kernels
        Files: leap seconds (LSK), ephemerides (SPK) of the sun, the Earth and the body, and its orientation
        (PCK); that of Mars may be missing, then the IAU's of 2009 is used.

    Raises
    ------
    GeodataError
        If a file is missing or no kernel, if a time has no zone, or if the kernels do not tell what is asked.
    """
    spiceypy = _spiceypy()
    for time in times:
        if time.tzinfo is None:
            raise GeodataError(f"time {time.isoformat()} has no zone; UTC is needed")
    with _loaded(kernels, site.body):
        try:
            instants = [spiceypy.str2et(_spice_time(time)) for time in times]
            radii = spiceypy.bodvrd(site.body, "RADII", 3)[1]
            centre = _centre(site.body, instants[0]) if instants else BODIES[site.body][0]
            place, turn = _place(site, radii)
            sun = [_direction("SUN", et, site.body, centre, place, turn) for et in instants]
            others = site.body != "EARTH"
            earth = [_direction("EARTH", et, site.body, centre, place, turn) for et in instants if others]
        except spiceypy.exceptions.SpiceyError as err:
            raise GeodataError(f"the kernels do not tell it: {_told(err)}") from err
    return Seen(
        np.array([way for way, _ in sun]).reshape(-1, 3),
        np.array([way for way, _ in earth]).reshape(-1, 3) if others else None,
        np.array([light for _, light in sun]),
        np.array([light for _, light in earth]) if others else None,
    )


def sun_course(kernels: Sequence[Path], site: Site, start_utc: datetime, duration_s: float) -> SunCourse:
    """Return the sun's course over a site from a moment on, sampled for `mission.Sky`.

    One sample lies before the start and two behind the end, so that a cubic reaches all between.
    """
    count = math.ceil(duration_s / STEP_S) + 4
    if not (duration_s > 0 and count <= MAX_SAMPLES):
        limit = (MAX_SAMPLES - 4) * STEP_S
        raise GeodataError(f"a course of {duration_s:g} s is asked; it must be above 0 and at most {limit:g}")
    offsets = [(k - 1) * STEP_S for k in range(count)]
    seen = look(kernels, site, [start_utc + timedelta(seconds=t) for t in offsets])
    ways = tuple((float(e), float(n), float(u)) for e, n, u in seen.sun)
    return SunCourse(start_utc.astimezone(UTC).isoformat(), offsets[0], STEP_S, ways)


def _spice_time(time: datetime) -> str:
    return time.astimezone(UTC).strftime("%Y-%m-%dT%H:%M:%S.%f")


def _told(err: Exception) -> str:
    """Return SPICE's own sentence, without the frame that spiceypy draws round it."""
    lines = [getattr(err, name, "") for name in ("short", "explain", "long")]
    told = " ".join(" ".join(line.split()) for line in lines if line) or str(err)
    return told[:300]


def _centre(body: str, et: float) -> str:
    """Return the number under which the loaded kernels know where a body is."""
    import spiceypy

    for number in BODIES[body]:
        try:
            spiceypy.spkgps(int(number), et, "J2000", 10)
        except spiceypy.exceptions.SpiceyError:
            continue
        return number
    return BODIES[body][0]


def _place(site: Site, radii: Floats) -> tuple[Floats, Floats]:
    """Return a site in its body's own frame, km, and the rotation (3, 3) from there to east-north-up."""
    import spiceypy

    lon, lat = math.radians(site.longitude_deg), math.radians(site.latitude_deg)
    flat = (radii[0] - radii[2]) / radii[0]
    place = spiceypy.georec(lon, lat, site.height_m / 1000.0, radii[0], flat)
    (sa, ca), (sb, cb) = (math.sin(lon), math.cos(lon)), (math.sin(lat), math.cos(lat))
    turn = np.array([[-sa, ca, 0.0], [-sb * ca, -sb * sa, cb], [cb * ca, cb * sa, sb]])
    return np.asarray(place), turn


def _direction(
    target: str, et: float, body: str, centre: str, place: Floats, turn: Floats
) -> tuple[Floats, float]:
    import spiceypy

    frame = f"IAU_{body}"
    state, light = spiceypy.spkcpo(target, et, frame, "OBSERVER", CORRECTION, place, centre, frame)
    way = turn @ np.asarray(state)[:3]
    return way / np.linalg.norm(way), float(light)


@contextmanager
def _loaded(kernels: Sequence[Path], body: str) -> Iterator[None]:
    """Hold the pool with these kernels and nothing else in it."""
    spiceypy = _spiceypy()
    if not kernels:
        raise GeodataError(
            "no kernel is named; leap seconds, ephemerides and the body's orientation are needed"
        )
    with _POOL:
        spiceypy.kclear()
        try:
            for kernel in kernels:
                if not kernel.is_file():
                    raise GeodataError(f"the kernel {kernel} is not a file")
                try:
                    spiceypy.furnsh(str(kernel))
                except spiceypy.exceptions.SpiceyError as err:
                    raise GeodataError(f"{kernel} is not a kernel that SPICE accepts: {_told(err)}") from err
            if body == "MARS" and not spiceypy.bodfnd(499, "PM"):
                spiceypy.furnsh(str(MARS_PCK))
            yield
        finally:
            spiceypy.kclear()
            spiceypy.reset()


def _spiceypy() -> Any:
    try:
        import spiceypy
    except ImportError:
        raise MissingExtraError("kernels need spiceypy: pip install 'outcrop[geo]'") from None
    return spiceypy
