"""Small pieces of a disparity map hang on to nothing: chance matches."""

from __future__ import annotations

import numpy as np

from rover_iface.reconstruction.pair_surface import lone_pieces


def test_a_small_piece_that_stands_off_its_surroundings_is_dropped_and_nothing_else() -> None:
    ground = np.tile(np.linspace(40.0, 60.0, 100)[:, None], (1, 120))  # a fifth of a pixel from line to line
    ground[:, 90:] = np.nan
    island = np.zeros(ground.shape, dtype=bool)
    island[30:40, 20:30] = True
    ground[island] = 25.0
    alone = np.zeros(ground.shape, dtype=bool)
    alone[50:55, 100:110] = True
    ground[alone] = 50.0
    assert np.array_equal(lone_pieces(ground, 1.0, 200), island | alone)
    # as large as is asked for it stays
    assert np.array_equal(lone_pieces(ground, 1.0, 100), alone)


def test_a_rock_that_joins_the_ground_is_no_piece_of_its_own() -> None:
    ground = np.full((60, 60), 40.0)
    steps = np.abs(np.arange(60) - 30)[:, None] + np.abs(np.arange(60) - 30)[None]
    rock = np.maximum(0.0, 6.0 - 0.8 * steps)
    assert not lone_pieces(ground + rock, 1.0, 400).any()
