"""The `mujoco` rover as a robot with Nav2 shows itself in ROS 2, in a process of its own.

    python -m rover_iface.mujoco.nav2_front WORLD [--rate 8] [--seed N] [--log FILE] [--fault N:KIND ...]

It serves NavigateToPose (nav2_msgs) at `/navigate_to_pose` and tells `/clock`, `/odom`, `/tf` (`map` to
`base_link`), `/battery_state` and `/camera/image_raw`, a picture of the ground round the rover from above.
It is not a Nav2: goals are drives of the rover in MuJoCo, straight to the place, one at a time.

`/clock` runs at `--rate`, and slower where the dynamics cannot follow. A fault befalls the Nth goal that
comes: `reject`; `abort`, given up after a while; `mute`, accepted and driven, and no result comes until it
is cancelled. With `--log` each goal is written down when it is begun and when it ends, a JSON object a
line.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import sys
import time
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from executive.ports import Acknowledgement, Command, CommandId, Result
from rover_iface.errors import RosError, RoverError
from rover_iface.frames import wrap_angle
from rover_iface.mujoco.rover import MujocoRover, make_rover

try:
    import rclpy
    from builtin_interfaces.msg import Time
    from geometry_msgs.msg import TransformStamped
    from nav2_msgs.action import NavigateToPose
    from nav_msgs.msg import Odometry
    from rclpy.action import ActionServer, CancelResponse, GoalResponse
    from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
    from rclpy.task import Future
    from rosgraph_msgs.msg import Clock
    from sensor_msgs.msg import BatteryState, Image
    from tf2_msgs.msg import TFMessage
except ImportError as missing:
    raise RosError(f"the front needs ROS 2 with nav2_msgs, for this Python ({missing})") from missing

FAULTS = ("reject", "abort", "mute")
GIVEN_UP_MS = 4000
"""After so long a goal with the fault `abort` is given up, by the rover's clock."""
TURN_MS = 250
"""The clock goes on by no more in a turn; a machine that is slower has a slower clock."""
ODOMETRY_S, PICTURE_S = 0.05, 0.5
"""Seconds of the machine between two words on the pose, and on battery and picture."""
VOLTS = 28.0
"""Of the bus: the battery's charge is told in Ah, its energy divided by this."""
PICTURE_M, PICTURE_PX = 4.0, 64
NO_WAY = 208
"""Error code of a goal that was not reached; Nav2 uses it for a path that is not found."""


@dataclass(slots=True)
class _Goal:
    """A goal that is carried out, and what the rover says when its drive has ended."""

    handle: Any
    command: CommandId
    fault: str
    over: Any
    until_ms: int | None = None
    ended: Result | Acknowledgement | None = None


