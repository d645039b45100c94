"""Frames as seen from an anchor: the same as chaining by hand, with a covariance that draws bear out."""

from __future__ import annotations

import numpy as np
import pytest

from rover_iface.errors import LocalizationError
from rover_iface.frames import Transform, rotation_rpy
from rover_iface.localization.anchored_chain import AnchoredChain, Link
from rover_iface.localization.site_frames import LANDING, SiteFrames, read_frame_file, site
from tests.shared import shared

SPREAD = np.diag([0.002, 0.003, 0.01, 0.2, 0.3, 0.1]) ** 2


def pose(seed):
    rng = np.random.default_rng(seed)
    return Transform(rotation_rpy(*rng.normal(0, 0.3, 3)), rng.normal(0, 20.0, 3))


def links(covariance=SPREAD):
    """Two arms from the landing site: 1 and 2 in it, 3 in 2, 4 in 3."""
    return {
        site(1): Link(LANDING, pose(1), covariance),
        site(2): Link(LANDING, pose(2), covariance),
        site(3): Link(site(2), pose(3), covariance),
        site(4): Link(site(3), pose(4), covariance),
    }


def test_138_sites_from_any_anchor_are_as_the_mission_chains_them():
    file = read_frame_file(shared("data/terrain/mer_spirit/mer2_master.svf"))
    frames = SiteFrames.of([file])
    made = {s.frame: Link(s.reference, s.reference_from_frame) for s in map(frames.in_use, frames.frames)}
    for anchor in (LANDING, site(60), site(137)):
        chain = AnchoredChain(made, anchor)
        for k in (0, 1, 59, 60, 61, 138):
            expected = frames.transform(anchor, site(k))
            found = chain.placed(site(k))
            assert found.anchor_from_frame.translation == pytest.approx(expected.translation, abs=1e-8)
            assert found.unknown == abs(k - anchor.counter[0])


@pytest.mark.parametrize(
    ("anchor", "frame"), [(LANDING, site(4)), (site(3), site(1)), (site(4), LANDING), (site(1), site(1))]
)
def test_the_covariance_of_a_point_is_that_of_many_draws(anchor, frame):
    from gtsam import Pose3

    rng = np.random.default_rng(7)
    point = np.array([4.0, -3.0, 1.0])
    given = links()
    drawn = []
    for _ in range(500):
        shaken = {}
        for name, link in given.items():
            small = Pose3.Expmap(rng.multivariate_normal(np.zeros(6), SPREAD))
            off = Transform(small.rotation().matrix(), small.translation())
            shaken[name] = Link(link.reference, link.reference_from_frame * off)
        drawn.append(AnchoredChain(shaken, anchor).placed(frame).point(point)[0])
    middle, spread = AnchoredChain(given, anchor).placed(frame).point(point)
    if anchor == frame:
        assert np.ptp(drawn, axis=0) == pytest.approx([0, 0, 0], abs=1e-9)
        assert np.abs(spread).max() < 1e-12
        return
    found = np.cov(np.transpose(drawn))
    assert np.mean(drawn, axis=0) == pytest.approx(middle, abs=0.15)
    assert np.trace(found) == pytest.approx(np.trace(spread), rel=0.2)
    assert np.linalg.norm(found - spread) < 0.25 * np.linalg.norm(spread)


def test_the_shared_part_of_two_ways_counts_once_and_a_points_own_spread_comes_on_top():
    chain = AnchoredChain(links(), site(4))
    near = chain.placed(site(3)).point(np.zeros(3))[1]
    far = chain.placed(site(1)).point(np.zeros(3))[1]
    assert np.trace(near) < np.trace(far)
    own = np.diag([0.5, 0.1, 0.2])
    _, both = chain.placed(site(3)).point(np.zeros(3), own)
    assert np.trace(both) == pytest.approx(np.trace(near) + 0.8)


def test_what_hangs_nowhere_or_in_a_circle_is_named():
    made = links()
    with pytest.raises(LocalizationError, match=r"ties SITE_FRAME \(9,\) to SITE_FRAME \(4,\)"):
        AnchoredChain(made, site(4)).placed(site(9))
    made[LANDING] = Link(site(4), pose(9))
    with pytest.raises(LocalizationError, match="refers back to itself"):
        AnchoredChain(made, site(4))
    with pytest.raises(LocalizationError, match="refers back to itself"):
        AnchoredChain(made, site(7)).placed(site(2))


@pytest.mark.parametrize("wrong", [np.eye(3), np.full((6, 6), np.nan), np.triu(np.ones((6, 6))), -np.eye(6)])
def test_a_covariance_that_is_none_is_refused(wrong):
    with pytest.raises(LocalizationError, match="covariance of a link"):
        Link(LANDING, pose(1), wrong)
