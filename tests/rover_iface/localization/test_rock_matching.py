"""Rock matching: right pairs and pose among rocks seen from one end only; the published scheme beside it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from rover_iface.errors import LocalizationError
from rover_iface.localization.rock_matching import LegPrior, match_rocks, overlapping
from studies.common.published_matching import (
    PublishedOptions,
    match_as_published,
    size_difference,
)
from tests.rover_iface.localization.rocks_for_tests import prior_of, seen_rock, two_ends


def test_rocks_seen_from_opposite_sides_are_matched_and_the_pose_is_within_its_covariance():
    right = wrong = 0
    nees = []
    for seed in range(8):
        first, second, truth, same = two_ends(seed)
        match = match_rocks(first, second, prior_of(truth))
        pairs = {(p.first, p.second) for p in match.pairs}
        right, wrong = right + len(pairs & same), wrong + len(pairs - same)
        off = np.array([match.x_m, match.y_m, match.z_m, match.heading_rad]) - truth
        nees.append(float(off @ np.linalg.solve(match.covariance, off)))
        assert match.false_probability < 0.01
    assert right >= 0.8 * 80
    assert right / (right + wrong) >= 0.95
    assert np.mean(nees) < 8.0  # 4 expected


def test_pairs_are_one_to_one_and_say_how_probable_they_are():
    first, second, truth, _ = two_ends(3)
    pairs = match_rocks(first, second, prior_of(truth)).pairs
    assert len({p.first for p in pairs}) == len({p.second for p in pairs}) == len(pairs)
    assert all(0.9 < p.probability <= 1.0 for p in pairs)


def test_fields_with_nothing_in_common_are_called_probably_false():
    doubtful = 0
    for seed in range(6):
        first, _, truth, _ = two_ends(seed)
        _, second, _, _ = two_ends(seed + 100)
        match = match_rocks(first, second, prior_of(truth))
        doubtful += match.false_probability > 0.01 or len(match.pairs) < 4
    assert doubtful == 6


def test_without_two_rocks_nothing_is_matched():
    first, second, truth, _ = two_ends(1)
    match = match_rocks(first[:1], second, prior_of(truth))
    assert match.pairs == ()
    assert match.false_probability == 1.0


def test_only_rocks_within_reach_of_both_stops_count():
    rocks = [seen_rock((10.0, 0.0, -1.5), 0.3, 0.5), seen_rock((1.0, 20.0, -1.5), 0.3, 0.5)]
    assert overlapping(rocks, np.array([26.0, 0.0, 0.0]), 24.0).tolist() == [0]


def test_published_difference_of_sizes_has_its_weights():
    one = seen_rock((10.0, 0.0, -1.5), 0.4, 0.6)
    assert size_difference(one, one) == 0.0
    assert (
        size_difference(one, replace(one, height_m=0.2)) >= 0.25
    )  # half of the relative difference, and area


def test_published_scheme_finds_pairs_without_a_heading_error_and_fewer_with_one():
    found = {0.0: 0, 0.08: 0}
    for error in found:
        for seed in range(5):
            first, second, truth, same = two_ends(seed, noise=0.5)
            pairs = set(match_as_published(first, second, prior_of(truth, (0.5, -0.4, 0.1, error))))
            found[error] += len(pairs & same)
    assert found[0.0] >= 20
    assert found[0.08] < found[0.0]


def test_published_scheme_with_headings_bears_a_heading_error():
    turns = tuple(np.radians(np.arange(-6, 7, 1.0)))
    right = {False: 0, True: 0}
    for seed in range(4):
        first, second, truth, same = two_ends(seed, noise=0.5)
        prior = prior_of(truth, (0.5, -0.4, 0.1, 0.085))
        for turned in right:
            options = PublishedOptions(turns_rad=turns if turned else (0.0,))
            right[turned] += len(set(match_as_published(first, second, prior, options)) & same)
    assert right[True] >= right[False]


def test_nothing_in_the_overlap_gives_no_published_pairs():
    first, _, truth, _ = two_ends(1)
    assert match_as_published(first, [], prior_of(truth)) == []


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"x_m": math.nan}, "not finite"),
        ({"sigma_m": 0.0}, "must be positive"),
        ({"sigma_heading_rad": -1.0}, "must be positive"),
    ],
)
def test_a_prior_that_says_nothing_is_refused(change, message):
    values = {"x_m": 26.0, "y_m": 0.0, "z_m": 0.0, "heading_rad": 0.0} | change
    with pytest.raises(LocalizationError, match=message):
        LegPrior(**values)
