"""Rocks as simple solids: the surface seen from one side fitted by least squares, with uncertainty.

A rock is taken as symmetric about its peak and fitted as hemispheroid, semi-ellipsoid, cone and tetrahedron;
the model with the least RMS of heights is kept (Li et al., eq. 1, table I). Coordinates are
metres in a frame whose z = 0 is the ground plane around the rock and whose z points up.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rover_iface.errors import LocalizationError
from rover_iface.localization import rock_model_kernels as kernels

Array = NDArray[np.floating]

FEWEST_POINTS = 12
EDGE = 0.01
"""Share of the squared radius at which a spheroid's height, vertical there, goes on as a straight line."""


def _spheroid_area(a: float, b: float, h: float) -> float:
    p = 1.6075  # Thomsen's approximation, within 1.1 %
    mean = ((a * b) ** p + (a * h) ** p + (b * h) ** p) / 3
    return float(2 * math.pi * mean ** (1 / p))


@dataclass(frozen=True, slots=True)
class _Family:
    code: int
    area: Callable[[Array], float]
    turns: tuple[float, ...] = ()

    def starts(self, x: float, y: float, r: float, h: float) -> list[list[float]]:
        if not self.turns:
            return [[x, y, r, h]]
        shape = [x, y, r, h] if self.code == kernels.TETRAHEDRON else [x, y, r, h, 0.8 * r]
        return [[*shape, turn] for turn in self.turns]


FAMILIES: Final[dict[str, _Family]] = {
    "hemispheroid": _Family(kernels.HEMISPHEROID, lambda p: _spheroid_area(p[2], p[2], p[3])),
    "cone": _Family(kernels.CONE, lambda p: math.pi * float(p[2]) * math.hypot(p[2], p[3])),
    "tetrahedron": _Family(
        kernels.TETRAHEDRON,
        lambda p: 1.5 * math.sqrt(3) * float(p[2]) * math.hypot(p[3], p[2] / 2),
        (0.0, math.pi / 6, math.pi / 3, math.pi / 2),
    ),
    "semi-ellipsoid": _Family(
        kernels.ELLIPSOID,
        lambda p: _spheroid_area(p[2], p[4], p[3]),
        (0.0, math.pi / 4, math.pi / 2, 3 * math.pi / 4),
    ),
}
"""Families of rock by name; one with more parameters stands after those it contains."""

SIMPLER_WITHIN, SIMPLER_BELOW_M = 1.05, 5e-4
"""A semi-ellipsoid replaces a simpler model only if that one's RMS is more than this times as large and
half a millimetre: it contains the hemispheroid and would win every tie."""


@dataclass(frozen=True, eq=False, slots=True)
class RockModel:
    """A fitted rock.

    Parameters
    ----------
    family
        One of `FAMILIES`.
    centre
        Its axis on the ground plane, x and y, metres.
    height_m, radius_m, area_m2
        Height over the ground plane; radius of the (enclosing) circle at the bottom, for a semi-ellipsoid
        sqrt(a b); area of the surface above ground. `*_sigma` are their standard deviations.
    axes_m
        Semi-axes a >= b of the bottom; both the radius if it is a circle or triangle.
    orientation_rad
        Direction of axis a in [0, pi), or of a corner of the triangle in [0, 2 pi / 3); 0 where it has none.
    rms_m
        Root mean square of the differences of height (eq. 1).
    """

    family: str
    centre: tuple[float, float]
    height_m: float
    radius_m: float
    area_m2: float
    height_sigma_m: float
    radius_sigma_m: float
    area_sigma_m2: float
    axes_m: tuple[float, float]
    orientation_rad: float
    rms_m: float


def _checked(points: ArrayLike) -> Array:
    surface = np.asarray(points, dtype=float)
    if surface.ndim != 2 or surface.shape[1] != 3 or len(surface) < FEWEST_POINTS:
        raise LocalizationError(f"a rock takes at least {FEWEST_POINTS} points [n, 3], found {surface.shape}")
    if not np.isfinite(surface).all():
        raise LocalizationError("a rock has a point that is not finite")
    if surface[:, 2].max() <= 0:
        raise LocalizationError(
            f"the highest point of a rock is {surface[:, 2].max():.3f} m; it must be above 0"
        )
    return surface


def _radius(family: str, p: Array) -> float:
    return math.sqrt(p[2] * p[4]) if family == "semi-ellipsoid" else float(p[2])


