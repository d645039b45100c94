"""Exact solids as rocks: points on what a camera sees of them, and what the fit makes of these."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_iface.localization.rock_models import FAMILIES, best_rock_model

Array = npt.NDArray[np.float64]

TABLE_I = [
    ("semi-ellipsoid", 0.407, 0.292, 0.228, 0.0),
    ("tetrahedron", 0.083, 0.083, 0.083, 0.5),
    ("tetrahedron", 0.32, 0.32, 0.281, 1.3),
    ("hemispheroid", 0.154, 0.154, 0.156, 0.0),
    ("cone", 0.241, 0.241, 0.274, 0.0),
    ("tetrahedron", 0.416, 0.416, 0.216, 1.06),
]
"""Li et al. 2007, table I: family, r or a, b, h (m) and orientation (rad)."""


def height_at(family: str, x: Any, y: Any, a: float, b: float, h: float, phi: float) -> Any:
    """Return heights of a solid straight from its geometry, about the origin; below 0 outside."""
    if family == "tetrahedron":
        turns = phi + math.tau / 3 * np.arange(3)
        corners = np.column_stack([np.cos(turns), np.sin(turns)])
        lows = [(1 + 2 * (x * cx + y * cy) / a) / 3 for cx, cy in corners]  # barycentric coordinates
        return 3 * h * np.min(lows, axis=0)
    u, v = x * math.cos(phi) + y * math.sin(phi), y * math.cos(phi) - x * math.sin(phi)
    rho = np.hypot(u / a, v / b)
    if family == "cone":
        return h * (1 - rho)
    return np.where(rho <= 1, h * np.sqrt(np.maximum(1 - rho**2, 0)), -1.0)


def surface(
    family: str,
    a: float,
    b: float,
    h: float,
    phi: float,
    rng: np.random.Generator,
    *,
    one_sided: bool,
    noise: float = 0.0,
    count: int = 150,
) -> Array:
    """Return points [n, 3] on a solid; one-sided: only what a camera 8 m to the west and 1.5 m up sees."""
    kept: list[tuple[float, float, float]] = []
    while len(kept) < count:
        x, y = rng.uniform(-a, a, (2, 400))
        z = height_at(family, x, y, a, b, h, phi)
        step = 1e-5
        slope_x = (height_at(family, x + step, y, a, b, h, phi) - z) / step
        slope_y = (height_at(family, x, y + step, a, b, h, phi) - z) / step
        facing = slope_x * (x + 8) + slope_y * y + (1.5 - z) > 0
        good = (z > 0.05 * h) & (facing | (not one_sided))
        kept += list(zip(x[good], y[good], z[good], strict=True))
    points = np.array(kept[:count])
    return points + rng.normal(0, noise, (count, 3)) if noise else points


def a_rock(family: str, rng: np.random.Generator) -> tuple[float, float, float, float]:
    """Return a, b, h, orientation of a random solid."""
    a, h = float(rng.uniform(0.15, 0.5)), float(rng.uniform(0.12, 0.35))
    b = a * float(rng.uniform(0.5, 0.8)) if family == "semi-ellipsoid" else a
    return a, b, h, float(rng.uniform(0, math.pi))


def area_of(family: str, a: float, b: float, h: float, phi: float) -> float:
    """Return the surface by summing over a fine grid."""
    axis = np.linspace(-a, a, 600)
    x, y = np.meshgrid(axis, axis)
    z = height_at(family, x, y, a, b, h, phi)
    zy, zx = np.gradient(np.maximum(z, 0), axis, axis)
    return float(np.sqrt(1 + zx**2 + zy**2)[z > 0].sum() * (axis[1] - axis[0]) ** 2)


def whole_solids(of_each: int = 18, seed: int = 3) -> dict[str, Any]:
    """Return how often the family is right, and the mean errors (height, radius, surface) from one side."""
    rng = np.random.default_rng(seed)
    right, errors = 0, []
    for family in FAMILIES:
        for _ in range(of_each):
            points = surface(family, *a_rock(family, rng), rng, one_sided=False)
            right += best_rock_model(points).family == family
        for _ in range(8):
            a, b, h, phi = a_rock(family, rng)
            rock = best_rock_model(surface(family, a, b, h, phi, rng, one_sided=True, noise=0.01))
            truth = np.array([h, math.sqrt(a * b), area_of(family, a, b, h, phi)])
            errors.append(np.abs(np.array([rock.height_m, rock.radius_m, rock.area_m2]) / truth - 1))
    return {"right": right, "solids": of_each * len(FAMILIES), "one_sided": np.mean(errors, axis=0).tolist()}


def table_one() -> list[dict[str, Any]]:
    """Return table I of the paper given back from points on rocks of its dimensions."""
    rows = []
    for family, a, b, h, phi in TABLE_I:
        rock = best_rock_model(surface(family, a, b, h, phi, np.random.default_rng(1), one_sided=False))
        period = math.tau / 3 if family == "tetrahedron" else math.pi
        found = phi + math.remainder(rock.orientation_rad - phi, period) if rock.orientation_rad else 0.0
        rows.append(
            {
                "family": family,
                "given": [a, b, h],
                "found_family": rock.family,
                "found": [*rock.axes_m, rock.height_m],
                "phi": phi,
                "found_phi": found if family == "tetrahedron" else 0.0,
            }
        )
    return rows
