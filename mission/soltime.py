"""Mars time and the sun over a site: the one place that turns UTC, sols and local solar time into each other.

After Allison and McEwen (2000), "A post-Pathfinder evaluation of areocentric solar coordinates", and the
Mars24 notes built on it; good to a minute of time and 0.1 degree, far below what a shadow shows.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from mission.errors import MissionError

SOL_S = 88775.244
"""Length of a mean solar day on Mars, seconds."""

_J2000_UTC = datetime(2000, 1, 1, 12, tzinfo=UTC)
_TT_MINUS_UTC_S = 69.184
"""Terrestrial time minus UTC since 2017; a few seconds less before, which moves the sun by 0.02 degrees."""


@dataclass(frozen=True, slots=True)
class SolTime:
    """Sol number of a mission and local mean solar time, in Mars hours 0 to 24 (for people)."""

    sol: int
    lmst_h: float

    def __post_init__(self) -> None:
        if not 0 <= self.lmst_h < 24:
            raise MissionError(
                f"local mean solar time is {self.lmst_h} h; it must be at least 0 and below 24"
            )

    def after(self, seconds: float) -> SolTime:
        """Return the time `seconds` (of a clock on Earth) later: a Mars hour lasts 3,699 s."""
        total = self.lmst_h + seconds / SOL_S * 24.0
        days = math.floor(total / 24.0)
        return SolTime(self.sol + days, min(total - 24.0 * days, math.nextafter(24.0, 0.0)))

    def __str__(self) -> str:
        seconds = int(self.lmst_h * 3600)
        return f"Sol {self.sol} {seconds // 3600:02d}:{seconds // 60 % 60:02d}:{seconds % 60:02d} LMST"


def days_since_j2000(utc: datetime) -> float:
    """Return days of terrestrial time since J2000.0.

    Raises
    ------
    MissionError
        If the time has no zone.
    """
    if utc.tzinfo is None:
        raise MissionError(f"time {utc.isoformat()} has no zone; UTC is needed")
    return ((utc - _J2000_UTC).total_seconds() + _TT_MINUS_UTC_S) / 86400.0


def _orbit(days: float) -> tuple[float, float]:
    """Return areocentric solar longitude Ls and equation of centre, degrees."""
    anomaly = math.radians(19.3871 + 0.52402073 * days)
    mean_sun = 270.3871 + 0.524038496 * days
    planets = sum(
        amplitude * math.cos(math.radians(0.985626 * days / period + phase))
        for amplitude, period, phase in (
            (0.0071, 2.2353, 49.409),
            (0.0057, 2.7543, 168.173),
            (0.0039, 1.1177, 191.837),
            (0.0037, 15.7866, 21.736),
            (0.0021, 2.1354, 15.704),
            (0.0020, 2.4694, 95.528),
            (0.0018, 32.8493, 49.095),
        )
    )
    centre = (
        (10.691 + 3.0e-7 * days) * math.sin(anomaly)
        + 0.623 * math.sin(2 * anomaly)
        + 0.050 * math.sin(3 * anomaly)
        + 0.005 * math.sin(4 * anomaly)
        + 0.0005 * math.sin(5 * anomaly)
        + planets
    )
    return (mean_sun + centre) % 360.0, centre


def solar_longitude_deg(utc: datetime) -> float:
    """Return Ls, degrees: 0 is the northern spring equinox of Mars."""
    return _orbit(days_since_j2000(utc))[0]


def local_mean_solar_time_h(utc: datetime, longitude_east_deg: float) -> float:
    """Return local mean solar time, Mars hours."""
    mst = 24.0 * ((days_since_j2000(utc) - 4.5) / 1.0274912517 + 44796.0 - 0.0009626)
    return (mst + longitude_east_deg / 15.0) % 24.0


def equation_of_time_h(ls_deg: float, centre_deg: float) -> float:
    """Return true minus mean solar time, Mars hours."""
    ls = math.radians(ls_deg)
    minutes = 2.861 * math.sin(2 * ls) - 0.071 * math.sin(4 * ls) + 0.002 * math.sin(6 * ls) - centre_deg
    return minutes / 15.0


def sun_direction(ls_deg: float, latitude_deg: float, true_solar_time_h: float) -> tuple[float, float, float]:
    """Return the unit vector to the sun, east-north-up; the latitude is planetographic, as the vertical is.

    The declination is that of the sun as seen from the planet's centre, without the 0.25 sin Ls by which the
    planetographic latitude of the subsolar point differs.
    """
    ls = math.radians(ls_deg)
    declination = math.asin(0.42565 * math.sin(ls))
    latitude, hour = math.radians(latitude_deg), math.radians(15.0 * (true_solar_time_h - 12.0))
    east = -math.cos(declination) * math.sin(hour)
    north = math.cos(latitude) * math.sin(declination) - math.sin(latitude) * math.cos(
        declination
    ) * math.cos(hour)
    up = math.sin(latitude) * math.sin(declination) + math.cos(latitude) * math.cos(declination) * math.cos(
        hour
    )
    return east, north, up


@dataclass(frozen=True, slots=True)
class SunClock:
    """The sun over one place, from a moment of the mission on.

    Attributes
    ----------
    start_utc
        The moment that is t = 0.
    latitude_deg, longitude_east_deg
        Planetographic latitude and east longitude.
    """

    start_utc: datetime
    latitude_deg: float
    longitude_east_deg: float

    @classmethod
    def at(
        cls, ls_deg: float, latitude_deg: float, lmst_h: float, longitude_east_deg: float = 137.4
    ) -> SunClock:
        """Return the clock of a moment in the Martian year 2025-2027 with this season and local mean time."""
        utc = datetime(2024, 11, 12, tzinfo=UTC)  # Ls 0 of Mars year 38
        for _ in range(40):
            gap = math.remainder(ls_deg - solar_longitude_deg(utc), 360.0)
            if gap < -1.0:
                gap += 360.0
            utc += timedelta(days=gap / 0.55)
            if abs(gap) < 0.01:
                break
        gap_h = math.remainder(lmst_h - local_mean_solar_time_h(utc, longitude_east_deg), 24.0)
        return cls(utc + timedelta(seconds=gap_h / 24.0 * SOL_S), latitude_deg, longitude_east_deg)

    def utc(self, t_s: float) -> datetime:
        """Return the UTC at `t_s` seconds after the start."""
        return self.start_utc + timedelta(seconds=t_s)

    def lmst_h(self, t_s: float) -> float:
        """Return local mean solar time, Mars hours, `t_s` seconds after the start."""
        return local_mean_solar_time_h(self.utc(t_s), self.longitude_east_deg)

    def direction(self, t_s: float) -> tuple[float, float, float]:
        """Return the unit vector to the sun, east-north-up, `t_s` seconds after the start."""
        ls, centre = _orbit(days_since_j2000(self.utc(t_s)))
        true_h = self.lmst_h(t_s) + equation_of_time_h(ls, centre)
        return sun_direction(ls, self.latitude_deg, true_h)

    def elevation_rad(self, t_s: float) -> float:
        """Return the height of the sun above the horizon, radians."""
        return math.asin(max(-1.0, min(1.0, self.direction(t_s)[2])))
