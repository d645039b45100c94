"""What the bridge asks of ROS 2 and what it hears: all that its logic knows of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Protocol

from rover_iface.ros2.goals import Filling
from rover_iface.ros2.mapping import ActionCall, Qos, ServiceCall


class GoalStatus(IntEnum):
    """Status of a goal, numbered as in action_msgs/GoalStatus."""

    UNKNOWN = 0
    ACCEPTED = 1
    EXECUTING = 2
    CANCELING = 3
    SUCCEEDED = 4
    CANCELED = 5
    ABORTED = 6

    @property
    def is_over(self) -> bool:
        return self >= GoalStatus.SUCCEEDED

    @property
    def goes_on(self) -> bool:
        return GoalStatus.UNKNOWN < self < GoalStatus.SUCCEEDED


@dataclass(frozen=True, slots=True)
class Judged:
    """A server has accepted or rejected a goal."""

    goal: bytes
    accepted: bool


@dataclass(frozen=True, slots=True)
class Ended:
    """The result of a goal has come."""

    goal: bytes
    status: GoalStatus
    result: object


@dataclass(frozen=True, slots=True)
class Fed:
    """Feedback on a goal."""

    goal: bytes
    feedback: object


@dataclass(frozen=True, slots=True)
class CancelRefused:
    """A server will not cancel a goal; `unknown`: because it knows none such."""

    goal: bytes
    unknown: bool


@dataclass(frozen=True, slots=True)
class Statuses:
    """What a server says of all goals that it knows."""

    call: str
    goals: Mapping[bytes, GoalStatus]


@dataclass(frozen=True, slots=True)
class Answered:
    """The response to a request has come."""

    ticket: bytes
    response: object


@dataclass(frozen=True, slots=True)
class Broken:
    """A goal or request failed on its way, inside ROS."""

    goal: bytes
    why: str


Word = Judged | Ended | Fed | CancelRefused | Statuses | Answered | Broken


class Ear(Protocol):
    """A subscription that is looked at; nothing is called when a message comes."""

    def take(self) -> list[object]:
        """Return the newest messages since the last look, the oldest first, at most as many as asked for."""

    def close(self) -> None: ...


class RosPort(Protocol):
    """The way to ROS 2. Nothing here blocks; `words` has what came back, in order.

    Goals and requests go by an id of 16 bytes, which the caller chooses.
    """

    def servers(self, call: ActionCall | ServiceCall) -> frozenset[str]:
        """Return who serves a name now, empty if nobody does; a server that restarts is another one."""

    def send_goal(self, call: ActionCall, goal: bytes, fields: Mapping[str, Filling]) -> None:
        """Send a goal; `Judged` follows, then, if it was accepted, `Fed` and `Ended`.

        Raises
        ------
        AbsentError
            If a field is not there or takes no such value.
        """

    def cancel_goal(self, call: ActionCall, goal: bytes) -> None:
        """Ask for a goal to be cancelled, also one that another life of this process has sent."""

    def request(self, call: ServiceCall, ticket: bytes, fields: Mapping[str, Filling]) -> None:
        """Send a request; `Answered` follows. Raises as `send_goal` does."""

    def listen(self, topic: str, kind: str, qos: Qos, depth: int) -> Ear: ...

    def words(self) -> Sequence[Word]:
        """Return what has come since it was last asked."""
