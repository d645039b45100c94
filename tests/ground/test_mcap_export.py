"""A run as MCAP, read back by the reader of those who made the format."""

from __future__ import annotations

import base64
import json
import shutil
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from executive.runtime.journal import JournalFile
from ground.cli import uplink
from ground.errors import NameTakenError
from ground.uplink.execute import execute_package
from ground.uplink.mcap_export import export_mcap
from tests.ground.signed import small_site

Found = dict[str, list[tuple[int, dict[str, Any]]]]


def read_by_mcap(path: Path) -> Found:
    """Return the messages of each topic, with their times, as the package `mcap` reads them."""
    from mcap.reader import make_reader

    found: Found = {}
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages():
            assert schema is not None
            assert schema.encoding == "jsonschema"
            assert channel.message_encoding == "json"
            content = json.loads(message.data)
            known = json.loads(schema.data)["properties"]
            assert set(known) <= set(content), f"{schema.name} promises more than {channel.topic} holds"
            found.setdefault(channel.topic, []).append((message.log_time, content))
    return found


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give the folder of a run on the abstract rover, with a picture among its products."""
    folder = tmp_path_factory.mktemp("mcap")
    package, place = small_site(folder)
    execute_package(package, place, folder / "run")
    return folder / "run"


def test_a_run_is_read_back_by_mcaps_own_reader_as_its_journal_tells_it(run: Path, tmp_path: Path) -> None:
    target = tmp_path / "run.mcap"
    counts = export_mcap(run, target)
    found = read_by_mcap(target)
    assert {topic: len(held) for topic, held in found.items()} == counts
    records = JournalFile(run / "journal.jsonl").records
    traces = [(r["e"], r["a"]) for r in records if r["k"] == "trace"]
    told = [(c["event"], [c["node"], *c["detail"]]) for _, c in found["/plan"]]
    assert told == [(event, arguments or [""]) for event, arguments in traces]
    assert [c["task"] for _, c in found["/commands"]] == [r["id"][1] for r in records if r["k"] == "send"]
    samples = [json.loads(line) for line in (run / "telemetry.jsonl").read_text().splitlines()]
    assert [c for _, c in found["/telemetry"]] == samples
    products = [json.loads(line) for line in (run / "products.jsonl").read_text().splitlines()]
    assert [c["path"] for _, c in found["/products"]] == [p["path"] for p in products]
    for held in found.values():
        assert [at for at, _ in held] == sorted(at for at, _ in held)
    for at, content in found["/pose"]:
        assert at == content["timestamp"]["sec"] * 10**9 + content["timestamp"]["nsec"]


def test_a_picture_is_in_the_file_byte_for_byte(run: Path, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    shutil.copytree(run, folder)
    journal = (folder / "journal.jsonl").read_text("utf-8")
    products = [json.loads(line)["path"] for line in (folder / "products.jsonl").read_text().splitlines()]
    pictures = [p for p in products if p.endswith((".png", ".jpg"))]
    assert journal
    assert pictures, products
    export_mcap(folder, tmp_path / "run.mcap")
    found = read_by_mcap(tmp_path / "run.mcap")
    images = [c for topic, held in found.items() if topic.startswith("/images/") for _, c in held]
    assert sorted(base64.b64decode(c["data"]) for c in images) == sorted(
        (folder / p).read_bytes() for p in pictures
    )


def test_a_run_that_was_cut_off_is_exported_as_far_as_it_got(run: Path, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    data = (run / "journal.jsonl").read_bytes()
    (folder / "journal.jsonl").write_bytes(data[: len(data) // 2])
    whole, half = export_mcap(run, tmp_path / "a.mcap"), export_mcap(folder, tmp_path / "b.mcap")
    assert 0 < sum(half.values()) < sum(whole.values())
    read_by_mcap(tmp_path / "b.mcap")


def test_the_command_says_what_it_wrote_and_what_it_cannot(run: Path, tmp_path: Path) -> None:
    app = typer.Typer()
    uplink.register(app)
    target = tmp_path / "run.mcap"
    done = CliRunner().invoke(app, ["run", "export", str(run), "--mcap", str(target)])
    assert done.exit_code == 0, done.output
    assert "/plan" in done.output
    with pytest.raises(NameTakenError, match="exists already"):
        export_mcap(run, target)
    for folder, file in ((tmp_path / "none", tmp_path / "x.mcap"), (run, tmp_path / "none" / "x.mcap")):
        failed = CliRunner().invoke(app, ["run", "export", str(folder), "--mcap", str(file)])
        assert failed.exit_code == 2
        assert "Traceback" not in failed.output
    assert not list(tmp_path.glob("*.part"))


def test_the_bag_tools_of_ros_say_that_the_file_is_none_of_theirs(run: Path, tmp_path: Path) -> None:
    """The messages are Foxglove's in JSON, not of ROS in CDR; the file says so by its profile."""
    from rosbags.rosbag2.errors import ReaderError
    from rosbags.rosbag2.storage_mcap import McapReader

    export_mcap(run, tmp_path / "run.mcap")
    with pytest.raises(ReaderError, match="Profile is not ros2"):
        McapReader(tmp_path / "run.mcap").open()
