"""Every fault rule of a leg, once where it fires and once where it must not."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from rover_iface.errors import LocalizationError
from rover_iface.localization.leg import FaultLimits, LegFault, check_match, localise_leg
from tests.rover_iface.localization.rocks_for_tests import prior_of, seen_rock, two_ends


def faults(result):
    return {refusal.fault for refusal in result.refusals}


@pytest.fixture(scope="module")
def good():
    """A leg that is accepted: rocks of both ends, truth, prior, result."""
    first, second, truth, _ = two_ends(2, common=12)
    prior = prior_of(truth)
    return first, second, truth, prior, localise_leg(first, second, prior)


def test_a_good_leg_is_accepted_with_its_pose(good):
    *_, truth, _, result = good
    assert result.accepted
    assert faults(result) == set()
    assert "accepted" in result.verdict
    pose = result.first_from_second
    assert pose.translation[:2] == pytest.approx(truth[:2], abs=0.4)


def test_a_refused_leg_has_no_pose(good):
    first, second, _, prior, _ = good
    result = localise_leg(first[:3], second, prior)
    assert not result.accepted
    assert result.verdict.startswith("refused: ")
    with pytest.raises(LocalizationError, match="refused"):
        _ = result.first_from_second


@pytest.mark.parametrize(("length", "fires"), [(30.4, True), (29.6, False)])
def test_leg_too_long(length, fires):
    first, second, truth, _ = two_ends(4, length=length)
    result = localise_leg(first, second, prior_of(truth, (0.0, 0.0, 0.0, 0.01)))
    assert (LegFault.LEG_TOO_LONG in faults(result)) == fires


@pytest.mark.parametrize(("kept", "fires"), [(5, True), (6, False)])
def test_too_few_rocks_in_the_overlap(good, kept, fires):
    first, second, _, prior, _ = good
    beyond = [seen_rock((2.0, 22.0 + k, -1.5), 0.4, 0.6) for k in range(8)]  # seen, not in the overlap
    assert (LegFault.TOO_FEW_ROCKS in faults(localise_leg(first[:kept] + beyond, second, prior))) == fires


@pytest.mark.parametrize(("large", "fires"), [(3, True), (4, False)])
def test_too_few_significant_rocks(good, large, fires):
    first, second, _, prior, _ = good
    mixed = [replace(rock, height_m=0.3 if k < large else 0.13) for k, rock in enumerate(first)]
    assert (LegFault.TOO_FEW_SIGNIFICANT in faults(localise_leg(mixed, second, prior))) == fires


@pytest.mark.parametrize(("count", "fires"), [(3, True), (4, False)])
def test_too_few_matches(good, count, fires):
    *_, prior, result = good
    match = replace(result.match, pairs=result.match.pairs[:count])
    found = {refusal.fault for refusal in check_match(match, prior, FaultLimits())}
    assert (LegFault.TOO_FEW_MATCHES in found) == fires


def test_ambiguous_fires_where_another_pose_fits_as_well():
    # rocks of one size in an even grid, of which the second stop sees the middle: it fits one on as well
    row = [(x, y, -1.5) for x in np.arange(7.0, 20.0, 2.0) for y in (-4.0, -2.0, 0.0, 2.0, 4.0)]
    middle = [(x, y, z) for x, y, z in row if 9.5 < x < 16.5 and abs(y) < 3.0]
    truth = np.array([26.0, 0.0, 0.0, 0.0])
    first = [seen_rock(place, 0.3, 0.5) for place in row]
    second = [seen_rock(np.array(place) - truth[:3], 0.3, 0.5) for place in middle]
    result = localise_leg(first, second, prior_of(truth, (1.0, 0.9, 0.0, 0.0)))
    assert LegFault.AMBIGUOUS in faults(result)


def test_ambiguous_does_not_fire_on_a_clear_leg(good):
    *_, result = good
    assert LegFault.AMBIGUOUS not in faults(result)


@pytest.mark.parametrize(("factor", "fires"), [(12.0, True), (1.0, False)])
def test_inconsistent_geometry(good, factor, fires):
    *_, prior, result = good
    match = replace(result.match, chi2_per_pair=factor * result.match.chi2_per_pair)
    found = {refusal.fault for refusal in check_match(match, prior, FaultLimits())}
    assert (LegFault.INCONSISTENT in found) == fires


@pytest.mark.parametrize(
    ("sigma_m", "sigma_deg", "fires"), [(0.7, 0.3, True), (0.1, 2.0, True), (0.1, 0.3, False)]
)
def test_weak_geometry(good, sigma_m, sigma_deg, fires):
    *_, prior, result = good
    covariance = np.diag([sigma_m, 0.05, 0.05, math.radians(sigma_deg)]) ** 2
    found = {r.fault for r in check_match(replace(result.match, covariance=covariance), prior, FaultLimits())}
    assert (LegFault.WEAK_GEOMETRY in found) == fires


@pytest.mark.parametrize(("off_m", "fires"), [(6.0, True), (2.0, False)])
def test_far_from_odometry(good, off_m, fires):
    *_, prior, result = good
    match = replace(result.match, x_m=prior.x_m + off_m, y_m=prior.y_m, heading_rad=prior.heading_rad)
    found = {refusal.fault for refusal in check_match(match, prior, FaultLimits())}
    assert (LegFault.FAR_FROM_ODOMETRY in found) == fires


def test_messages_name_the_value_and_the_limit(good):
    first, second, _, prior, _ = good
    message = localise_leg(first[:3], second, prior).refusals[0].message
    assert message == "3 rocks of the first stop in the overlap, limit 6"


@pytest.mark.parametrize(
    ("change", "message"),
    [({"least_matches": 2}, "at least 3"), ({"largest_false_probability": 0.0}, "0, 1")],
)
def test_limits_that_protect_nothing_are_refused(change, message):
    with pytest.raises(LocalizationError, match=message):
        FaultLimits(**change)
