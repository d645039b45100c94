"""Tables of fixes (GNSS, localisation) and of poses in an odometry frame, as CSV."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ground.errors import InvalidInputError
from ground.geo.heights import convert_heights
from ground.geo.place import Heights, Place, heights_named
from ground.geo.references import LONLAT, WGS84
from ground.geo.site_frame import SiteFrame, site_frame

Floats = NDArray[np.float64]
MAX_ROWS = 2_000
"""Fixes of one table: each pair of them is weighed against all others."""
PLACES = (("lon", "lat"), ("x", "y"), ("east_m", "north_m"))
POSE = ("x_m", "y_m", "z_m")
Row = tuple[str, Mapping[str, str]]


@dataclass(frozen=True, slots=True)
class Fixes:
    """Places in the site frame (n, 3), NaN for a height that is not known, and covariances (n, 3, 3)."""

    names: tuple[str, ...]
    places_m: Floats
    covariance_m2: Floats


@dataclass(frozen=True, slots=True)
class Poses:
    """Places in the odometry frame (n, 3) with covariances (n, 3, 3), zero where none is given."""

    names: tuple[str, ...]
    places_m: Floats
    covariance_m2: Floats


def read_poses(text: str) -> Poses:
    """Return the poses of a CSV: `name, x_m, y_m`, and `z_m`, `sigma_m` or `sigma_x_m` ... where known."""
    rows = _rows(text, "poses")
    places = np.array([[_number(row, name, 0.0 if name == "z_m" else None) for name in POSE] for row in rows])
    spread = [
        np.diag([_number(row, f"sigma_{axis}_m", _number(row, "sigma_m", 0.0)) ** 2 for axis in "xyz"])
        for row in rows
    ]
    return Poses(tuple(row[0] for row in rows), places, np.array(spread))


def read_fixes(
    text: str, place: Place | None, *, crs: str = WGS84, heights: Heights = "unknown", geoid: str = "EGM96"
) -> tuple[Fixes, Place | None]:
    """Return the fixes of a CSV in site metres, and the place of the site.

    Columns are `name`; `lon` and `lat`, or `x` and `y` of `crs`, or `east_m` and `north_m` of the site;
    `height_m`, which may be empty, counted from `heights` or what a column `heights` says; and either
    `sigma_m` and `sigma_up_m`, or `sigma_east_m`, `sigma_north_m` and `sigma_up_m`, or the covariance about
    true east, north and up as `cov_ee, cov_en, cov_nn` and `cov_eu, cov_nu, cov_uu`. Without a place the
    first fix is the origin. A covariance is turned to the site's axes.

    Raises
    ------
    InvalidInputError
        If a cell is not a number, a fix is far away, or a height counts from what cannot be converted.
    """
    rows = _rows(text, "fixes")
    across, up = _columns(rows)
    given = np.array([[_number(row, across), _number(row, up)] for row in rows])
    tall = np.array([_number(row, "height_m", math.nan) for row in rows])
    spread = np.array([_spread(row, bool(np.isfinite(h))) for row, h in zip(rows, tall, strict=True)])
    names = tuple(row[0] for row in rows)
    words = [_word(row, heights) for row in rows]
    if across == "east_m":
        _require_one(names, words, tall, "unknown" if place is None else place.heights)
        return Fixes(names, np.column_stack([given, tall]), spread), place
    name = LONLAT if across == "lon" else crs
    if place is None:
        place = _first_as_place(given[0], tall[0], words[0], WGS84 if across == "lon" else crs)
    frame = site_frame(place)
    site = frame.into(given, name)
    lonlat = frame.out(site, LONLAT)
    ups = _site_heights(names, words, tall, lonlat, frame, geoid)
    turned = np.array([_turned(cov, frame, at) for cov, at in zip(spread, site, strict=True)])
    return Fixes(names, np.column_stack([site, ups]), turned), place


def _rows(text: str, what: str) -> list[Row]:
    try:
        reader = csv.DictReader(io.StringIO(text.lstrip("\ufeff"), newline=""), strict=True)
        found = [({k: v or "" for k, v in row.items() if k is not None}, reader.line_num) for row in reader]
    except csv.Error as err:
        raise InvalidInputError(f"the table of {what} is damaged: {err}") from err
    if not found or "name" not in found[0][0]:
        raise InvalidInputError(f"the table of {what} needs a column name and at least one row")
    if len(found) > MAX_ROWS:
        raise InvalidInputError(f"the table of {what} has {len(found)} rows; at most {MAX_ROWS} are taken")
    rows: list[Row] = [(row["name"].strip() or f"line {line}", row) for row, line in found]
    seen: set[str] = set()
    for name, _ in rows:
        if name in seen:
            raise InvalidInputError(f"the table of {what} names {name!r} twice")
        seen.add(name)
    return rows


def _columns(rows: Sequence[Row]) -> tuple[str, str]:
    for across, up in PLACES:
        if across in rows[0][1] and up in rows[0][1]:
            return across, up
    raise InvalidInputError(
        "the table of fixes needs columns lon and lat, x and y, or east_m and north_m; it has "
        f"{', '.join(rows[0][1])}"
    )


def _number(row: Row, column: str, default: float | None = None) -> float:
    cell = row[1].get(column, "").strip()
    if not cell and default is not None:
        return default
    try:
        value = float(cell)
    except ValueError:
        raise InvalidInputError(f"{row[0]}: {column} is not a number: {cell[:40]!r}") from None
    if not math.isfinite(value):
        raise InvalidInputError(f"{row[0]}: {column} is {cell[:40]}; it must be finite")
    return value


def _word(row: Row, default: Heights) -> Heights:
    try:
        return heights_named(row[1].get("heights", "").strip() or default)
    except InvalidInputError as err:
        raise InvalidInputError(f"{row[0]}: {err.message}") from None


def _spread(row: Row, tall: bool) -> Floats:
    """Return the covariance (3, 3) about east, north, up of one row; NaN in `up` of a fix without height."""
    if "cov_ee" in row[1]:
        ee, en, nn = (_number(row, f"cov_{which}") for which in ("ee", "en", "nn"))
        eu, nu = (_number(row, f"cov_{which}", 0.0) for which in ("eu", "nu"))
        uu = _number(row, "cov_uu") if tall else math.nan
        found = np.array([[ee, en, eu], [en, nn, nu], [eu, nu, uu]])
    else:
        level = _number(row, "sigma_m", -1.0)
        east = _number(row, "sigma_east_m", level)
        north = _number(row, "sigma_north_m", level)
        height = _number(row, "sigma_up_m", 2.0 * level) if tall else math.nan
        if min(east, north) <= 0 or height <= 0:
            raise InvalidInputError(
                f"{row[0]}: there is no standard deviation; give sigma_m, or sigma_east_m and sigma_north_m "
                "(and sigma_up_m), or cov_ee, cov_en, cov_nn"
            )
        found = np.diag([east**2, north**2, height**2])
    size = 3 if tall else 2
    if np.linalg.eigvalsh(found[:size, :size])[0] <= 0:
        raise InvalidInputError(f"{row[0]}: the covariance is not positive definite")
    return np.asarray(found)


def _first_as_place(first: Floats, tall: float, heights: Heights, crs: str) -> Place:
    known = bool(np.isfinite(tall))
    return Place(crs, float(first[0]), float(first[1]), 0.0, float(tall) if known else None, heights)


def _require_one(names: Sequence[str], words: Sequence[Heights], tall: Floats, zero: Heights) -> None:
    for name, word, height in zip(names, words, tall, strict=True):
        if math.isfinite(height) and word not in ("unknown", zero):
            raise InvalidInputError(
                f"{name}: the height counts from the {word}, but east_m and north_m go with heights over the "
                "site's zero"
            )


def _site_heights(
    names: Sequence[str],
    words: Sequence[Heights],
    tall: Floats,
    lonlat: Floats,
    frame: SiteFrame,
    geoid: str,
) -> Floats:
    """Return heights over the site's zero, converted where they count from something else."""
    place = frame.place
    found = np.full(len(tall), np.nan)
    for word in sorted(set(words)):
        which = np.array([w == word for w in words]) & np.isfinite(tall)
        if not which.any():
            continue
        first = names[int(np.flatnonzero(which)[0])]
        if place.height_m is None:
            raise InvalidInputError(
                f"{first} has a height, but nobody has said how high the site's zero lies (place.height_m); "
                "leave height_m empty to align east, north and turn alone"
            )
        if word == place.heights == "unknown":
            raise InvalidInputError(
                f"{first} has a height and nothing says what it counts from; name it in a column heights or "
                "by --heights: ellipsoid, geoid, areoid or sphere"
            )
        try:
            over = convert_heights(lonlat[which], tall[which], word, place.heights, frame.crs, geoid=geoid)
        except InvalidInputError as err:
            raise InvalidInputError(f"{first}: {err.message}") from err
        found[which] = over - place.height_m
    return found


def _turned(covariance: Floats, frame: SiteFrame, at: Floats) -> Floats:
    """Return a covariance about true east and north, about the site's axes."""
    lon, lat = frame.out(at[None], LONLAT)[0]
    step = 1e-6 if lat < 89.0 else -1e-6
    north = frame.into([[lon, lat + step]], LONLAT)[0] - at
    angle = math.atan2(-north[0], north[1]) if step > 0 else math.atan2(north[0], -north[1])
    c, s = math.cos(angle), math.sin(angle)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    known = np.nan_to_num(covariance, nan=0.0)
    found = turn @ known @ turn.T
    if math.isnan(covariance[2, 2]):
        found[2, :] = found[:, 2] = np.nan
    return np.asarray(found)
