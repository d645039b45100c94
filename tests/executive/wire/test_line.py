"""The line's thread outlives what its own side does wrong: full disks, odd addresses, odd commands."""

from __future__ import annotations

import contextlib
import math
import socket
import threading
from pathlib import Path

import pytest

from executive.errors import WireError
from executive.ports import Acknowledgement, Command, CommandId, Result
from executive.runtime.wire import Address, Keys, WireRover
from executive.runtime.wire.address import dial, listen
from executive.runtime.wire.contract import check_wire
from tests.executive.wire.servers import JumpingClock, Waiter, served
from tests.executive.wire.test_wire import QUICK, hear, line_to
from tests.waiting import until


def test_a_disk_that_takes_no_product_does_not_keep_a_stop_from_the_rover(tmp_path: Path) -> None:
    rover, out = Waiter(JumpingClock(), tmp_path / "made"), tmp_path / "run"
    out.mkdir()
    (out / "products").write_text("in the way")
    said: list[str] = []
    with served(rover, tmp_path / "r.sock") as (address, _), line_to(address, out=out) as line:
        line.wait_ready(5)
        line.attach(rover.clock, lambda _kind, text: said.append(text))
        line.send(Command(CommandId("run", "pic", 1), "image", {}))
        until(lambda: any("products/1.bin cannot be written" in text for text in said))
        drive = CommandId("run", "drive", 1)
        line.send(Command(drive, "wait", {"duration_s": 100.0}))
        until(lambda: drive in rover.running)
        line.stop()
        until(lambda: not rover.running)
        (out / "products").unlink()  # there is room again
        until(lambda: line.wait_for_products(0.1) == 0)
        assert (out / "products" / "1.bin").read_bytes() == (tmp_path / "made/products/1.bin").read_bytes()
    assert len([text for text in said if "cannot be written" in text]) == 1


def test_a_command_that_json_cannot_hold_is_refused_and_the_next_one_goes(tmp_path: Path) -> None:
    rover = Waiter(JumpingClock())
    with served(rover, tmp_path / "r.sock") as (address, _), line_to(address) as line:
        line.wait_ready(5)
        for odd in ({"duration_s": math.nan}, {"text": "x" * (1 << 20)}):
            with pytest.raises(WireError, match=r"not JSON|a frame holds"):
                line.send(Command(CommandId("run", "odd", 1), "wait", odd))
        line.send(Command(CommandId("run", "even", 1), "wait", {}))
        assert any(isinstance(e, Result) and e.success for e in hear(line, 2))
        assert [c.task for c in rover.carried_out] == ["even"]


def test_a_dial_that_fails_in_its_own_way_is_tried_again(tmp_path: Path) -> None:
    rover = Waiter(JumpingClock())
    tries = [OSError("no more files"), ValueError("odd"), RuntimeError("odder")]
    with served(rover, tmp_path / "r.sock") as (address, _):

        def reach() -> socket.socket:
            if tries:
                raise tries.pop()
            return dial(address)

        line = WireRover(reach, run="run", options=QUICK)
        try:
            assert line.wait_ready(5).rover == "waiter"
        finally:
            line.close()


def test_an_event_that_breaks_its_listener_does_not_end_the_line(tmp_path: Path) -> None:
    rover = Waiter(JumpingClock(), tmp_path / "made")
    with served(rover, tmp_path / "r.sock") as (address, _), line_to(address, out=tmp_path / "run") as line:
        line.wait_ready(5)

        def broken(_kind: str, _text: str) -> None:
            raise OSError("the journal's disk is full")

        line.attach(rover.clock, broken)
        line.say_raw(b"\x00\x00\x00\x02[]")  # the rover closes the line: there is something to complain of
        until(lambda: line.link().breaks > 0)
        drive = CommandId("run", "drive", 1)
        line.send(Command(drive, "wait", {"duration_s": 100.0}))
        until(lambda: drive in rover.running)
        line.stop()
        assert any(isinstance(e, Acknowledgement) for e in hear(line, 2))


@pytest.mark.parametrize("host", ["a" * 70 + ".example", "exa\u0000mple", "..", "xn--a\ud800"])
def test_a_host_that_no_name_service_could_know_is_said_not_raised(host: str, tmp_path: Path) -> None:
    keys = Keys(tmp_path, tmp_path, tmp_path)
    for act in (dial, listen):
        with pytest.raises(WireError, match=r"does not answer|cannot be listened on"):
            act(Address(None, host, 1), keys)


def test_a_path_that_no_file_can_have_is_said_not_raised() -> None:
    for act in (dial, listen):
        with pytest.raises(WireError, match=r"does not answer|cannot be listened on"):
            act(Address(Path("/tmp/a\0b")))


def test_a_socket_is_removed_only_if_nobody_can_be_behind_it(tmp_path: Path) -> None:
    place = Address(tmp_path / "r.sock")
    with listen(place) as hung:  # it accepts nothing, and its queue is full
        hung.listen(0)
        waiting = []
        with contextlib.ExitStack() as ends:
            for _ in range(4):
                line = ends.enter_context(socket.socket(socket.AF_UNIX))
                line.setblocking(False)
                with contextlib.suppress(BlockingIOError):
                    line.connect(str(place.path))
                    waiting.append(line)
            with pytest.raises(WireError, match="in use"):
                listen(place)
        assert place.path is not None
        assert place.path.exists()
    listen(place).close()  # its owner is gone: nobody answers


def test_a_check_that_finds_no_rover_leaves_no_thread(tmp_path: Path) -> None:
    before = set(threading.enumerate())
    findings = check_wire(Address(tmp_path / "none.sock"), patience_s=0.05)
    assert not any(finding.passed for finding in findings)
    assert not {t for t in threading.enumerate() if t.name.endswith("-wire")} - before
