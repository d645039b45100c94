"""Chains of transforms in recordings, checked against matrices and scipy's own way between two turns."""

from __future__ import annotations

import itertools
import math
import random
import secrets
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from scipy.spatial.transform import Rotation, Slerp

from neighbours.robots import transforms as transforms_module
from neighbours.robots.errors import RecordingError
from neighbours.robots.recording import Mapping, Recording
from tests.neighbours.robots.test_recording import SECOND, STORE, T0_NS, header, make, odometry, read

Step = tuple[int, Any, Any]
"""Time, translation (3,), rotation."""


@dataclass
class Link:
    """A link of a random chain with what was told of it, in order."""

    parent: str
    child: str
    topic: str = "/tf"
    steps: list[Step] = field(default_factory=list)

    def at(self, t_ns: int) -> Any:
        """Return `parent_from_child` (4, 4), by the definition."""
        times = [t for t, _, _ in self.steps]
        whole = np.eye(4)
        if self.topic.endswith("static") or len(times) == 1 or t_ns >= times[-1]:
            _, move, turn = self.steps[-1]
            whole[:3, :3], whole[:3, 3] = turn.as_matrix(), move
            return whole
        turns = Rotation.concatenate([turn for _, _, turn in self.steps])
        since = [(t - times[0]) / SECOND for t in times]
        now = (t_ns - times[0]) / SECOND
        whole[:3, :3] = Slerp(since, turns)(now).as_matrix()
        moves = np.array([move for _, move, _ in self.steps])
        whole[:3, 3] = [np.interp(now, since, moves[:, axis]) for axis in range(3)]
        return whole


def message(link: Link, step: Step) -> Any:
    t_ns, move, turn = step
    vector = make("geometry_msgs/msg/Vector3", **dict(zip("xyz", map(float, move), strict=True)))
    quaternion = turn if isinstance(turn, list) else turn.as_quat()
    one = make(
        "geometry_msgs/msg/TransformStamped",
        header=header(t_ns, link.parent),
        child_frame_id=link.child,
        transform=make(
            "geometry_msgs/msg/Transform",
            translation=vector,
            rotation=make(
                "geometry_msgs/msg/Quaternion", **dict(zip("xyzw", map(float, quaternion), strict=True))
            ),
        ),
    )
    return make("tf2_msgs/msg/TFMessage", transforms=[one])


def bag(folder: Path, told: list[tuple[Link, Step]], *, odometry_too: bool = False) -> Path:
    """Write transforms in the order in which they came."""
    plugin = random.choice([StoragePlugin.SQLITE3, StoragePlugin.MCAP])
    with Writer(folder, version=9, storage_plugin=plugin) as writer:
        topics: dict[str, Any] = {}
        for place, (link, step) in enumerate(told):
            if link.topic not in topics:
                topics[link.topic] = writer.add_connection(
                    link.topic, "tf2_msgs/msg/TFMessage", typestore=STORE
                )
            data = STORE.serialize_cdr(message(link, step), "tf2_msgs/msg/TFMessage")
            writer.write(topics[link.topic], T0_NS + place, data)
        if odometry_too:
            odom = writer.add_connection("/odom", "nav_msgs/msg/Odometry", typestore=STORE)
            at = STORE.serialize_cdr(odometry(T0_NS, 77.0, 0.0, 0.0), "nav_msgs/msg/Odometry")
            writer.write(odom, T0_NS, at)
    return folder


def drawn() -> random.Random:
    seed = secrets.randbits(32)
    print("seed", seed)
    return random.Random(seed)


def turn_of(rng: random.Random, *, level: bool) -> Rotation:
    if level:
        return Rotation.from_euler("z", rng.uniform(-math.pi, math.pi))
    return Rotation.random(random_state=rng.randrange(2**32))


def link_of(rng: random.Random, parent: str, child: str, count: int, topic: str = "/tf") -> Link:
    """Return a link with steps at random times, the first early."""
    times = sorted({T0_NS, *(T0_NS + rng.randrange(20 * SECOND) for _ in range(count - 1))})
    steps = [(t, np.array([rng.uniform(-5, 5) for _ in "xyz"]), turn_of(rng, level=False)) for t in times]
    return Link(parent, child, topic, steps)


def in_time(links: list[Link]) -> list[tuple[Link, Step]]:
    return sorted(((link, step) for link in links for step in link.steps), key=lambda pair: pair[1][0])


def holds(recording: Recording, chain: list[Link]) -> None:
    """Check the poses against the product of the links at each time of the busiest."""
    busiest = max(chain, key=lambda link: 1 if link.topic.endswith("static") else len(link.steps))
    times = [t for t, _, _ in busiest.steps]
    assert [pose.t_ns for pose in recording.poses] == (
        times[-1:] if busiest.topic.endswith("static") else times
    )
    for pose in recording.poses:
        whole = np.linalg.multi_dot([np.eye(4), *(link.at(pose.t_ns) for link in chain)])
        assert (pose.east_m, pose.north_m, pose.up_m) == pytest.approx(tuple(whole[:3, 3]), abs=1e-6)
        ahead = whole[:3, 0]
        if math.hypot(ahead[0], ahead[1]) > 1e-3:  # else the robot looks straight up
            off = math.remainder(pose.heading_rad - math.atan2(ahead[1], ahead[0]), 2 * math.pi)
            assert off == pytest.approx(0.0, abs=1e-5)


