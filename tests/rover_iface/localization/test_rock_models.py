"""Rock models: right family on exact shapes, small errors from one side, table I of Li et al. 2007."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rover_iface.errors import LocalizationError
from rover_iface.localization.rock_models import FAMILIES, best_rock_model, fit_rock_model


def height_at(family, x, y, a, b, h, phi):
    """Heights of the solids straight from their geometry, about the origin; below 0 outside."""
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


def surface(family, a, b, h, phi, rng, *, one_sided, noise=0.0, count=150):
    """Points on a solid; one-sided: only what a camera 8 m to the west and 1.5 m up sees."""
    kept = []
    while len(kept) < count:
        x, y = rng.uniform(-a, a, (2, 400))
        z = height_at(family, x, y, a, b, h, phi)
        step = 1e-5
        slope_x = (height_at(family, x + step, y, a, b, h, phi) - z) / step
        slope_y = (height_at(family, x, y + step, a, b, h, phi) - z) / step
        facing = slope_x * (x + 8) + slope_y * y + (1.5 - z) > 0
        good = (z > 0.05 * h) & (facing | (not one_sided))
        kept += list(zip(x[good], y[good], z[good], strict=True))
    return np.array(kept[:count]) + rng.normal(0, noise, (count, 3)) if noise else np.array(kept[:count])


def a_rock(family, rng):
    a, h = rng.uniform(0.15, 0.5), rng.uniform(0.12, 0.35)
    b = a * rng.uniform(0.5, 0.8) if family == "semi-ellipsoid" else a
    return a, b, h, rng.uniform(0, math.pi)


def area_of(family, a, b, h, phi):
    """Surface area by summing the true surface over a fine grid."""
    axis = np.linspace(-a, a, 600)
    x, y = np.meshgrid(axis, axis)
    z = height_at(family, x, y, a, b, h, phi)
    zy, zx = np.gradient(np.maximum(z, 0), axis, axis)
    return float(np.sqrt(1 + zx**2 + zy**2)[z > 0].sum() * (axis[1] - axis[0]) ** 2)


def test_exact_shapes_are_given_their_family():
    rng = np.random.default_rng(3)
    right = 0
    for family in FAMILIES:
        for _ in range(6):
            right += (
                best_rock_model(surface(family, *a_rock(family, rng), rng, one_sided=False)).family == family
            )
    assert right >= 0.8 * 24


def test_rocks_seen_from_one_side_come_out_within_the_bars():
    rng = np.random.default_rng(5)
    errors = []
    for family in FAMILIES:
        for _ in range(8):
            a, b, h, phi = a_rock(family, rng)
            rock = best_rock_model(surface(family, a, b, h, phi, rng, one_sided=True, noise=0.01))
            truth = np.array([h, math.sqrt(a * b), area_of(family, a, b, h, phi)])
            errors.append(np.abs(np.array([rock.height_m, rock.radius_m, rock.area_m2]) / truth - 1))
    height, radius, area = np.mean(errors, axis=0)
    print(f"mean errors: height {height:.3f}, radius {radius:.3f}, area {area:.3f}")
    assert height <= 0.20
    assert radius <= 0.30
    assert area <= 0.40


TABLE_I = [
    ("semi-ellipsoid", 0.407, 0.292, 0.228, 0.0),
    ("tetrahedron", 0.083, 0.083, 0.083, 0.5),
    ("tetrahedron", 0.32, 0.32, 0.281, 1.3),
    ("hemispheroid", 0.154, 0.154, 0.156, 0.0),
    ("cone", 0.241, 0.241, 0.274, 0.0),
    ("tetrahedron", 0.416, 0.416, 0.216, 1.06),
]


@pytest.mark.parametrize(("family", "a", "b", "h", "phi"), TABLE_I)
def test_rocks_of_table_one_are_given_back(family, a, b, h, phi):
    points = surface(family, a, b, h, phi, np.random.default_rng(1), one_sided=False)
    rock = best_rock_model(points + np.array([5.0, -2.0, 0.0]))
    assert rock.family == family
    assert rock.axes_m == pytest.approx((a, b), rel=0.02)
    assert rock.height_m == pytest.approx(h, rel=0.02)
    assert rock.centre == pytest.approx((5.0, -2.0), abs=0.005)
    period = {"tetrahedron": math.tau / 3, "semi-ellipsoid": math.pi}.get(family, 1.0)
    assert math.remainder(rock.orientation_rad - phi, period) == pytest.approx(0.0, abs=0.02)
    assert rock.area_m2 == pytest.approx(area_of(family, a, b, h, phi), rel=0.05)


def test_stated_uncertainty_is_the_spread_of_repeated_fits():
    rng = np.random.default_rng(7)
    exact = surface("cone", 0.3, 0.3, 0.25, 0.0, rng, one_sided=False)
    rocks = []
    for _ in range(40):
        seen = exact + np.column_stack([np.zeros((150, 2)), rng.normal(0, 0.01, 150)])
        rocks.append(fit_rock_model(seen, "cone"))
    for value, stated in [
        ("height_m", "height_sigma_m"),
        ("radius_m", "radius_sigma_m"),
        ("area_m2", "area_sigma_m2"),
    ]:
        spread = np.std([getattr(rock, value) for rock in rocks])
        assert 0.6 < np.mean([getattr(rock, stated) for rock in rocks]) / spread < 1.6


def test_points_that_are_no_rock_are_refused():
    with pytest.raises(LocalizationError, match="at least 12"):
        best_rock_model(np.ones((5, 3)))
    with pytest.raises(LocalizationError, match="above 0"):
        best_rock_model(-np.ones((20, 3)))
    with pytest.raises(LocalizationError, match="not finite"):
        best_rock_model(np.full((20, 3), np.nan))
    with pytest.raises(LocalizationError, match="unknown"):
        fit_rock_model(np.ones((20, 3)), "cube")
