"""What is told of the normal under the tool, against planes whose truth is known."""

from __future__ import annotations

import math

import numpy as np

from rover_iface.placement.cloud import Array
from rover_iface.placement.plane_spread import SpreadOptions, plane_of, plane_spread

RADIUS_M, CELL_M, SUPPORT_M = 0.03, 0.0035, 0.05
LINE = (np.arange(-12, 12) + 0.5) * CELL_M
PLACES = np.array([(x, y) for x in LINE for y in LINE])


def told(cells: Array) -> float:
    return math.degrees(plane_spread(cells, RADIUS_M, CELL_M, SUPPORT_M))


def rough(rng: np.random.Generator, rms_m: float, alike_m: float = 0.012) -> Array:
    """A surface (n, 3) with bumps as wide as those of the rocks of the study."""
    apart = np.linalg.norm(PLACES[:, None] - PLACES[None], axis=2)
    root = np.linalg.cholesky(np.exp(-apart / alike_m) + 1e-9 * np.eye(len(PLACES)))
    return np.column_stack((PLACES, rms_m * root @ rng.standard_normal(len(PLACES))))


def test_a_smooth_surface_that_is_seen_as_a_whole_is_known_to_a_degree() -> None:
    flat = np.column_stack((PLACES, np.zeros(len(PLACES))))
    assert 0.6 <= told(flat) < 0.8


def test_what_is_not_seen_of_a_rough_surface_makes_its_normal_uncertain() -> None:
    whole = rough(np.random.default_rng(1), 0.003)
    part = whole[whole[:, 0] < 0.010]
    assert told(part) > 1.5 * told(whole)
    smooth = part * (1.0, 1.0, 0.05)
    assert told(smooth) < 0.6 * told(part)


def test_a_surface_that_falls_away_under_the_rim_makes_its_normal_uncertain() -> None:
    flat = np.column_stack((PLACES, np.zeros(len(PLACES))))
    falls = flat.copy()
    falls[:, 2] -= np.where(falls[:, 0] > RADIUS_M - 0.004, 0.02, 0.0)
    assert told(falls) > 2.0 * told(flat)


def test_the_true_normal_of_rough_surfaces_half_seen_lies_within_two_deviations() -> None:
    # the truth is the plane of the whole surface under a tool that comes down beside its place
    rng = np.random.default_rng(29)
    inside, plain = 0, 0
    for _ in range(120):
        whole = rough(rng, float(rng.uniform(0.001, 0.006)))
        turn = rng.uniform(0.0, math.tau)
        way = PLACES @ (math.cos(turn), math.sin(turn))
        seen = whole[way < rng.uniform(0.005, 0.035)]
        seen = seen + np.column_stack((np.zeros((len(seen), 2)), rng.normal(0.0, 0.0005, len(seen))))
        turn = rng.uniform(0.0, math.tau)
        shift = SpreadOptions().beside_m * np.array((math.cos(turn), math.sin(turn), 0.0))
        true = plane_of(whole - shift, RADIUS_M, SUPPORT_M)[0]
        found = plane_of(seen, RADIUS_M, SUPPORT_M)[0]
        off = math.degrees(math.atan(float(np.linalg.norm(true[:2] - found[:2]))))
        inside += off <= 2.0 * told(seen)
        plain += off <= 2.0
    assert inside >= 0.95 * 120
    # one figure for all does not hold
    assert plain < 0.8 * 120


def test_hardly_any_cells_give_a_flat_plane() -> None:
    plane, core = plane_of(np.array([[0.0, 0.0, 0.01]]), RADIUS_M, SUPPORT_M)
    assert np.array_equal(plane, np.zeros(3))
    assert len(core) == 1
