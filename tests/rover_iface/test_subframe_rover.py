"""The subframe rover: eyes that are rendered, ground that is true, a map that may be wrong."""

from __future__ import annotations

import json
import math
from collections.abc import Generator, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from executive.ports import Acknowledgement, Command, CommandId, Result
from rover_iface.behaviour.action import Step
from rover_iface.behaviour.hardware import Contact
from rover_iface.behaviour.mast_cameras import MastCameras
from rover_iface.behaviour.placing import HandedOff
from rover_iface.cameras.panorama import camera_from_document
from rover_iface.contract import write_contract_world
from rover_iface.errors import OutsideTerrainError, PlacementError, TrackerError, WorldError
from rover_iface.frames import Pose
from rover_iface.navigation.navigator import Way
from rover_iface.simulator.abstract_rover import make_rover as make_abstract
from rover_iface.simulator.chassis import Driven
from rover_iface.simulator.faults import Fault, FaultKind
from rover_iface.simulator.hardware import SimulatedHardware, designated
from rover_iface.simulator.subframe_rover import make_rover
from rover_iface.simulator.terrain_rover import TerrainRover
from rover_iface.telemetry import TrackState
from rover_iface.terrain import load_terrain
from rover_iface.terrain.strew import strew_rocks
from rover_iface.vision.sift import SiftTracker
from tests.rover_iface.worlds import plane, says_what_it_drew

COUNT = iter(range(10**9))


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_contract_world(tmp_path_factory.mktemp("world"))


def do(rover: TerrainRover, action: str, **parameters: Any) -> Result:
    wanted = Command(CommandId("run", f"t{next(COUNT)}", 1), action, parameters)
    rover.send(wanted)
    while True:
        event = rover.next_event(None)
        assert event is not None
        if isinstance(event, Result) and event.command == wanted.id:
            return event