class Nav2Front:
    """A rover behind an action server. One thread: goals, dynamics and telemetry take turns.

    Parameters
    ----------
    faults
        What befalls the goals, by their number in the order in which they come, from 1.
    """

    def __init__(self, rover: MujocoRover, rate: float, faults: Mapping[int, str], log: Path | None) -> None:
        self.rover, self.rate, self.faults, self._log = rover, rate, faults, log
        self.node: Any = rclpy.create_node("nav2_front")
        self._goals: dict[CommandId, _Goal] = {}
        self._fault_of: deque[str] = deque()
        self._came = self._begun = 0
        self._server = ActionServer(
            self.node,
            NavigateToPose,
            "/navigate_to_pose",
            self._drive,
            goal_callback=self._judge,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
        )
        told = {"clock": Clock, "odom": Odometry, "tf": TFMessage, "battery_state": BatteryState}
        kinds = {**told, "camera/image_raw": Image}
        self._told = {name: self.node.create_publisher(kind, f"/{name}", 10) for name, kind in kinds.items()}

    # ---- goals

    def _write(self, what: str, **more: object) -> None:
        if self._log is not None:
            line = {"what": what, "t_ms": self.rover.now_ms, "wall_s": time.time(), **more}
            with self._log.open("a", encoding="utf-8") as file:
                file.write(json.dumps(line) + "\n")

    def _judge(self, _request: Any) -> Any:
        self._came += 1
        fault = self.faults.get(self._came, "")
        if fault == "reject":
            self._write("reject", number=self._came)
            return GoalResponse.REJECT
        self._fault_of.append(fault)
        return GoalResponse.ACCEPT

    async def _drive(self, handle: Any) -> Any:
        """Carry out a goal; ends when the rover has, or the goal was cancelled or given up."""
        name, fault = bytes(handle.goal_id.uuid).hex(), self._fault_of.popleft()
        self._begun += 1
        command = CommandId("nav2", name, self._begun)  # a goal that comes again is driven again
        place, turn = handle.request.pose.pose.position, handle.request.pose.pose.orientation
        parameters: dict[str, float | str | bool] = {"x": place.x, "y": place.y, "mode": "blind"}
        parameters["heading"] = wrap_angle(2 * math.atan2(turn.z, turn.w))
        self._write("begin", goal=name, fault=fault)
        goal = _Goal(handle, command, fault, Future())
        if fault == "abort":
            goal.until_ms = self.rover.now_ms + GIVEN_UP_MS
        self._goals[command] = goal
        self.rover.send(Command(command, "navigate", parameters))
        ended = await goal.over
        result = NavigateToPose.Result()
        if handle.is_cancel_requested:
            how, end = "cancelled", handle.canceled
        elif isinstance(ended, Result) and ended.success:
            how, end = "succeeded", handle.succeed
        else:
            how, end = "aborted", handle.abort
            result.error_code = NO_WAY
            result.error_msg = ended.reason if isinstance(ended, Result) else "given up"
        self._write("end", goal=name, how=how, x=self.rover.pose.x, y=self.rover.pose.y)
        end()
        return result

    def _look_after(self) -> None:
        """Stop what was cancelled or is to be given up, and let goals end whose drive has."""
        for command, goal in list(self._goals.items()):
            asked = goal.handle.is_cancel_requested
            late = goal.until_ms is not None and self.rover.now_ms >= goal.until_ms
            if goal.ended is None and (asked or late):
                self.rover.abort(command)
        while (event := self.rover.next_event(self.rover.now_ms)) is not None:
            self._hear(event)
        for command, goal in list(self._goals.items()):
            if goal.ended is not None and (goal.fault != "mute" or goal.handle.is_cancel_requested):
                del self._goals[command]
                goal.over.set_result(goal.ended)

    def _hear(self, event: object) -> None:
        if isinstance(event, Result | Acknowledgement) and event.command in self._goals:
            self._goals[event.command].ended = event

    # ---- time

    def run(self) -> None:
        """Live until interrupted."""
        executor = SingleThreadedExecutor()
        executor.add_node(self.node)
        before = time.monotonic()
        odometry = picture = 0.0
        behind_ms = 0.0
        while rclpy.ok():
            executor.spin_once(timeout_sec=0.005)
            now = time.monotonic()
            behind_ms = min(TURN_MS, behind_ms + 1000 * self.rate * (now - before))
            before = now
            until = self.rover.now_ms + int(behind_ms)
            behind_ms -= int(behind_ms)
            while (event := self.rover.next_event(until)) is not None:
                self._hear(event)
            self._look_after()
            self._told["clock"].publish(Clock(clock=self._stamp()))
            if now - odometry >= ODOMETRY_S:
                odometry = now
                self._tell_pose()
            if now - picture >= PICTURE_S:
                picture = now
                self._tell_the_rest()

    # ---- telemetry

    def _stamp(self) -> Any:
        seconds, rest = divmod(self.rover.now_ms, 1000)
        return Time(sec=seconds, nanosec=rest * 1_000_000)

    def _tell_pose(self) -> None:
        x, y, heading = (float(self.rover.get(f"pose {key}") or 0.0) for key in ("x", "y", "heading"))
        odom, tf = Odometry(), TransformStamped()
        odom.header.frame_id, odom.child_frame_id = tf.header.frame_id, tf.child_frame_id = "map", "base_link"
        odom.header.stamp = tf.header.stamp = self._stamp()
        place, move = odom.pose.pose, tf.transform
        place.position.x = move.translation.x = x
        place.position.y = move.translation.y = y
        place.position.z = move.translation.z = self.rover.pose.z
        place.orientation.z = move.rotation.z = math.sin(heading / 2)
        place.orientation.w = move.rotation.w = math.cos(heading / 2)
        self._told["odom"].publish(odom)
        self._told["tf"].publish(TFMessage(transforms=[tf]))

    def _tell_the_rest(self) -> None:
        rover = self.rover
        amp_hours = 1 / (3600 * VOLTS)
        battery = BatteryState(voltage=VOLTS, charge=rover.battery_j * amp_hours)
        battery.capacity = rover.initial_j * amp_hours
        battery.percentage = rover.battery_j / max(rover.initial_j, 1.0)
        battery.header.stamp = self._stamp()
        self._told["battery_state"].publish(battery)
        image = Image(height=PICTURE_PX, width=PICTURE_PX, encoding="mono8", step=PICTURE_PX)
        image.header.stamp, image.header.frame_id = self._stamp(), "map"
        image.data = self._ground().tobytes()
        self._told["camera/image_raw"].publish(image)

    def _ground(self) -> npt.NDArray[np.uint8]:
        """Return the ground round the rover from above, north up, lit from the west: [64, 64] grey."""
        at = (np.arange(PICTURE_PX) / PICTURE_PX - 0.5) * PICTURE_M
        field, pose = self.rover.vehicle.field, self.rover.pose
        heights = np.array([[field.height(pose.x + x, pose.y - y) for x in at] for y in at])
        slope = np.gradient(heights, PICTURE_M / PICTURE_PX, axis=1)
        return np.clip(128 + 255 * np.nan_to_num(slope), 0, 255).astype(np.uint8)


def fault(text: str) -> tuple[int, str]:
    """Return the number and kind of a fault, `3:abort`."""
    number, _, kind = text.partition(":")
    if not number.isdecimal() or int(number) < 1 or kind not in FAULTS:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of a goal and one of {', '.join(FAULTS)}")
    return int(number), kind


def rate(text: str) -> float:
    """Return how fast the clock runs, its seconds in a second."""
    value = float(text)
    if not 0 < value <= 1000:
        raise argparse.ArgumentTypeError(f"{text} is not within 0 to 1000")
    return value


def main(arguments: Sequence[str] | None = None) -> int:
    """Run until interrupted; return the exit status."""
    form = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser("nav2_front", description=__doc__, formatter_class=form)
    parser.add_argument("world", type=Path, help="world/1 with a terrain: its file or folder")
    parser.add_argument("--rate", type=rate, default=1.0, help="seconds of its clock in a second")
    parser.add_argument("--seed", type=int, default=None, help="of grip and unmapped rocks")
    parser.add_argument("--log", type=Path, default=None, help="write down goals here")
    parser.add_argument("--fault", type=fault, action="append", default=[], metavar="N:KIND")
    given = parser.parse_args(arguments)
    try:
        rover = make_rover(given.world, seed=given.seed, progress_s=0.2)
    except RoverError as err:
        sys.stderr.write(f"nav2_front: {err}\n")
        return 2
    rclpy.init(args=[])
    front = Nav2Front(rover, given.rate, dict(given.fault), given.log)
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        front.run()
    return 0


if __name__ == "__main__":
    sys.exit(main())
