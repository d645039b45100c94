"""The bridge's way to ROS 2 by rclpy, the only module that knows it.

What is said and asked goes through one thread, which spins the node. Topics are not spun: their
subscriptions are looked at (`Ear.take`), so that a topic of 10,000 messages a second costs what one of two
costs, and the middleware drops the rest.
"""

from __future__ import annotations

import contextlib
import logging
import threading
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from rover_iface.errors import RosError
from rover_iface.ros2.goals import Filling
from rover_iface.ros2.mapping import ActionCall, Qos, Ros2Mapping, ServiceCall
from rover_iface.ros2.port import (
    Answered,
    Broken,
    CancelRefused,
    Ear,
    Ended,
    Fed,
    GoalStatus,
    Judged,
    Statuses,
    Word,
)
from rover_iface.ros2.ros_types import fill, misfits, ros_type

try:
    import rclpy
    from action_msgs.msg import GoalInfo, GoalStatusArray
    from action_msgs.srv import CancelGoal
    from rclpy.action import ActionClient
    from rclpy.context import Context
    from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
    from rclpy.parameter import Parameter
    from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
    from unique_identifier_msgs.msg import UUID
except ImportError as missing:
    raise RosError(
        f"the bridge needs rclpy, which comes with ROS 2 ({missing}); source its setup file first, for "
        "instance /opt/ros/jazzy/setup.bash, and use a Python that ROS is made for"
    ) from missing

logger = logging.getLogger(__name__)

NO_SUCH_GOAL = 2
IS_OVER = 3
"""Codes of action_msgs/CancelGoal."""
STATUS_DEPTH = 10
BEHIND = 10_000
"""Words that wait for a bridge that does not come; feedback beyond is dropped."""


def _qos(kind: Qos, depth: int) -> Any:
    reliable = kind != "sensor"
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if kind == "latched" else DurabilityPolicy.VOLATILE,
    )


class _Subscription:
    """A subscription that nobody spins."""

    def __init__(self, node: Any, kind: Any, topic: str, qos: Any, depth: int) -> None:
        self._node, self._depth = node, depth
        self._subscription = node.create_subscription(kind, topic, lambda _: None, qos)

    def take(self) -> list[object]:
        found: list[object] = []
        subscription = self._subscription
        with subscription.handle:
            while len(found) < self._depth:
                try:
                    taken = subscription.handle.take_message(subscription.msg_type, False)
                except Exception as err:  # noqa: BLE001 - a message that does not fit its type
                    logger.warning("a message cannot be read", extra={"why": str(err)[:200]})
                    break
                if taken is None:
                    break
                found.append(taken[0])
        return found

    def close(self) -> None:
        self._node.destroy_subscription(self._subscription)