@pytest.fixture(scope="module")
def day(world: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[TerrainRover, Path, list[Result]]:
    """One target tracked, approached and touched.

    Its instruments never fail: which draw is theirs depends on how many looks the drive took, and that on the
    processor's last bits.
    """
    out = tmp_path_factory.mktemp("run")
    rover = make_rover(world, seed=4, out=out)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(SimulatedHardware, "instrument_delivers", lambda *_: True)
        results = [
            do(rover, "trackstart", target="T1"),
            do(rover, "navigate", target="T1", mode="track", require_tracked=True),
            do(rover, "handoff", target="T1"),
            do(rover, "ipplaceinstrument", target="T1", dwell_s=10.0),
            do(rover, "image", target="T2", instrument="scicam"),
            do(rover, "turn", angle=0.2),
            do(rover, "heat", duration_s=60.0),
        ]
    return rover, out, results


def test_a_target_is_approached_and_touched_within_two_centimetres(
    day: tuple[TerrainRover, Path, list[Result]],
) -> None:
    _, _, (start, drive, handoff, place, *_) = day
    assert start.success, start.reason
    assert drive.success, drive.reason
    assert float(drive.values["distance_m"]) > 2.0
    assert handoff.success, handoff.reason
    assert place.values["made"] is True
    assert float(place.values["placement_error_m"]) < 0.02


def test_every_action_says_what_it_drew_from_the_battery(
    day: tuple[TerrainRover, Path, list[Result]],
) -> None:
    rover, _, results = day
    says_what_it_drew(rover, results)


def test_dead_reckoning_drifts_but_the_track_holds(day: tuple[TerrainRover, Path, list[Result]]) -> None:
    rover, _, _ = day
    _, true, believed = rover.truth.odometry[-1]
    assert 0.005 < math.hypot(true.x - believed.x, true.y - believed.y) < 0.5
    assert all(record.error_m < 0.05 for record in rover.truth.history if record.state == "tracked")
    assert len(rover.truth.history) >= 5


def test_products_carry_pose_camera_and_target(day: tuple[TerrainRover, Path, list[Result]]) -> None:
    _, out, _ = day
    labels = [json.loads(p.read_text()) for p in sorted((out / "products").glob("*.png.json"))]
    kinds = {label["kind"] for label in labels}
    assert "hazardmap" in kinds
    assert {"hazcam", "microscopic"} <= kinds
    image = next(label for label in labels if label["kind"] == "image")
    assert image["target"] == "T2"
    for kind in ("odometry", "tracking"):
        table = next((out / "products").glob(f"*-{kind}.json"))
        assert json.loads(table.read_text())


def pictures(out: Path, *kinds: str) -> list[dict[str, Any]]:
    labels = [json.loads(p.read_text()) for p in sorted((out / "products").glob("*.png.json"))]
    return [label for label in labels if label["kind"] in kinds]


def test_a_picture_shows_its_target_where_the_labels_camera_has_it(
    day: tuple[TerrainRover, Path, list[Result]],
) -> None:
    _, out, results = day
    assert all(result.success for result in results)
    labels = pictures(out, "image", "hazcam", "microscopic")
    assert {label["kind"] for label in labels} == {"image", "hazcam", "microscopic"}
    for label in labels:
        camera = camera_from_document(label["camera_model"])
        assert camera.sees(label["point_m"]), label["kind"]
        with Image.open(out / "products" / label["file"]) as picture:
            assert picture.size == (camera.width, camera.height)


def test_a_view_of_the_tracker_says_where_in_it_the_target_was_found(
    day: tuple[TerrainRover, Path, list[Result]],
) -> None:
    _, out, _ = day
    views = pictures(out, "trackview")
    assert views, "none was kept of the drive"
    for label in views:
        camera, track = camera_from_document(label["camera_model"]), label["tracker"]
        with Image.open(out / "products" / label["file"]) as picture:
            assert picture.size == (camera.width, camera.height)
        assert track["state"] == "tracked"
        assert np.linalg.norm(camera.project(track["point_m"]) - track["pixel"]) < 2.0
        corners = np.array(track["outline"])
        assert np.allclose(corners.mean(axis=0), track["pixel"])
        assert corners[2, 0] - corners[0, 0] == pytest.approx(21.0)
        assert (np.linalg.eigvalsh(track["covariance_m2"]) > 0).all()


def test_a_label_is_in_the_frame_of_dead_reckoning_and_the_truth_stands_apart(
    day: tuple[TerrainRover, Path, list[Result]],
) -> None:
    rover, out, _ = day
    for label in pictures(out, "image", "hazcam", "microscopic"):
        truth = label["simulation_truth"]
        assert label["pose"]["east_m"] == pytest.approx(rover.body.believed.x)
        assert truth["pose"]["east_m"] == pytest.approx(rover.body.pose.x)
        told, actual = (camera_from_document(part["camera_model"]) for part in (label, truth))
        # What the rover got wrong, it got wrong in the camera and the point alike.
        assert np.allclose(rover.body.true_from_believed.apply(told.C), actual.C, atol=0.02)
        if label["kind"] != "image":
            assert actual.sees(truth["point_m"])
            assert np.linalg.norm(told.project(label["point_m"]) - actual.project(truth["point_m"])) < (
                150 if label["kind"] == "microscopic" else 20
            )
            assert truth["placement_error_m"] < 0.02
            assert "placement_error_m" not in label


def test_a_target_no_longer_tracked_is_where_it_was_last_seen(world: Path) -> None:
    rover = make_rover(world, seed=4)
    do(rover, "trackstart", target="T1")
    do(rover, "navigate", target="T1", mode="track")
    seen = rover.repertoire.follower.position("T1")
    do(rover, "trackstop", target="T1")
    assert rover.repertoire.follower.position("T1") == pytest.approx(seen)
    assert rover.repertoire.follower.position("T1") != pytest.approx(rover.body.targets["T1"].point, abs=1e-4)


def test_the_sun_and_the_battery_are_told(day: tuple[TerrainRover, Path, list[Result]]) -> None:
    rover, _, _ = day
    assert 0 < float(rover.get("sun-elevation") or 0) < math.pi / 2
    assert 0 < rover.battery_j <= rover.profile.power.battery_j


def test_a_lost_target_is_told_within_two_updates_and_fails_the_drive(world: Path) -> None:
    rover = make_rover(world, seed=4, faults=[Fault(FaultKind.LOSE_TARGET, at_s=60, target="T1")])
    assert do(rover, "trackstart", target="T1").success
    drive = do(rover, "navigate", target="T1", mode="track", require_tracked=True)
    assert not drive.success
    assert drive.reason == "target T1 was lost"
    assert rover.get("trackerstate T1") == "failed"
    states = [r.state for r in rover.truth.history]
    assert states.index("lost") <= 3


def test_a_target_that_is_lost_for_good_is_not_told_as_tracked_until_it_is_stopped(world: Path) -> None:
    """A tracker that goes on by the drive and the other targets would tell so."""
    rover = make_rover(world, seed=4, faults=[Fault(FaultKind.LOSE_TARGET, at_s=25, target="T1")])
    assert do(rover, "trackstart", target="T1").success
    do(rover, "navigate", x=2.0, y=0.0, mode="blind")
    rover.hardware.set("trackerstate T1", "tracked")
    rover.hardware.set("trackerconfidence T1", 0.75)
    assert rover.get("trackerstate T1") == "lost"
    assert float(rover.get("trackerconfidence T1") or 0.0) <= 0.1
    known = rover.repertoire.follower.followed["T1"]
    rover.repertoire.follower.tell(known, replace(known.update, state=TrackState.TRACKED), None)
    assert rover.truth.history[-1].state == "lost"
    assert do(rover, "trackstop", target="T1").success
    rover.hardware.set("trackerstate T1", "tracked")
    assert rover.get("trackerstate T1") == "tracked"


def test_a_sudden_change_of_light_is_not_taken_for_the_target(world: Path) -> None:
    rover = make_rover(world, seed=4, faults=[Fault(FaultKind.SHADOW, at_s=60, target="T1")])
    do(rover, "trackstart", target="T1")
    do(rover, "navigate", target="T1", mode="track")
    for record in rover.truth.history:
        assert record.state != "tracked" or record.error_m < 0.05


def test_a_target_behind_the_mast_is_no_miss_and_where_the_drive_has_it(world: Path) -> None:
    """It stayed where it was last seen, told as known as well as then, 18 cm off; after three it was lost."""
    rover = make_rover(world, seed=4)
    assert do(rover, "trackstart", target="T1").success
    x, y = rover.body.targets["T1"].point[:2]
    away = math.hypot(x, y)
    do(rover, "navigate", x=-0.3 * x / away, y=-0.3 * y / away, mode="blind")
    do(rover, "turn", heading=math.atan2(-y, -x))
    follower = rover.repertoire.follower
    for _ in range(4):
        follower.map.move(rover.hardware.believed)
        follower._follow(follower.followed["T1"])
        assert "the limit is 3.050" in rover.truth.history[-1].reasons[0]
        assert rover.truth.history[-1].state == "tracked"
    known, (place, covariance) = follower.followed["T1"].update, follower.map.place("T1")
    assert known.position == pytest.approx(place)
    assert known.covariance == pytest.approx(covariance)
    # nothing is put on what is not seen from here
    with pytest.raises(TrackerError, match=r"out of sight: .* the limit is 3.050"):
        follower.in_sight("T1")
    # nor is the rover taken to be lost, though it sees nothing of what it followed
    for _ in follower.update_all():
        pass
    assert not follower.pose_lost


def test_faults_of_the_body_and_the_camera(world: Path) -> None:
    stuck = make_rover(world, seed=1, faults=[Fault(FaultKind.STUCK_WHEEL, at_s=0)])
    assert do(stuck, "navigate", x=2.0, y=0.0, mode="blind").reason == "wheel stuck"
    blind = make_rover(world, seed=1, faults=[Fault(FaultKind.CAMERA_FAILURE, at_s=0)])
    assert do(blind, "trackstart", target="T1").reason == "camera failed"
    slow = make_rover(world, seed=1, faults=[Fault(FaultKind.SLOW_DRIVE, at_s=0, amount=3.0)])
    plain = make_rover(world, seed=1)
    drives = [do(r, "navigate", x=2.0, y=0.0, mode="blind").t_ms for r in (slow, plain)]
    assert drives[0] == pytest.approx(3 * drives[1], rel=0.05)
    slip = make_rover(world, seed=1, faults=[Fault(FaultKind.SLIP_BURST, at_s=0, amount=2.0)])
    do(slip, "navigate", x=2.0, y=0.0, mode="blind")
    assert slip.body.pose.x < 1.4


@pytest.mark.parametrize(
    ("touches_from", "touches", "reason", "backed"),
    [(1.7, 1, "", 1), (1.7, 2, "", 2), (1.7, 99, "hazard: belly", 4), (0.0, 1, "hazard: belly", 0)],
    ids=["once, near the goal", "still in touch at first", "again and again", "far from the goal"],
)
def test_what_a_rover_touches_in_the_last_metre_it_backs_off(
    world: Path,
    monkeypatch: pytest.MonkeyPatch,
    touches_from: float,
    touches: int,
    reason: str,
    backed: int,
) -> None:
    rover = make_rover(world, seed=1)
    follow, ways, touched = rover.body.chassis.follow, list[Way](), list[Way]()

    def touching(way: Way) -> Driven:
        ways.append(way)
        driven = follow(way)
        if rover.body.believed.x > touches_from and len(touched) < touches:
            touched.append(way)
            return replace(driven, collision="belly")
        return driven

    monkeypatch.setattr(rover.body.chassis, "follow", touching)
    answer = do(rover, "navigate", x=2.0, y=0.0, mode="blind")
    assert answer.reason == reason
    assert sum(way.length_m < 0 for way in ways) == backed
    if not reason:
        assert float(answer.values["error_m"]) <= 0.35


def test_a_rover_that_is_led_off_again_beside_its_goal_has_arrived(
    world: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rover = make_rover(world, seed=1)
    places = iter([(1.0, 0.0), (1.8, 0.0), (1.75, 0.1), (0.5, 0.0), (0.0, 0.0)])

    def led(way: Way) -> Driven:
        x, y = next(places)
        body = rover.body.chassis
        body.believed = replace(body.believed, x=x, y=y)
        return Driven(10.0, 10.0, 0.5, "", False, 1.0, ())

    monkeypatch.setattr(rover.body.chassis, "follow", led)
    target = rover.body.targets["T1"]
    stand = replace(target, point=(2.5, 0.0, 0.2), observation_point=Pose(2.0, 0.0))
    rover.body.targets["T1"] = stand
    answer = do(rover, "navigate", target="T1", mode="blind")
    assert answer.reason == ""
    assert float(answer.values["error_m"]) == pytest.approx(math.hypot(0.25, 0.1), abs=0.01)


def test_an_abort_during_a_drive_is_acknowledged(world: Path) -> None:
    rover = make_rover(world, seed=1)
    drive = Command(CommandId("run", "d", 1), "navigate", {"x": 5.0, "y": 3.0, "mode": "avoid"})
    rover.send(drive)
    while rover.next_event(100_000) is not None:
        pass
    rover.abort(drive.id)
    event = rover.next_event(100_000)
    assert isinstance(event, Acknowledgement)
    assert event.t_ms == 100_000


def test_the_true_world_has_rocks_the_map_has_not(world: Path) -> None:
    document = json.loads((world / "world.json").read_text())
    document["map_error"] = {"unmapped_rocks_per_m2": 0.1, "softer": 1.3}
    terrain = load_terrain(world / "terrain")
    rover = make_rover(document, terrain=terrain, seed=2)
    extra = [rock for rock in rover.body.terrain.rocks if rock.id.startswith("U")]
    assert len(extra) > 10
    assert len(terrain.rocks) == 2
    big = max(extra, key=lambda rock: rock.height)
    assert (
        float(rover.body.terrain.height(big.x, big.y))
        > float(terrain.height(big.x, big.y)) + 0.5 * big.height
    )
    for target in rover.body.targets.values():
        assert all(math.hypot(r.x - target.point[0], r.y - target.point[1]) > 0.6 for r in extra)


def test_another_tracker_is_asked_for_by_name(world: Path) -> None:
    document = json.loads((world / "world.json").read_text())
    terrain = load_terrain(world / "terrain")
    rover = make_rover({**document, "tracker": "sift"}, terrain=terrain, seed=4)
    assert isinstance(rover.repertoire.follower.tracker, SiftTracker)
    with pytest.raises(TrackerError, match='unknown tracker "hound"; known are klt, ncc'):
        make_rover(world, tracker="hound")
    with pytest.raises(WorldError, match="has no tracker"):
        make_abstract(world, tracker="ncc")


def test_a_target_that_was_refused_is_not_followed_to_the_next_one(
    world: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a day of five targets 30 of 220 looks were at one that nothing would be placed on any more."""
    rover = make_rover(world, seed=4)
    follower, placing = rover.repertoire.follower, rover.repertoire.placing
    assert do(rover, "trackstart", target="T1").success

    def refuses(*_: object) -> Contact:
        raise PlacementError("the tool would stand 53 degrees or more off the surface normal")

    def stays(*_: object, **__: object) -> Generator[Step, None, bool]:
        yield from ()
        return False

    monkeypatch.setattr(rover.hardware, "reach", refuses)
    monkeypatch.setattr(placing.moves, "nearer", stays)
    known = replace(follower.followed["T1"].update, covariance=1e-8 * np.eye(3))
    monkeypatch.setattr(placing.handoff, "at_this_stop", lambda followed: HandedOff(known, 0.1))
    assert "53 degrees" in do(rover, "ipplaceinstrument", target="T1").reason
    # a move of the base would still need it
    assert "T1" in follower.followed
    looks = len(rover.truth.history)
    assert do(rover, "navigate", x=0.6, y=-0.2).success
    assert rover.get("trackerstate T1") == "idle"
    assert len(rover.truth.history) == looks


def test_the_ground_reaches_as_far_as_a_rover_is_led_round_rocks(world: Path) -> None:
    """Drives ended at the edge of the ground, 6 m beyond the farthest target."""
    document = json.loads((world / "world.json").read_text())
    rover = make_rover(document, terrain=plane(half=40.0, spacing=0.5), seed=1)
    far = max(abs(v) for t in rover.body.targets.values() for v in t.point[:2])
    beyond = max(12.0, far + 6.0) + 5.0
    for x, y in ((beyond, 0.0), (0.0, -beyond), (-beyond, beyond)):
        assert np.isfinite(rover.body.ground.height(x, y))


def test_rocks_can_be_strewn_on_any_ground() -> None:
    bare = plane(0.05, 0.0)
    rocky = strew_rocks(bare, seed=1, half_m=9.0, total_cover=0.08, keep_clear=[(0, 0, 2.0)])
    assert len(rocky.rocks) > 20
    assert all(math.hypot(r.x, r.y) > 2.0 for r in rocky.rocks)
    x, y = np.array([[r.x, r.y] for r in rocky.rocks[:20]]).T
    assert (rocky.height(x, y) >= bare.height(x, y) - 1e-6).all()
    assert np.allclose(rocky.height(x, y, ground=True), bare.height(x, y), atol=1e-5)


def test_impossible_worlds_are_refused(world: Path) -> None:
    document = json.loads((world / "world.json").read_text())
    with pytest.raises(OutsideTerrainError, match="start of the rover"):
        make_rover(
            {**document, "start": {"east_m": 99, "north_m": 0}}, terrain=load_terrain(world / "terrain")
        )
    with pytest.raises(WorldError, match="has no terrain"):
        make_rover({k: v for k, v in document.items() if k != "terrain"})


@pytest.mark.parametrize(("ahead", "left", "turn"), [(0.3, 0.1, 0.2), (-0.2, 0.05, -0.3), (0.0, 0.0, 0.4)])
def test_a_shift_ends_near_the_pose_asked_for(world: Path, ahead: float, left: float, turn: float) -> None:
    rover = make_rover(world, seed=1)
    begin = rover.body.believed
    c, s = math.cos(begin.heading), math.sin(begin.heading)
    wanted = Pose(
        begin.x + c * ahead - s * left, begin.y + s * ahead + c * left, heading=begin.heading + turn
    )
    troubles: list[str] = []

    def moving() -> Iterator[object]:
        troubles.append((yield from rover.repertoire.driving.shift(wanted)))

    assert len(list(moving())) >= 1
    assert troubles == [""]
    here = rover.body.believed
    assert math.hypot(here.x - wanted.x, here.y - wanted.y) < 0.02
    assert abs(here.heading - wanted.heading) < 0.05
    assert math.hypot(ahead, left) == pytest.approx(rover.body.chassis.travelled_m, abs=0.05)


def test_a_point_designated_in_a_picture_is_where_later_pictures_show_it(
    world: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rover = make_rover(world, seed=1)
    cameras, point = MastCameras(rover.hardware), np.array(rover.body.targets["T1"].point)
    bias = np.array((0.012, -0.007))
    monkeypatch.setattr(rover.hardware, "_bias", bias)
    monkeypatch.setattr(rover.hardware, "_jitter", lambda: bias)

    def off_px(position: np.ndarray) -> float:
        """Return how far the pixel that a position is looked for at is from that which shows the point."""
        sighting = cameras.stereo(position)
        told = sighting.view.left_camera.project(position)
        actual = rover.truth.camera(sighting.left.number).project(point)
        return float(np.linalg.norm(told - actual))

    assert off_px(point) > 5.0
    assert off_px(designated(rover.body, bias, point)) < 0.5


def test_a_hand_off_that_track_and_mast_contradict_is_refused(
    world: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One was 25 mm off along the line of sight, its track 6 mm (149562680 T3); 20 right ones, 10 at most."""
    rover = make_rover(world, seed=4)
    assert do(rover, "trackstart", target="T1").success
    followed = rover.repertoire.follower.followed["T1"]
    handoff: Any = rover.repertoire.placing.handoff
    track = followed.update = replace(followed.update, covariance=0.003**2 * np.eye(3))
    ray = track.position - followed.view.left_camera.C
    along = ray / np.linalg.norm(ray)
    aside = np.array([-along[1], along[0], 0.0])

    def handed(off: np.ndarray) -> Any:
        seen = replace(
            track, position=track.position + off, covariance=track.covariance + 0.002**2 * np.eye(3)
        )
        monkeypatch.setattr(handoff.eyes, "at_this_stop", lambda _followed: HandedOff(seen, 1.0))
        return handoff.at_this_stop(followed)

    for off in (0.01 * aside, 0.01 * along):
        assert handed(off).update.position == pytest.approx(track.position + off)
    with pytest.raises(TrackerError, match=r"2\.5 cm from where track and mast have it"):
        handed(0.025 * along)
