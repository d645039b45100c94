"""The rover's end outlives its rover: values that are not JSON, aborts that raise, stops that take time."""

from __future__ import annotations

import math
import threading
import time
from pathlib import Path

import pytest

from executive.errors import WireError
from executive.ports import Acknowledgement, Command, CommandId, Result, Update
from executive.runtime.wire.stop import stop_rover
from tests.executive.wire.servers import JumpingClock, Waiter, served
from tests.executive.wire.test_wire import hear, line_to
from tests.waiting import until


class Stubborn(Waiter):
    """A rover one of whose commands cannot be stopped while `broken`."""

    broken = True

    def abort(self, command: CommandId) -> None:
        if self.broken and command.task == "a":
            raise OSError("the motor does not answer")
        super().abort(command)


@pytest.mark.parametrize("odd", [math.nan, math.inf, [1.0], None, "x" * (1 << 20)])
def test_a_value_that_json_cannot_hold_is_left_out_and_the_rover_stays(odd: object, tmp_path: Path) -> None:
    rover = Waiter(JumpingClock())
    rover.events.append(Update(0, {"odd": odd, "even": 1.0}))  # type: ignore[dict-item]
    with served(rover, tmp_path / "r.sock") as (address, _), line_to(address) as line:
        line.wait_ready(5)
        for run in range(3):
            task = CommandId("run", f"task-{run}", 1)
            line.send(Command(task, "wait", {}))
            until(lambda task=task: task in rover.done)
            rover.events.append(Update(0, {"odd": odd, "count": float(run)}))  # type: ignore[dict-item]
        until(lambda: line.present_state().get("count") == 2.0)
        assert "odd" not in line.present_state()
        found = hear(line, 8, 1.0)
        assert sum(isinstance(e, Result) and e.success for e in found) == 3
        numbers = [getattr(e, "number", 0) for e in found]
        assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))


def test_a_result_too_long_for_a_frame_is_still_a_result(tmp_path: Path) -> None:
    rover = Waiter(JumpingClock())
    command = CommandId("run", "a", 1)
    with served(rover, tmp_path / "r.sock") as (address, _), line_to(address) as line:
        line.wait_ready(5)
        line.send(Command(command, "wait", {"duration_s": 100.0}))
        until(lambda: command in rover.running)
        del rover.running[command]
        many = {f"key-{n}": "x" * 1000 for n in range(2000)}
        rover._over(Result(0, command, True, "", many, many))
        (answer,) = [e for e in hear(line, 2) if isinstance(e, Result)]
        assert answer.success


def test_one_abort_that_raises_keeps_no_other_from_being_stopped(tmp_path: Path) -> None:
    rover = Stubborn(JumpingClock())
    both = [CommandId("run", name, 1) for name in ("a", "b")]
    with served(rover, tmp_path / "r.sock") as (address, _), line_to(address) as line:
        line.wait_ready(5)
        for command in both:
            line.send(Command(command, "wait", {"duration_s": 100.0}))
        until(lambda: len(rover.running) == 2)
        with pytest.raises(WireError, match="did not say"):
            stop_rover(address, timeout_s=1.0)  # `a` cannot be stopped: nobody may say that it was
        assert list(rover.running) == both[:1]
        rover.broken = False
        stop_rover(address, timeout_s=5.0)
        assert not rover.running
        assert sum(isinstance(e, Acknowledgement) for e in hear(line, 3)) == 2


def test_stopped_is_not_said_before_anything_is_stopped(tmp_path: Path) -> None:
    rover = Waiter(JumpingClock())
    command = CommandId("run", "a", 1)
    with served(rover, tmp_path / "r.sock") as (address, server), line_to(address) as line:
        line.wait_ready(5)
        line.send(Command(command, "wait", {"duration_s": 100.0}))
        until(lambda: command in rover.running)
        busy = threading.Event()
        server._lead.do(lambda: busy.wait(20) and None)  # the rover computes
        time.sleep(0.05)
        with pytest.raises(WireError, match="did not say"):
            stop_rover(address, timeout_s=0.6)
        line.stop()
        time.sleep(0.2)
        assert line.link().stopping
        assert len(server._lead._tasks) < 4, "stops that are said again pile up"
        busy.set()
        until(lambda: not line.link().stopping)
        assert not rover.running


def test_a_new_run_is_not_given_the_products_of_the_last_one(tmp_path: Path) -> None:
    rover = Waiter(JumpingClock(), tmp_path / "made")
    with served(rover, tmp_path / "r.sock") as (address, server):
        with line_to(address, out=tmp_path / "one") as line:
            line.wait_ready(5)
            line.send(Command(CommandId("run", "pic", 1), "image", {}))
            until(lambda: server._lead.products)
            until(lambda: not line.link().commands)
        with line_to(address, "next") as line:
            line.wait_ready(5)
            assert not server._lead.products
