"""The full rover, everything in the loop: one target from the start to contact, and its parts."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from executive.ports import Command, CommandId, Product, Result
from rover_iface.behaviour.repertoire import FullRepertoire
from rover_iface.contract import write_contract_world
from rover_iface.frames import Pose
from rover_iface.profile import load_profile
from rover_iface.registry import find_rover
from rover_iface.simulator.faults import Fault, FaultKind
from rover_iface.simulator.own_shadow import OwnShadow, ShadowedScene
from rover_iface.simulator.render.renderer import Sun
from rover_iface.simulator.render.scene import Material, Scene, SceneMesh
from rover_iface.simulator.terrain_rover import TerrainRover

pytestmark = pytest.mark.slow


@dataclass
class Story:
    """What a rover was told and what came back."""

    rover: TerrainRover
    out: Path
    results: dict[str, Result] = field(default_factory=dict)
    products: list[Product] = field(default_factory=list)

    @property
    def own(self) -> FullRepertoire:
        assert isinstance(self.rover.repertoire, FullRepertoire)
        return self.rover.repertoire

    def do(self, action: str, name: str = "", **parameters: Any) -> Result:
        command = Command(CommandId("story", name or action, 1), action, parameters)
        self.rover.send(command)
        while True:
            event = self.rover.next_event(None)
            assert event is not None
            if isinstance(event, Product):
                self.products.append(event)
            if isinstance(event, Result) and event.command == command.id:
                self.results[name or action] = event
                return event

    def label(self, kind: str) -> dict[str, Any]:
        product = next(p for p in reversed(self.products) if p.kind == kind)
        found: dict[str, Any] = json.loads((self.out / f"{product.path}.json").read_text(encoding="utf-8"))
        return found


@pytest.fixture(scope="module")
def story(tmp_path_factory: pytest.TempPathFactory) -> Story:
    """A target 2.4 m ahead, tracked, approached and touched; then again with dust on a lens."""
    world = write_contract_world(tmp_path_factory.mktemp("world"))
    document = json.loads((world / "world.json").read_text(encoding="utf-8"))
    document["start"] = {"east_m": 1.5, "north_m": 0.25, "heading_rad": 0.1}
    (world / "world.json").write_text(json.dumps(document), encoding="utf-8")
    out = tmp_path_factory.mktemp("run")
    # with seed 5 a millimetre of the rock's outline decides, which differs between processors
    rover = find_rover("full")(world, out=out, seed=7)
    assert isinstance(rover, TerrainRover)
    told = Story(rover, out)
    told.do("trackstart", target="T1")
    told.do("navigate", target="T1", mode="track", require_tracked=True)
    told.do("handoff", target="T1", method="cascade")
    told.do("ipplaceinstrument", target="T1", instrument="mi", dwell_s=10.0)
    return told


def test_a_target_is_driven_to_and_touched_within_two_centimetres(story: Story) -> None:
    assert {k: r.reason for k, r in story.results.items() if not r.success} == {}
    placed = story.results["ipplaceinstrument"].values
    assert placed["made"] is True
    assert float(placed["placement_error_m"]) <= 0.02
    attempt = story.own.placing.attempts["T1"]
    assert attempt.touch is not None
    assert attempt.touch.made
    truth = story.rover.truth.point("T1")
    touched = story.rover.truth.touched["T1"]
    assert np.linalg.norm(touched - truth) == pytest.approx(placed["placement_error_m"])
    believed = story.rover.body.true_from_believed.apply(attempt.touch.point)
    assert np.allclose(believed, touched)


def test_the_masts_cloud_is_laid_on_the_hazcams(story: Story) -> None:
    laid = story.own.placing.attempts["T1"].laid
    assert laid is not None
    assert laid.believed()
    assert laid.residual_m < 0.006
    assert laid.overlap > 0.7


def test_the_narrow_pair_has_looked_at_the_place_before_the_tool_touches(story: Story) -> None:
    attempt = story.own.placing.attempts["T1"]
    assert attempt.looks
    seen = attempt.looks[0]
    assert seen is not None
    # what it ranged lies on the true ground round the place that was touched
    assert attempt.verdict.point is not None
    near = seen.points[np.linalg.norm(seen.points - attempt.verdict.point, axis=1) < 0.03]
    assert len(near) > 200
    site = story.rover.body.true_from_believed.apply(story.rover.body.believed.site_from_rover.apply(near))
    down = np.broadcast_to((0.0, 0.0, -1.0), site.shape)
    above = site + np.array([0.0, 0.0, 0.2])
    off = 0.2 - story.rover.body.renderer.scene.ranges(above, down)
    assert np.median(np.abs(off)) < 0.008
    product = next(p for p in story.products if p.kind == "verdict")
    document = json.loads((story.out / product.path).read_text(encoding="utf-8"))
    assert document["narrow_looks"][0] == len(seen)


def test_the_track_is_settled_by_shape_on_arrival(story: Story) -> None:
    history = [r for r in story.rover.truth.history if r.target == "T1"]
    assert len(history) >= 3
    assert all(r.state == "tracked" for r in history)
    assert history[-1].error_m < 0.02
    # 1: its first narrow picture shows it again, as it does each time the rover is a quarter nearer
    assert {r.confidence for r in history if r.range_m < 1.2} == {0.9, 1.0}


def test_visual_odometry_goes_along_on_the_drive(story: Story) -> None:
    product = next(p for p in story.products if p.kind == "visualodometry")
    steps = json.loads((story.out / product.path).read_text(encoding="utf-8"))
    seen = [step for step in steps if step["state"] == "good"]
    assert len(seen) >= 0.7 * len(steps) > 0
    moves = list(pairwise([(t, true) for t, true, _ in story.rover.truth.odometry]))
    for step in seen:
        shift = float(np.linalg.norm(step["pictures_m"]))
        true = [math.hypot(b.x - a.x, b.y - a.y) for (_, a), (t, b) in moves if t <= step["t_s"]][-1]
        assert shift == pytest.approx(true, abs=0.04)


def test_the_cascade_says_how_sure_it_is(story: Story) -> None:
    answer = story.own.eyes.answers["T1"]
    assert answer["accepted"] is True
    assert 0 < float(story.results["handoff"].values["error_px"]) <= 2.0


def test_products_show_the_decision_and_the_close_up(story: Story) -> None:
    kinds = [p.kind for p in story.products]
    for kind in ("hazardmap", "tracking", "odometry", "hazcam", "placement", "verdict", "microscopic"):
        assert kind in kinds, kind
    close = story.label("microscopic")
    assert close["pixel_m"] == pytest.approx(50e-6, rel=0.3)
    assert close["target"] == "T1"
    assert close["sharp"] > 0.7
    verdict = next(p for p in story.products if p.kind == "verdict")
    decided = json.loads((story.out / verdict.path).read_text(encoding="utf-8"))
    assert decided["verdict"]["decision"] in ("place", "place-near")
    assert decided["contact"] is True


def test_dust_on_the_lens_is_missing_stereo_and_refused(story: Story) -> None:
    story.rover.apply_fault(Fault(FaultKind.LENS_DUST, at_s=0.0, target="T1"))
    assert story.do("trackstart", "again", target="T1").success
    placed = story.do("ipplaceinstrument", "dusty", target="T1", instrument="mi")
    assert not placed.success
    assert placed.values["made"] is False
    assert "stereo" in placed.reason
    # it is looked at on, in case it is tried again here, but not followed to elsewhere
    assert "T1" in story.own.follower.followed
    here = story.rover.body.believed
    assert story.do("navigate", "away", x=here.x - 0.1, y=here.y, mode="blind").success
    assert "T1" not in story.own.follower.followed


def test_the_rover_moves_to_bring_a_safe_point_into_reach(
    story: Story, tmp_path_factory: pytest.TempPathFactory
) -> None:
    world = story.out / "far"
    write_contract_world(world)
    document = json.loads((world / "world.json").read_text(encoding="utf-8"))
    t1 = document["targets"][0]
    east, north = t1["point_m"][0] - 1.32, t1["point_m"][1]
    document["start"] = {"east_m": east, "north_m": north, "heading_rad": 0.0}
    (world / "world.json").write_text(json.dumps(document), encoding="utf-8")
    out = tmp_path_factory.mktemp("far")
    rover = find_rover("full")(world, out=out, seed=5)
    assert isinstance(rover, TerrainRover)
    told = Story(rover, out)
    assert told.do("trackstart", target="T1").success
    placed = told.do("ipplaceinstrument", target="T1", instrument="mi")
    assert placed.success, placed.reason
    assert float(placed.values["placement_error_m"]) <= 0.02
    assert rover.body.believed.x - east > 0.1


def test_nothing_is_touched_without_a_track(story: Story) -> None:
    refused = story.do("ipplaceinstrument", "untracked", target="T2", instrument="mi")
    assert not refused.success
    assert refused.reason == "target T2 is not tracked"


def test_clouds_of_rendered_pairs_lie_on_the_ground(story: Story) -> None:
    body = story.rover.body
    clouds = story.own.sight.look(around=False)
    assert len(clouds) == 4
    points = body.pose.site_from_rover.apply(np.concatenate(clouds))
    near = np.linalg.norm(points - body.pose.site_from_rover.translation, axis=1) < 3.0
    off = np.abs(points[near, 2] - body.terrain.height(points[near, 0], points[near, 1]))
    assert near.sum() > 2000
    assert np.nanmedian(off) < 0.02
    assert np.nanquantile(off, 0.95) < 0.08


def test_the_rover_shades_the_ground_and_the_shade_goes_with_it() -> None:
    corners = np.array([[-20.0, -20, 0], [20, -20, 0], [20, 20, 0], [-20, 20, 0]])
    ground = Scene([SceneMesh(corners, np.array([[0, 1, 2], [0, 2, 3]]), material=Material.PLAIN)])
    pose = Pose(3.0, 1.0, heading=0.4)
    poses = [pose]
    scene = ShadowedScene(ground, OwnShadow(load_profile("k9"), lambda: poses[0].site_from_rover))
    down = np.array(Sun.from_angles(0.0, 1.5).direction, dtype=np.float32)
    spots = np.array([[3.0, 1.0, 0.01], [9.0, 1.0, 0.01]])

    def dark() -> list[bool]:
        starts = (spots - scene.origin).astype(np.float32)
        rays = np.ascontiguousarray(np.broadcast_to(down, starts.shape))
        return [bool(v) for v in scene.occluded_local(starts, rays)]

    assert dark() == [True, False]
    poses[0] = Pose(9.0, 1.0)
    assert dark() == [False, True]
