"""A run as a bag of ROS 2, read back by rosbags and by the reader of those who made MCAP."""

from __future__ import annotations

import json
import math
import random
import secrets
import shutil
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

from executive.runtime.codec import event_from_json
from executive.runtime.journal import JournalFile
from ground.cli import uplink
from ground.errors import InvalidInputError
from ground.uplink.execute import execute_package
from ground.uplink.flight import Sample, SampleBook
from ground.uplink.mcap_export import export_mcap
from ground.uplink.ros2_messages import Ros2Messages, camera_pose, frame_name
from ground.uplink.run_messages import messages
from neighbours.robots.recording import Mapping, Picture, Recording, read_recording
from tests.ground.journals import rewritten
from tests.ground.signed import small_site

Message = tuple[str, int, Any]
CAPACITY_J = 1.5e6


def drawn() -> random.Random:
    seed = secrets.randbits(32)
    print("seed", seed)
    return random.Random(seed)


def plan_of(rng: random.Random, pictures: int) -> str:
    """Return a plan of drives, and so many pictures between them."""
    tasks = [
        f'(task :id go{n} :action navigate :parameters (target = "T{rng.randint(1, 2)}"))' for n in range(3)
    ]
    look = ':action image :parameters (target = "T{}" instrument = "scicam")'
    tasks += [f"(task :id look{n} {look.format(rng.randint(1, 2))})" for n in range(pictures)]
    rng.shuffle(tasks)
    tasks = [task[:-1] + " :continue-on-failure t)" for task in tasks]
    return f"(plan :id day :node (block :id all :node-list ({' '.join(tasks)})))"


def flown(folder: Path, rng: random.Random, pictures: int) -> Path:
    folder.mkdir()
    package, place = small_site(folder, plan=plan_of(rng, pictures))
    execute_package(package, place, folder / "run")
    return folder / "run"