@pytest.mark.parametrize("attempt", range(8))
def test_a_chain_of_any_length_gives_the_poses_of_its_product(attempt: int, tmp_path: Path) -> None:
    rng = drawn()
    middle = [f"between_{n}" for n in range(rng.randrange(4))]
    frames = [rng.choice(["map", "site"]), *middle, rng.choice(["base_link", "base_footprint"])]
    chain = [
        link_of(rng, parent, child, rng.choice([1, 4]), "/tf_static")
        if rng.random() < 0.3
        else link_of(rng, parent, child, rng.choice([1, 3, 40]))
        for parent, child in itertools.pairwise(frames)
    ]
    lengths = sorted(len(link.steps) for link in chain if link.topic == "/tf")
    if len(lengths) > 1 and lengths[-1] == lengths[-2]:  # no busiest one: the first counts
        chain = [link_of(rng, c.parent, c.child, 3 + 7 * n) for n, c in enumerate(chain)]
    others = [
        link_of(rng, "base_link", "wheel", 50),
        link_of(rng, "camera", "camera_optical", 1, "/tf_static"),
        link_of(rng, "planet", frames[0], 60),
    ]
    recording, _ = read(bag(tmp_path / "bag", in_time([*chain, *others])))
    holds(recording, chain)
    told = [f for f in recording.findings if f.startswith("poses are put together of")]
    assert told == ([f"poses are put together of {' -> '.join(frames)}"] if len(chain) > 1 else [])


def test_a_correction_of_the_map_counts_from_when_it_comes(tmp_path: Path) -> None:
    rng = drawn()
    drift, driven = link_of(rng, "map", "odom", 5), link_of(rng, "odom", "base_link", 60)
    first = driven.steps[30][0]
    drift.steps = [(t, m, r) for t, m, r in drift.steps if t >= first] or [
        (first, np.zeros(3), Rotation.identity())
    ]
    drift.steps.insert(0, (first, np.ones(3), Rotation.identity()))
    drift.steps = [s for n, s in enumerate(drift.steps) if n == 0 or s[0] != drift.steps[0][0]]
    if len(drift.steps) == 1:
        drift.steps.append((first + SECOND, np.zeros(3), Rotation.identity()))
    recording, _ = read(bag(tmp_path / "bag", in_time([drift, driven])))
    driven.steps = driven.steps[30:]
    holds(recording, [drift, driven])
    assert "30 poses are left out: another transform of the chain had not come yet" in recording.findings


def test_transforms_out_of_order_or_told_twice_are_put_in_order(tmp_path: Path) -> None:
    rng = drawn()
    drift, driven = link_of(rng, "map", "odom", 7), link_of(rng, "odom", "base_link", 40)
    told = in_time([drift, driven])
    again = [(driven, (t, m + 1, r)) for t, m, r in rng.sample(driven.steps, 5)]
    late = [pair for pair in told if rng.random() < 0.2 and pair[1][0] != T0_NS]
    left = [pair for pair in told if not any(pair is other for other in late)]
    recording, _ = read(bag(tmp_path / "bag", [*left, *late, *again]))
    holds(recording, [drift, driven])
    if any(link is driven for link, _ in late):
        assert any("odom -> base_link" in f and "out of order" in f for f in recording.findings)


def test_the_mapping_chooses_frames_and_topic(tmp_path: Path) -> None:
    rng = drawn()
    links = [
        link_of(rng, "map", "odom", 5, "/one/tf"),
        link_of(rng, "odom", "base_link", 30, "/one/tf"),
        link_of(rng, "map", "odom", 5, "/two/tf"),
        link_of(rng, "odom", "frame", 30, "/two/tf"),
        link_of(rng, "frame", "base_link", 1, "/two/tf_static"),
    ]
    path = bag(tmp_path / "bag", in_time(links), odometry_too=True)
    (pose,) = read(path)[0].poses
    assert pose.east_m == 77.0, "odometry is taken before transforms"
    holds(read(path, Mapping(pose="/one/tf"))[0], links[:2])
    holds(read(path, Mapping(pose="/two/tf"))[0], links[2:])
    holds(read(path, Mapping(pose="/one/tf", parent="odom"))[0], links[1:2])
    holds(read(path, Mapping(pose="/two/tf", parent="/odom", child="frame"))[0], links[3:4])


def test_what_leads_nowhere_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = drawn()
    ring = [link_of(rng, "a", "b", 3), link_of(rng, "b", "a", 4), link_of(rng, "b", "base_link", 3)]
    with pytest.raises(
        RecordingError, match=r"no transforms lead from site or map .*; there are a -> b, b -> a"
    ):
        read(bag(tmp_path / "ring", in_time(ring)))
    good = link_of(rng, "map", "base_link", 9)
    t_ns = good.steps[-1][0]
    bad: list[tuple[Link, Step]] = [
        (good, (t_ns + 1, [math.nan, 0.0, 0.0], Rotation.identity())),
        (good, (t_ns + 2, [0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0])),
        (good, (t_ns + 3, [0.0, 0.0, 0.0], [math.inf, 0.0, 0.0, 1.0])),
    ]
    recording, _ = read(bag(tmp_path / "bad", [*in_time([good]), *bad]))
    holds(recording, [good])
    assert "3 messages could not be decoded: /tf: ValueError" in recording.findings
    monkeypatch.setattr(transforms_module, "MOST_LINKS", 20)
    many = [link_of(rng, "map", f"rock_{n}", 2) for n in range(30)]
    told = [(good, good.steps[0]), *in_time(many), *((good, step) for step in good.steps[1:])]
    recording, _ = read(bag(tmp_path / "many", told))
    holds(recording, [good])
    assert any("transforms of further frames are left out" in f for f in recording.findings)


def test_a_fixed_transform_holds_for_all_times_as_it_was_told_last(tmp_path: Path) -> None:
    rng = drawn()
    chain = [link_of(rng, "map", "mount", 5, "/tf_static"), link_of(rng, "mount", "base_link", 40)]
    recording, _ = read(bag(tmp_path / "bag", in_time(chain)))
    holds(recording, chain)
