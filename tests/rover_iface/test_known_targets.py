"""What the arm may be put on: targets that are known well enough, surfaces that are there."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rover_iface.behaviour import hazard_eyes
from rover_iface.behaviour.following import Followed
from rover_iface.behaviour.hardware import Contact
from rover_iface.behaviour.placing import HandedOff, across_m, require_known
from rover_iface.behaviour.target import DesignatedTarget
from rover_iface.cameras.model import Array
from rover_iface.contract import write_contract_world
from rover_iface.errors import TrackerError
from rover_iface.simulator.subframe_rover import make_rover
from rover_iface.simulator.terrain_rover import TerrainRover
from rover_iface.vision.tracker import TrackState, TrackUpdate
from tests.rover_iface.test_subframe_rover import do
from tests.rover_iface.worlds import says_what_it_drew


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_contract_world(tmp_path_factory.mktemp("world"))


def arrived(world: Path) -> TerrainRover:
    """Return a rover that stands at its target and tracks it."""
    rover = make_rover(world, seed=4)
    assert do(rover, "trackstart", target="T1").success
    assert do(rover, "navigate", target="T1", mode="track", require_tracked=True).success
    return rover


def test_a_target_known_too_poorly_is_refused_with_its_figure(world: Path) -> None:
    rover = arrived(world)
    followed = rover.repertoire.follower.followed["T1"]
    followed.update = replace(followed.update, covariance=0.02**2 * np.eye(3))
    # the moves that are tried look again: they must not tell more than they see
    tracker = rover.repertoire.follower.tracker
    honest = tracker.update
    tracker.update = lambda *a: replace(honest(*a), covariance=0.02**2 * np.eye(3))  # type: ignore[method-assign]
    told = do(rover, "ipplaceinstrument", target="T1")
    assert not told.success
    assert told.values["made"] is False
    known = re.search(r"is known to (\d\.\d) cm on its surface \(95 %\); 2 cm is the limit", told.reason)
    # 5.5 cm, and what the surface is deep within that
    assert known is not None
    assert 5.5 <= float(known[1]) < 9.0
    assert "T1" not in rover.truth.touched


@pytest.mark.parametrize(("sigma_m", "refused"), [(0.0076, True), (0.0065, False)])
def test_what_is_touched_beside_a_target_lies_deeper_by_the_relief_of_rock(
    sigma_m: float, refused: bool
) -> None:
    """A track told to 1.8 cm was 0.9 cm off across a step: the tool touched 2.3 cm from its target."""
    update = TrackUpdate("T1", TrackState.TRACKED, np.zeros(3), sigma_m**2 * np.eye(3), 1.0, np.zeros(2))
    followed = Followed(DesignatedTarget("T1", (0.0, 0.0, 0.0)), update, None)  # type: ignore[arg-type]
    assert across_m(update.covariance, (0.0, 0.0, 1.0), 0.0) < 0.02
    if refused:
        with pytest.raises(TrackerError, match=r"known to 2\.1 cm on its surface"):
            require_known(followed, 0.0)
    else:
        require_known(followed, 0.0)


def test_what_is_off_along_the_normal_is_the_contacts_to_find() -> None:
    deep = np.diag([1e-6, 1e-6, 1.0])
    assert across_m(deep, (0.0, 0.0, 1.0), 0.0) == pytest.approx(1e-3 * math.sqrt(5.991))
    assert across_m(deep, (1.0, 0.0, 0.0), 0.0) == pytest.approx(math.sqrt(5.991))


@pytest.mark.parametrize(
    ("up_m", "reason"), [(0.05, "no contact within 20 mm"), (-0.05, "before the expected")]
)
def test_a_tool_that_meets_no_surface_where_it_should_claims_nothing(
    world: Path, up_m: float, reason: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    rover = arrived(world)
    followed = rover.repertoire.follower.followed["T1"]
    normal = np.array(followed.target.normal)
    # the hazcams would find the target where it is
    monkeypatch.setattr(rover.repertoire.placing.handoff, "at_this_stop", lambda f: HandedOff(f.update, 1.0))
    followed.update = replace(followed.update, position=followed.update.position + up_m * normal)
    told = do(rover, "ipplaceinstrument", target="T1")
    assert not told.success
    assert told.values["made"] is False
    assert reason in told.reason
    assert "T1" not in rover.truth.touched


@pytest.mark.parametrize(("deeper_m", "made"), [(0.024, False), (0.008, True)])
def test_a_tool_whose_surface_lies_beside_the_target_claims_nothing(
    world: Path, deeper_m: float, made: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At an edge a target known to 2 mm was claimed, with the surface under the tool 2.4 cm from it."""
    rover = arrived(world)
    touch = rover.hardware.reach

    def at_an_edge(target: str, point: Array, instrument: str) -> Contact:
        contact = touch(target, point, instrument)
        assert contact.made
        return replace(contact, point=point - np.array((0.0, 0.0, deeper_m)))

    monkeypatch.setattr(rover.hardware, "reach", at_an_edge)
    told = do(rover, "ipplaceinstrument", target="T1")
    assert told.values["made"] is made
    assert made or told.reason == (
        "target T1: the surface under the tool lies 2.4 cm from the target; 1.5 cm is the limit"
    )


