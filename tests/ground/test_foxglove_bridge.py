"""A run as live topics, heard by a plain WebSocket client that speaks Foxglove's protocol."""

from __future__ import annotations

import json
import struct
import threading
import time
from pathlib import Path
from typing import Any

import pytest
from websockets.sync.client import ClientConnection, connect

from ground.errors import GroundError
from ground.uplink.execute import execute_package
from ground.uplink.foxglove_bridge import Bridge
from ground.uplink.mcap_export import export_mcap
from tests.ground.signed import small_site
from tests.ground.test_mcap_export import read_by_mcap

Heard = dict[str, list[tuple[int, dict[str, Any]]]]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give the folder of a run on the abstract rover."""
    folder = tmp_path_factory.mktemp("bridge")
    package, place = small_site(folder)
    execute_package(package, place, folder / "run")
    return folder / "run"


class Client:
    """Subscribes to every topic that is advertised and keeps what comes."""

    def __init__(self, line: ClientConnection) -> None:
        self.line, self.heard, self.schemas = line, Heard(), {}
        self._channels: dict[int, str] = {}
        self.info: dict[str, Any] = {}

    def listen(self, enough: int, seconds: float = 20.0) -> None:
        """Listen until so many different messages came."""
        until = time.monotonic() + seconds
        while sum(map(len, self.heard.values())) < enough:
            try:
                said = self.line.recv(timeout=max(0.01, until - time.monotonic()))
            except TimeoutError:
                return
            if isinstance(said, str):
                self._told(json.loads(said))
            elif said[0] == 1:  # message data: opcode, subscription, time, payload
                subscription, at_ns = struct.unpack_from("<IQ", said, 1)
                message = (at_ns, json.loads(said[13:]))
                held = self.heard.setdefault(self._channels[subscription], [])
                if message not in held:
                    held.append(message)

    def _told(self, told: dict[str, Any]) -> None:
        if told["op"] == "serverInfo":
            self.info = told
        elif told["op"] == "advertise":
            fresh = told["channels"]
            for channel in fresh:
                self._channels[channel["id"]] = channel["topic"]
                self.schemas[channel["topic"]] = (channel["schemaName"], channel["encoding"])
            subscriptions = [{"id": c["id"], "channelId": c["id"]} for c in fresh]
            self.line.send(json.dumps({"op": "subscribe", "subscriptions": subscriptions}))


def client_of(bridge: Bridge) -> ClientConnection:
    return connect(f"ws://127.0.0.1:{bridge.port}", subprotocols=["foxglove.sdk.v1"], max_size=None)


def sorted_texts(held: list[tuple[int, dict[str, Any]]]) -> list[str]:
    return sorted({json.dumps(one, sort_keys=True) for one in held})


def test_a_client_hears_all_that_the_journal_tells(run: Path, tmp_path: Path) -> None:
    counts = export_mcap(run, tmp_path / "run.mcap")
    wanted = read_by_mcap(tmp_path / "run.mcap")
    bridge, over = Bridge(run, port=0), threading.Event()
    serving = threading.Thread(target=bridge.serve, args=(over.is_set,))
    serving.start()
    try:
        with client_of(bridge) as line:
            client = Client(line)
            client.listen(sum(len(sorted_texts(held)) for held in wanted.values()))
        assert client.info["name"] == f"outcrop {run.name}"
        assert client.schemas["/pose"] == ("foxglove.PoseInFrame", "json")
        assert set(client.heard) == set(counts)
        for topic, held in wanted.items():
            if not topic.startswith("/images"):  # of pictures a late one is given the last ones
                assert sorted_texts(client.heard[topic]) == sorted_texts(held), topic
    finally:
        over.set()
        serving.join()
        bridge.close()


def test_what_a_run_adds_reaches_a_client_that_listens(run: Path, tmp_path: Path) -> None:
    live = tmp_path / "live"
    live.mkdir()
    lines = (run / "journal.jsonl").read_bytes().splitlines(keepends=True)
    half = len(lines) // 2
    journal = live / "journal.jsonl"
    journal.write_bytes(b"".join(lines[:half]) + lines[half][:7])  # a line that is still being written
    bridge, over = Bridge(live, port=0), threading.Event()
    serving = threading.Thread(target=bridge.serve, args=(over.is_set,))
    serving.start()
    try:
        with client_of(bridge) as line:
            client = Client(line)
            client.listen(10**6, seconds=1.0)
            before = len(client.heard["/plan"])
            with journal.open("ab") as file:
                file.write(lines[half][7:] + b"".join(lines[half + 1 :]))
            began = time.monotonic()
            while client.heard["/plan"][-1][1].get("event") != "end" or len(client.heard["/plan"]) == before:
                client.listen(sum(map(len, client.heard.values())) + 1)
            assert time.monotonic() - began < 10.0
        assert 0 < before < len(client.heard["/plan"])
    finally:
        over.set()
        serving.join()
        bridge.close()


def test_a_port_in_use_and_a_folder_without_journal_are_named(run: Path, tmp_path: Path) -> None:
    bridge = Bridge(run, port=0)
    try:
        with pytest.raises(GroundError, match=f"cannot listen at 127.0.0.1:{bridge.port}"):
            Bridge(run, port=bridge.port)
        empty = Bridge(tmp_path, port=0)
        try:
            with pytest.raises(FileNotFoundError):
                empty.serve(lambda: True)
        finally:
            empty.close()
    finally:
        bridge.close()