def fit_rock_model(
    points: ArrayLike,
    family: str,
    *,
    radius_m: tuple[float, float] | None = None,
    height_m: tuple[float, float] | None = None,
) -> RockModel:
    """Return the best rock of one family through surface points [n, 3], m; see the module for the frame.

    `radius_m` and `height_m` bound the radius or semi-axes and the height where the outline of the rock is
    known; a triangle's circle may be 1.3 times as large.

    Raises
    ------
    LocalizationError
        If the family is unknown, or there are too few points, or none above ground.
    """
    surface = _checked(points)
    if family not in FAMILIES:
        raise LocalizationError(f"rock family {family!r} is unknown; known are {', '.join(FAMILIES)}")
    model = FAMILIES[family]
    xy, z = surface[:, :2], np.ascontiguousarray(surface[:, 2])
    top_x, top_y, h = surface[int(z.argmax())]
    extent = max(float(np.hypot(*(xy - (top_x, top_y)).T).max()), 1e-3)
    starts = model.starts(top_x, top_y, extent, h)
    low, high = np.full(len(starts[0]), -np.inf), np.full(len(starts[0]), np.inf)
    sizes = [2, 3, 4] if family == "semi-ellipsoid" else [2, 3]
    low[sizes] = [0.2 * extent, 0.5 * h, 0.2 * extent][: len(sizes)]
    high[sizes] = [3 * extent, 2 * h, 3 * extent][: len(sizes)]
    if radius_m is not None:
        lengths = [2, 4] if family == "semi-ellipsoid" else [2]
        low[lengths], high[lengths] = radius_m[0], radius_m[1] * (1.3 if family == "tetrahedron" else 1.0)
    if height_m is not None:
        low[3], high[3] = height_m
    x, y = np.ascontiguousarray(xy[:, 0]), np.ascontiguousarray(xy[:, 1])
    fits = [
        kernels.fit(model.code, np.array(start), low, high, x, y, z, extent, EDGE, 60) for start in starts
    ]
    p, cost, normal = min(fits, key=lambda one: float(one[1]))
    free = max(len(z) - len(p), 1)
    covariance = 2 * cost / free * np.linalg.pinv(normal)

    def sigma(of: Callable[[Array], float]) -> float:
        steps = 1e-5 * extent * np.eye(len(p))
        slope = np.array([(of(p + step) - of(p - step)) / (2e-5 * extent) for step in steps])
        return math.sqrt(max(float(slope @ covariance @ slope), 0.0))

    a, b, turn = float(p[2]), float(p[2]), 0.0
    if family == "semi-ellipsoid":
        b, turn = float(p[4]), float(p[5])
        if b > a:
            a, b, turn = b, a, turn + math.pi / 2
        turn %= math.pi
    elif family == "tetrahedron":
        turn = float(p[4]) % (2 * math.pi / 3)
    return RockModel(
        family=family,
        centre=(float(p[0]), float(p[1])),
        height_m=float(p[3]),
        radius_m=_radius(family, p),
        area_m2=float(model.area(p)),
        height_sigma_m=sigma(lambda q: float(q[3])),
        radius_sigma_m=sigma(lambda q: _radius(family, q)),
        area_sigma_m2=sigma(model.area),
        axes_m=(a, b),
        orientation_rad=turn,
        rms_m=math.sqrt(2 * cost / len(z)),
    )


def best_rock_model(
    points: ArrayLike,
    *,
    radius_m: tuple[float, float] | None = None,
    height_m: tuple[float, float] | None = None,
) -> RockModel:
    """Return the rock of the family with the least RMS of heights (Li et al., eq. 1); `SIMPLER_WITHIN` is the
    one exception.

    Points [n, 3], m, in a frame whose z = 0 is the ground and whose z points up; the ranges of radius and
    height bound the fit.

    Raises
    ------
    LocalizationError
        If there are fewer than `FEWEST_POINTS` points [n, 3], or none above ground.
    """
    fitted = {
        family: fit_rock_model(points, family, radius_m=radius_m, height_m=height_m) for family in FAMILIES
    }
    wide = fitted.pop("semi-ellipsoid")
    simple = min(fitted.values(), key=lambda rock: rock.rms_m)
    return simple if simple.rms_m <= SIMPLER_WITHIN * wide.rms_m + SIMPLER_BELOW_M else wide