def test_a_target_behind_the_mast_is_turned_to_before_it_is_tracked(world: Path) -> None:
    rover = make_rover(world, seed=4)
    x, y = rover.repertoire.follower.position("T1")[:2]
    here = rover.hardware.believed
    away = math.atan2(y - here.y, x - here.x) + math.pi
    assert do(rover, "turn", heading=math.remainder(away, math.tau)).success
    told = do(rover, "trackstart", target="T1")
    assert told.success, told.reason
    assert abs(math.remainder(rover.hardware.believed.heading - away, math.tau)) > 0.2


@pytest.mark.parametrize("action", ["image", "pointmast"])
def test_a_rover_turns_to_what_its_mast_cannot_look_at(world: Path, action: str) -> None:
    rover = make_rover(world, seed=4)
    x, y = rover.repertoire.follower.position("T1")[:2]
    here = rover.hardware.believed
    away = math.remainder(math.atan2(y - here.y, x - here.x) + math.pi, math.tau)
    results = [do(rover, "turn", heading=away)]
    for at in ({"target": "T1"}, {"azimuth": away + math.pi, "elevation": -0.2}):
        results.append(do(rover, action, **at))
        assert results[-1].success, results[-1].reason
        pan = float(results[-1].values.get("pan", 0.0))
        assert abs(pan) <= rover.hardware.profile.mast.pan_limit_rad
        assert abs(math.remainder(rover.hardware.believed.heading - away, math.tau)) > 0.2
        results.append(do(rover, "turn", heading=away))
    says_what_it_drew(rover, results)


def test_the_hazcams_take_out_what_the_mast_is_off(world: Path) -> None:
    rover = arrived(world)
    followed = rover.repertoire.follower.followed["T1"]
    handed = rover.repertoire.placing.handoff.at_this_stop(followed).update
    true = rover.truth.point("T1")
    told, seen = (rover.body.true_from_believed.apply(u.position) - true for u in (followed.update, handed))
    assert np.linalg.norm(seen) < min(0.005, float(np.linalg.norm(told)))
    # which spot is meant is known no better than before
    assert np.linalg.eigvalsh(handed.covariance - followed.update.covariance)[0] >= 0.0


def test_the_depth_of_a_surface_within_a_pixel_is_that_of_the_picture_that_ranges_it(
    world: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A crest seen from the mast is ranged anew by the hazcams; one that they see is open in their range."""
    rover = arrived(world)
    followed = rover.repertoire.follower.followed["T1"]
    eyes = rover.repertoire.placing.handoff.eyes
    sight = followed.update.position - followed.view.left_camera.C
    deep = 0.03**2 * np.outer(sight, sight) / float(sight @ sight)

    def worst_m(deep_m: float) -> float:
        update = replace(followed.update, covariance=0.002**2 * np.eye(3) + deep, deep_m=deep_m)
        handed = eyes.hand_off(replace(followed, update=update), "").update
        assert handed.deep_m == 0.0
        return math.sqrt(float(np.linalg.eigvalsh(handed.covariance)[-1]))

    assert worst_m(0.03) < 0.01 < 0.03 < worst_m(0.0)
    monkeypatch.setattr(hazard_eyes, "open_depth_m", lambda *_: 0.02)
    assert 0.02 < worst_m(0.03) < 0.022
    # one that is plain to them may be a crest for the mast, whose pixel says which spot of it was meant
    monkeypatch.setattr(hazard_eyes, "open_depth_m", lambda *_: 0.0)
    plain_m = worst_m(0.03)
    monkeypatch.setattr(hazard_eyes, "open_along_m", lambda *_: 0.03)
    assert plain_m + 0.005 < worst_m(0.03) < 0.03


def test_where_the_hazcams_tell_nothing_the_error_of_the_mast_is_told(
    world: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rover = arrived(world)
    followed = rover.repertoire.follower.followed["T1"]
    handoff = rover.repertoire.placing.handoff

    def refused(_: Followed) -> HandedOff:
        raise TrackerError("hand-off of target T1 refused: 3 patches agree; 12 are needed")

    monkeypatch.setattr(handoff.eyes, "at_this_stop", refused)
    handed = handoff.at_this_stop(followed).update
    assert handed.position == pytest.approx(followed.update.position)
    mast = rover.hardware.profile.mast
    away = float(np.linalg.norm(handed.position - followed.view.left_camera.C))
    more = np.linalg.eigvalsh(handed.covariance - followed.update.covariance)
    assert more[1:] == pytest.approx(2 * [(mast.bias_rad**2 + mast.noise_rad**2) * away**2])
    assert more[0] == pytest.approx(0.0, abs=1e-9)