class RosClock:
    """The clock of ROS in milliseconds: `/clock` where the mapping says so."""

    def __init__(self, node: Any) -> None:
        self._clock = node.get_clock()

    def now_ms(self) -> int:
        return int(self._clock.now().nanoseconds // 1_000_000)


class RclpyPort:
    """ROS 2 for one mapping.

    Parameters
    ----------
    arguments
        What `--ros-args` takes: remappings, a namespace, parameters.

    Raises
    ------
    RosError
        If a package is missing, or a type has no field that the mapping names.
    """

    def __init__(self, mapping: Ros2Mapping, arguments: Sequence[str] = ()) -> None:
        for wrong in misfits(mapping):
            raise RosError(wrong)
        self._words: deque[Word] = deque()
        self._context = Context()
        try:
            rclpy.init(args=["--ros-args", *arguments] if arguments else [], context=self._context)
        except Exception as err:
            raise RosError(f"ROS 2 does not start: {err}") from err
        sim = [Parameter("use_sim_time", value=mapping.sim_time)]
        self._node = rclpy.create_node(mapping.name, context=self._context, parameter_overrides=sim)
        self._listener = rclpy.create_node(
            f"{mapping.name}_listener",
            context=self._context,
            start_parameter_services=False,
            enable_rosout=False,
        )
        self.clock = RosClock(self._node)
        self._clients: dict[str, Any] = {}
        self._cancels: dict[str, Any] = {}
        for call in mapping.actions.values():
            if isinstance(call, ActionCall | ServiceCall) and call.name not in self._clients:
                self._open(call)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._spin, name="ros", daemon=True)
        self._thread.start()

    def _open(self, call: ActionCall | ServiceCall) -> None:
        kind = ros_type(call.type)
        if isinstance(call, ServiceCall):
            self._clients[call.name] = self._node.create_client(kind, call.name)
            return
        self._clients[call.name] = ActionClient(self._node, kind, call.name)
        self._cancels[call.name] = self._node.create_client(CancelGoal, f"{call.name}/_action/cancel_goal")
        take = partial(self._take_statuses, call.name)
        topic = f"{call.name}/_action/status"
        self._node.create_subscription(GoalStatusArray, topic, take, _qos("latched", STATUS_DEPTH))

    def _spin(self) -> None:
        while self._context.ok():
            try:
                self._executor.spin()
            except ExternalShutdownException:
                return
            except Exception:  # a server that speaks another type: ROS raises, and the others go on
                logger.exception("ROS raised an error")

    def close(self) -> None:
        """Leave ROS; goals that run go on."""
        with contextlib.suppress(Exception):
            self._executor.shutdown(timeout_sec=2)
            self._context.try_shutdown()
        self._thread.join(timeout=2)

    def _do(self, act: Callable[[], None]) -> None:
        """Let the thread of ROS do something: rclpy loses answers that come before it knows the question."""
        self._executor.create_task(act)

    def words(self) -> Sequence[Word]:
        return [self._words.popleft() for _ in range(len(self._words))]

    def listen(self, topic: str, kind: str, qos: Qos, depth: int) -> Ear:
        return _Subscription(self._listener, ros_type(kind), topic, _qos(qos, depth), depth)

    def servers(self, call: ActionCall | ServiceCall) -> frozenset[str]:
        client = self._clients[call.name]
        if isinstance(call, ServiceCall):
            return frozenset({call.name} if client.service_is_ready() else ())
        if not client.server_is_ready():
            return frozenset()
        topic = self._node.resolve_topic_name(f"{call.name}/_action/status")
        told = self._node.get_publishers_info_by_topic(topic)
        return frozenset(bytes(one.endpoint_gid).hex() for one in told)

    # --- goals --------------------------------------------------------------------------

    def send_goal(self, call: ActionCall, goal: bytes, fields: Mapping[str, Filling]) -> None:
        message = fill(ros_type(call.type).Goal(), fields, self._now())

        def send() -> None:
            try:
                future = self._clients[call.name].send_goal_async(
                    message,
                    feedback_callback=lambda told: self._take_feedback(goal, told),
                    goal_uuid=UUID(uuid=list(goal)),
                )
                future.add_done_callback(partial(self._judged, goal))
            except Exception as err:  # noqa: BLE001 - whatever the middleware raises is told by name
                self._words.append(Broken(goal, str(err)[:300]))

        self._do(send)

    def _judged(self, goal: bytes, future: Any) -> None:
        try:
            handle = future.result()
            self._words.append(Judged(goal, bool(handle.accepted)))
            if handle.accepted:
                handle.get_result_async().add_done_callback(partial(self._ended, goal))
        except Exception as err:  # noqa: BLE001 - as above
            self._words.append(Broken(goal, str(err)[:300]))

    def _ended(self, goal: bytes, future: Any) -> None:
        try:
            answer = future.result()
            self._words.append(Ended(goal, GoalStatus(answer.status), answer.result))
        except Exception as err:  # noqa: BLE001 - as above
            self._words.append(Broken(goal, str(err)[:300]))

    def _take_feedback(self, goal: bytes, told: Any) -> None:
        if len(self._words) < BEHIND:
            self._words.append(Fed(goal, told.feedback))

    def _take_statuses(self, name: str, told: Any) -> None:
        known = set(GoalStatus)
        goals = {
            bytes(one.goal_info.goal_id.uuid): GoalStatus(one.status)
            for one in told.status_list
            if one.status in known
        }
        if len(self._words) < BEHIND:
            self._words.append(Statuses(name, goals))

    def cancel_goal(self, call: ActionCall, goal: bytes) -> None:
        request = CancelGoal.Request(goal_info=GoalInfo(goal_id=UUID(uuid=list(goal))))

        def answered(future: Any) -> None:
            with contextlib.suppress(Exception):
                code = future.result().return_code
                if code not in (0, IS_OVER):
                    self._words.append(CancelRefused(goal, unknown=code == NO_SUCH_GOAL))

        self._do(lambda: self._cancels[call.name].call_async(request).add_done_callback(answered))

    # --- services -----------------------------------------------------------------------

    def request(self, call: ServiceCall, ticket: bytes, fields: Mapping[str, Filling]) -> None:
        message = fill(ros_type(call.type).Request(), fields, self._now())

        def answered(future: Any) -> None:
            try:
                self._words.append(Answered(ticket, future.result()))
            except Exception as err:  # noqa: BLE001 - as above
                self._words.append(Broken(ticket, str(err)[:300]))

        self._do(lambda: self._clients[call.name].call_async(message).add_done_callback(answered))

    def _now(self) -> Any:
        return self._node.get_clock().now().to_msg()
