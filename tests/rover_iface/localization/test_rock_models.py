"""Rock models: right family on exact shapes, small errors from one side, table I of Li et al. 2007."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rover_iface.errors import LocalizationError
from rover_iface.localization.rock_models import FAMILIES, best_rock_model, fit_rock_model
from studies.common.rock_solids import TABLE_I, a_rock, area_of, surface


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
