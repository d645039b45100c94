"""ROS 2 for tests: a port that a test speaks through, clocks that it sets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from executive.ports import Command, CommandId, Event, Value
from rover_iface.ros2.goals import Filling
from rover_iface.ros2.load import Mapped, load_mapping
from rover_iface.ros2.mapping import ActionCall, Qos, ServiceCall
from rover_iface.ros2.port import Ended, GoalStatus, Judged, Statuses, Word
from rover_iface.ros2.rover import RosRover

TURTLE = Path(__file__).parents[2] / "examples/ros2_turtle/turtle.yaml"


class FakeEar:
    def __init__(self, depth: int) -> None:
        self.depth, self.waiting, self.closed = depth, list[object](), False

    def take(self) -> list[object]:
        found, self.waiting = self.waiting[-self.depth :], []
        return found

    def close(self) -> None:
        self.closed = True


class FakePort:
    def __init__(self) -> None:
        self.there: dict[str, str] = {}
        self.sent: list[tuple[str, bytes, Mapping[str, Filling]]] = []
        self.cancelled: list[bytes] = []
        self.ears: dict[str, FakeEar] = {}
        self.waiting: list[Word] = []

    def servers(self, call: ActionCall | ServiceCall) -> frozenset[str]:
        return frozenset({self.there[call.name]} if call.name in self.there else ())

    def send_goal(self, call: ActionCall, goal: bytes, fields: Mapping[str, Filling]) -> None:
        self.sent.append((call.name, goal, fields))

    def request(self, call: ServiceCall, ticket: bytes, fields: Mapping[str, Filling]) -> None:
        self.sent.append((call.name, ticket, fields))

    def cancel_goal(self, call: ActionCall, goal: bytes) -> None:
        self.cancelled.append(goal)

    def listen(self, topic: str, kind: str, qos: Qos, depth: int) -> FakeEar:
        self.ears[topic] = FakeEar(depth)
        return self.ears[topic]

    def words(self) -> Sequence[Word]:
        found, self.waiting = self.waiting, []
        return found


class Bench:
    """A rover over a fake ROS, with a clock for both of its times."""

    def __init__(self, out: Path, mapped: Mapped | None = None) -> None:
        self.t_s = 100.0
        self.port = FakePort()
        self.port.there = dict.fromkeys(("/navigate_to_pose", "/follow_waypoints", "/lamp"), "server")
        self.rover = RosRover(
            mapped or load_mapping(TURTLE), self.port, self, out=out, now_s=lambda: self.t_s
        )
        self.heard: list[Event] = []
        self.turn()

    def now_ms(self) -> int:
        return int(1000 * self.t_s)

    def turn(self, *words: Word, after_s: float = 0.0) -> list[Event]:
        """Let words come, time go on, and the rover look; return what it said."""
        self.t_s += after_s
        self.port.waiting += words
        said = []
        while (event := self.rover.next_event(None)) is not None:
            said.append(event)
        self.heard += said
        return said

    def send(self, action: str, /, attempt: int = 1, **parameters: Value) -> CommandId:
        command = CommandId("run", action, attempt)
        self.rover.send(Command(command, action, parameters))
        return command

    def accept(self) -> bytes:
        """Let the last goal be accepted; return its id."""
        goal = self.port.sent[-1][1]
        self.turn(Judged(goal, True))
        return goal

    def end(self, goal: bytes, status: GoalStatus, **result: object) -> list[Event]:
        return self.turn(Ended(goal, status, SimpleNamespace(error_msg="", **result)))

    def statuses(self, **goals: GoalStatus) -> Statuses:
        return Statuses("/navigate_to_pose", {bytes.fromhex(k[1:]): v for k, v in goals.items()})


def message(**members: Any) -> SimpleNamespace:
    """Return a message whose members with `__` in their names lie deeper."""
    made = SimpleNamespace()
    for path, given in members.items():
        *way, last = path.split("__")
        at = made
        for step in way:
            if not hasattr(at, step):
                setattr(at, step, SimpleNamespace())
            at = getattr(at, step)
        setattr(at, last, given)
    return made


def odometry(x: float, y: float, frame: str = "map", speed: Any = 0.0, w: float = 1.0) -> SimpleNamespace:
    place, turn = {"x": x, "y": y, "z": 0.0}, {"w": w, "x": 0.0, "y": 0.0, "z": 0.0}
    return message(
        header__frame_id=frame,
        pose__pose__position=SimpleNamespace(**place),
        pose__pose__orientation=SimpleNamespace(**turn),
        twist__twist__linear__x=speed,
    )