@pytest.fixture(scope="module", params=[0, 1, 12], ids=["no picture", "one", "twelve"])
def run(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give the folder of a fresh run; half of its pictures have a camera model beside them."""
    rng = drawn()
    folder = flown(tmp_path_factory.mktemp("ros2") / "made", rng, request.param)
    for number, label in enumerate(sorted((folder / "products").glob("*.png.json"))):
        if number % 2 == 0:
            document = json.loads(label.read_text())
            document |= {"camera": f"mast-cam {number}", "camera_model": camera(rng)}
            label.write_text(json.dumps(document))
    return folder


def camera(rng: random.Random) -> dict[str, Any]:
    """Return a CAHV model of a camera that looks somewhere, in the site frame."""
    turn = Rotation.random(random_state=rng.randrange(2**32)).as_matrix()
    right, down, ahead = turn[:, 0], turn[:, 1], turn[:, 2]
    focus, middle = rng.uniform(200, 900), (320.0, 240.0)
    model = {"A": ahead, "H": focus * right + middle[0] * ahead, "V": focus * down + middle[1] * ahead}
    place = [rng.uniform(-9, 9) for _ in range(3)]
    return {"model": "CAHV", "width": 640, "height": 480, "C": place} | {
        k: v.tolist() for k, v in model.items()
    }


def by_rosbags(path: Path) -> list[Message]:
    """Return every message, decoded by the types that the file itself holds."""
    with AnyReader([path]) as reader:
        return [(c.topic, at, reader.deserialize(raw, c.msgtype)) for c, at, raw in reader.messages()]


def by_mcap(path: Path) -> list[Message]:
    """Return every message in the order of the file, each decoded by the text of its own schema."""
    from mcap.reader import make_reader

    found: list[Message] = []
    stores: dict[str, Any] = {}
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            assert schema is not None
            assert (schema.encoding, channel.message_encoding) == ("ros2msg", "cdr")
            assert message.log_time == message.publish_time
            if schema.name not in stores:
                stores[schema.name] = get_typestore(Stores.EMPTY)
                stores[schema.name].register(get_types_from_msg(schema.data.decode(), schema.name))
            decoded = stores[schema.name].deserialize_cdr(message.data, schema.name)
            found.append((channel.topic, message.log_time, decoded))
    return found


def of(messages: list[Message], topic: str) -> list[tuple[int, Any]]:
    return [(at, message) for name, at, message in messages if name == topic]


def words(messages: list[Message], topic: str) -> list[Any]:
    return [json.loads(message.data) for _, message in of(messages, topic)]


def samples_of(run: Path) -> list[Sample]:
    """Return what the rover told of itself, from the journal."""
    book = SampleBook()
    for record in JournalFile(run / "journal.jsonl").records:
        if record["k"] == "step":
            for event in record["events"]:
                book.heard(event_from_json(event))
    return book.samples


def stamp_ns(header: Any) -> int:
    return int(header.stamp.sec) * 10**9 + int(header.stamp.nanosec)


def lines(path: Path) -> list[Any]:
    return [json.loads(line) for line in path.read_text().splitlines()]


def test_both_readers_decode_every_message_and_find_what_the_run_holds(run: Path, tmp_path: Path) -> None:
    target = tmp_path / "run.mcap"
    counts = export_mcap(run, target, ros2=True, capacity_j=CAPACITY_J)
    found, other = by_rosbags(target), by_mcap(target)
    assert Counter(topic for topic, _, _ in found) == Counter(counts)
    assert [(topic, at, str(message)) for topic, at, message in other] == [
        (topic, at, str(message)) for topic, at, message in found
    ]
    times = [at for _, at, _ in other]
    assert times == sorted(times)
    samples = samples_of(run)
    told = lines(run / "telemetry.jsonl")
    assert words(found, "/telemetry") == told
    assert [at for at, _ in of(found, "/pose")] == [round(s.t_s * 1000) * 10**6 for s in samples]
    for (at, message), sample in zip(of(found, "/pose"), samples, strict=True):
        assert stamp_ns(message.header) == at
        assert message.header.frame_id == "map"
        place, turn = message.pose.position, message.pose.orientation
        assert (place.x, place.y, place.z) == (sample.east_m, sample.north_m, 0.0)
        heading = Rotation.from_quat([turn.x, turn.y, turn.z, turn.w]).as_euler("zyx")[0]
        assert math.remainder(heading - sample.heading_rad, 2 * math.pi) == pytest.approx(0.0, abs=1e-12)
    assert [m.data for _, m in of(found, "/energy/battery_j")] == [s["battery_j"] for s in told]
    assert [m.data for _, m in of(found, "/energy/energy_used_j")] == [s["energy_used_j"] for s in told]
    shares = [m.percentage for _, m in of(found, "/battery")]
    assert shares == pytest.approx([s["battery_j"] / CAPACITY_J for s in told], rel=1e-6)
    records = JournalFile(run / "journal.jsonl").records
    traces = [(r["e"], r["a"] or [""]) for r in records if r["k"] == "trace"]
    assert [(c["event"], [c["node"], *c["detail"]]) for c in words(found, "/plan")] == traces
    assert [c["task"] for c in words(found, "/commands")] == [r["id"][1] for r in records if r["k"] == "send"]
    products = lines(run / "products.jsonl")
    assert words(found, "/products") == products
    pictures = [m for topic, _, m in found if topic.startswith("/images/")]
    assert [bytes(m.data) for m in pictures] == [(run / p["path"]).read_bytes() for p in products]
    assert all(m.format == "png" for m in pictures)


def test_node_states_and_trackers_are_diagnostics(run: Path, tmp_path: Path) -> None:
    export_mcap(run, tmp_path / "run.mcap", ros2=True)
    last: dict[str, tuple[str, int]] = {}
    for _, array in of(by_rosbags(tmp_path / "run.mcap"), "/diagnostics"):
        last |= {status.name: (status.message, int(status.level)) for status in array.status}
    document = json.loads((run / "run.json").read_text())
    for node, outcome in document["outcomes"].items():
        if outcome != "SKIPPED":
            assert last[f"plan/{node}"] == (outcome, 0 if outcome == "SUCCEEDED" else 2)
    for target, tracker in lines(run / "telemetry.jsonl")[-1]["trackers"].items():
        assert last[f"tracker/{target}"][0] == tracker["state"]


def chain(messages: list[Message], at_ns: int, frame: str) -> Any:
    """Return `map_from_frame` (4, 4) by the transforms of that very time."""
    steps = {}
    for at, message in of(messages, "/tf"):
        for one in message.transforms:
            assert stamp_ns(one.header) == at
            if at == at_ns:
                step = np.eye(4)
                move, turn = one.transform.translation, one.transform.rotation
                step[:3, :3] = Rotation.from_quat([turn.x, turn.y, turn.z, turn.w]).as_matrix()
                step[:3, 3] = move.x, move.y, move.z
                steps[one.child_frame_id] = (one.header.frame_id, step)
    whole = np.eye(4)
    while frame != "map":
        frame, step = steps[frame]
        whole = step @ whole
    return whole


def test_transforms_lead_from_every_picture_and_pose_to_the_map(run: Path, tmp_path: Path) -> None:
    export_mcap(run, tmp_path / "run.mcap", ros2=True)
    found = by_rosbags(tmp_path / "run.mcap")
    for at, message in of(found, "/pose"):
        place = message.pose.position
        assert chain(found, at, "base_link")[:3, 3] == pytest.approx([place.x, place.y, place.z])
    pictures = [(at, m) for topic, at, m in found if topic.startswith("/images/")]
    products = lines(run / "products.jsonl")
    frames = set()
    for (at, message), product in zip(pictures, products, strict=True):
        assert stamp_ns(message.header) == at
        frames.add(frame := message.header.frame_id)
        label = json.loads((run / f"{product['path']}.json").read_text())
        map_from_camera = chain(found, at, frame)
        model = label.get("camera_model")
        if model is None:
            assert frame == "map", "a picture from above, in the site's own frame"
            continue
        assert frame == label["camera"].replace("-", "_").replace(" ", "_") + "_optical"
        assert map_from_camera[:3, 3] == pytest.approx(model["C"])
        point = np.array([3.0, -2.0, 7.0, 1.0])  # in front of the camera: its pixel is the model's own
        ray = (map_from_camera @ point)[:3] - model["C"]
        column, row = (np.dot(ray, model[letter]) / np.dot(ray, model["A"]) for letter in "HV")
        focus = np.linalg.norm(np.cross(model["A"], model["H"]))
        assert (column - 320.0, row - 240.0) == pytest.approx((focus * 3 / 7, focus * -2 / 7), abs=1e-6)
    assert len(frames) == (len(pictures) + 1) // 2 + (len(pictures) > 1)


@pytest.mark.parametrize("posed", [True, False], ids=["after a pose", "before any"])
def test_a_picture_that_comes_down_late_has_its_chain_at_its_own_time(tmp_path: Path, posed: bool) -> None:
    rng = drawn()
    (tmp_path / "products").mkdir()
    (tmp_path / "products" / "1.png").write_bytes(b"\x89PNG")
    label: dict[str, Any] = {"sha256": "s", "camera": "navcam", "camera_model": camera(rng)}
    (tmp_path / "products" / "1.png.json").write_text(json.dumps(label))
    pose = {"pose x": rng.uniform(-9, 9), "pose y": rng.uniform(-9, 9), "pose heading": rng.uniform(-3, 3)}
    told = {"e": "update", "t": 0, "values": pose}
    product = {"kind": "image", "path": "products/1.png", "sha256": "s", "label": {"frame": "front"}}
    came = {"e": "product", "t": 5, "command": ["r", "look", 1], **product}
    records = [
        {"k": "step", "t": at, "events": events} for at, events in ((0, [told] if posed else []), (7, [came]))
    ]
    turned = Ros2Messages(tmp_path, 10**9)
    store = get_typestore(Stores.ROS2_HUMBLE)
    found: list[Message] = [
        (one.topic, 10**9 + message.t_ms * 10**6, store.deserialize_cdr(one.data, one.schema))
        for message in messages(tmp_path, records, 10**9)
        for one in turned.encoded(message)
    ]
    ((at, picture),) = of(found, "/images/image")
    assert picture.header.frame_id == ("navcam_optical" if posed else "base_link")
    if posed:
        where = chain(found, at, "navcam_optical")[:3, 3]
        assert where == pytest.approx(label["camera_model"]["C"])


def read(path: Path, mapping: Mapping) -> tuple[Recording, list[Picture]]:
    pictures: list[Picture] = []
    return read_recording(path, mapping, pictures.append), pictures


def test_what_goes_out_comes_in_again(run: Path, tmp_path: Path) -> None:
    export_mcap(run, tmp_path / "run.mcap", ros2=True)
    recording, pictures = read(tmp_path / "run.mcap", Mapping())
    assert recording.whole
    samples, told = samples_of(run), lines(run / "telemetry.jsonl")
    for pose, sample in zip(recording.poses, samples, strict=True):
        assert pose.t_ns == round(sample.t_s * 1000) * 10**6
        assert (pose.east_m, pose.north_m) == (sample.east_m, sample.north_m)
        turn = math.remainder(pose.heading_rad - sample.heading_rad, 2 * math.pi)
        assert turn == pytest.approx(0.0, abs=1e-12)
    assert sorted(level for _, level in recording.battery) == sorted(s["battery_j"] for s in told)
    products = lines(run / "products.jsonl")
    assert [p.data for p in pictures] == [(run / p["path"]).read_bytes() for p in products]
    by_transforms, _ = read(tmp_path / "run.mcap", Mapping(pose="/tf"))
    places = {(p.t_ns, p.east_m, p.north_m) for p in recording.poses}
    assert {p.t_ns for p in by_transforms.poses} >= {t for t, _, _ in places}
    at_samples = [p for p in by_transforms.poses if p.t_ns in {t for t, _, _ in places}]
    assert {(p.t_ns, p.east_m, p.north_m) for p in at_samples} <= places
    export_mcap(run, tmp_path / "share.mcap", ros2=True, capacity_j=CAPACITY_J)
    by_share, _ = read(tmp_path / "share.mcap", Mapping(battery="/battery", capacity_j=CAPACITY_J))
    levels = sorted(level for _, level in by_share.battery)
    assert levels == pytest.approx(sorted(s["battery_j"] for s in told), rel=1e-6)


def test_a_run_cut_anywhere_is_a_whole_bag_as_far_as_it_got(run: Path, tmp_path: Path) -> None:
    rng = drawn()
    journal = (run / "journal.jsonl").read_bytes()
    whole = export_mcap(run, tmp_path / "whole.mcap", ros2=True)
    header = journal.index(b"\n") + 1
    for cut in (header, rng.randrange(header, len(journal)), rng.randrange(header, len(journal))):
        folder = tmp_path / f"run{cut}"
        shutil.copytree(run, folder, dirs_exist_ok=True)
        (folder / "journal.jsonl").write_bytes(journal[:cut])
        target = tmp_path / f"cut{cut}-{rng.random()}.mcap"
        counts = export_mcap(folder, target, ros2=True)
        assert all(counts[topic] <= whole[topic] for topic in counts)
        assert len(by_mcap(target)) == sum(counts.values())
        if counts:
            assert len(by_rosbags(target)) == sum(counts.values())


def test_a_bag_that_is_cut_is_read_as_far_as_it_is_whole(run: Path, tmp_path: Path) -> None:
    export_mcap(run, tmp_path / "run.mcap", ros2=True)
    data = (tmp_path / "run.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(data[:-100])
    recording, _ = read(tmp_path / "cut.mcap", Mapping())
    assert not recording.whole
    assert len(recording.poses) == len(samples_of(run))


@pytest.mark.parametrize("word", ["NaN", "Infinity", "-Infinity", "1e999"])
def test_numbers_that_are_none_are_left_out_and_told(run: Path, tmp_path: Path, word: str) -> None:
    folder = tmp_path / "run"
    shutil.copytree(run, folder)
    key = drawn().choice(["pose x", "pose heading", "battery-energy"])
    changed = rewritten(folder / "journal.jsonl", key, word)
    assert changed
    samples = samples_of(folder)
    bad = [s for s in samples if not all(map(math.isfinite, (s.east_m, s.north_m, s.heading_rad)))]
    assert bool(bad) == key.startswith("pose")
    for ros2 in (False, True):
        counts = export_mcap(folder, tmp_path / f"{ros2}.mcap", ros2=ros2)
        assert counts.get("/pose", 0) == len(samples) - len(bad)
        assert counts["/telemetry"] == len(samples)
        assert counts.get("/rosout" if ros2 else "/log", 0) == len(bad)
    found = by_rosbags(tmp_path / "True.mcap")
    levels = [m.data for _, m in of(found, "/energy/battery_j")]
    assert [math.isnan(v) for v in levels] == [not math.isfinite(s.battery_j) for s in samples]
    for _, message in of(found, "/tf"):
        for one in message.transforms:
            move = one.transform.translation
            assert all(map(math.isfinite, (move.x, move.y, move.z)))
    if len(bad) < len(samples):
        recording, _ = read(tmp_path / "True.mcap", Mapping())
        assert len(recording.poses) == len(samples) - len(bad)


def test_odd_names_and_labels_make_good_topics_and_frames(tmp_path: Path) -> None:
    assert [frame_name(n) for n in ("a-b c", "", "3d", "é/x", "ok_1")] == ["a_b_c", "_", "_3d", "_x", "ok_1"]
    good = camera(drawn())
    assert camera_pose(good) is not None
    bad_ones: list[object] = [
        None,
        [],
        {},
        {**good, "C": [1.0, 2.0]},
        {**good, "A": [0.0, 0.0, 0.0]},
        {**good, "H": good["A"]},
        {**good, "A": [math.nan, 0.0, 1.0]},
        {**good, "C": "far away"},
        {**good, "H": {"x": 1}},
    ]
    for bad in bad_ones:
        assert camera_pose(bad) is None, bad


def test_the_command_writes_a_bag_and_names_what_cannot_be(run: Path, tmp_path: Path) -> None:
    app = typer.Typer()
    uplink.register(app)
    target = tmp_path / "run.mcap"
    asked = ["run", "export", str(run), "--mcap", str(target), "--ros2", "--capacity-j", "1.5e6"]
    done = CliRunner().invoke(app, asked)
    assert done.exit_code == 0, done.output
    assert "/tf" in done.output
    assert by_rosbags(target)
    folder = tmp_path / "late"
    shutil.copytree(run, folder)
    rewritten(folder / "journal.jsonl", "instant", '"2040-01-01T00:00:00+00:00"')
    with pytest.raises(InvalidInputError, match="end in 2038"):
        export_mcap(folder, tmp_path / "late.mcap", ros2=True)
    assert not list(tmp_path.glob("*.part"))
    assert not (tmp_path / "late.mcap").exists()
