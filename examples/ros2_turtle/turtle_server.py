"""A robot that behaves as one with Nav2 does, without a world: python turtle_server.py [--speed M_S].

It serves NavigateToPose and FollowWaypoints (nav2_msgs), a lamp (std_srvs), and tells odometry, battery,
diagnostics and a camera. Goals beyond 900 m are rejected, those beyond 90 m given up after a moment.
"""

from __future__ import annotations

import argparse
import contextlib
import math
import threading
import time
from collections.abc import Sequence
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from nav2_msgs.action import FollowWaypoints, NavigateToPose
from nav_msgs.msg import Odometry
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import BatteryState, Image
from std_srvs.srv import SetBool

TICK_S = 0.02


class Turtle(Node):
    """Drives straight to wherever it is told, at one speed."""

    def __init__(self, speed_m_s: float) -> None:
        super().__init__("turtle_server")
        self.speed_m_s, self.x, self.y, self.heading, self.moves = speed_m_s, 0.0, 0.0, 0.0, False
        self.left = 1.0
        self.lock = threading.Lock()
        group = ReentrantCallbackGroup()
        asked = {"goal_callback": self.judge, "cancel_callback": lambda _: CancelResponse.ACCEPT}
        ActionServer(self, NavigateToPose, "/navigate_to_pose", self.navigate, callback_group=group, **asked)
        ActionServer(self, FollowWaypoints, "/follow_waypoints", self.follow, callback_group=group, **asked)
        self.create_service(SetBool, "/lamp", self.switch)
        self.told = {
            "odom": self.create_publisher(Odometry, "/odom", 10),
            "battery": self.create_publisher(BatteryState, "/battery_state", 10),
            "camera": self.create_publisher(Image, "/camera/image_raw", 10),
            "diagnostics": self.create_publisher(DiagnosticArray, "/diagnostics", 10),
        }
        self.create_timer(0.05, self.tell, callback_group=group)

    def judge(self, goal: Any) -> GoalResponse:
        """Reject what lies too far."""
        poses = getattr(goal, "poses", None) or [goal.pose]
        self.get_logger().info("a goal has come")
        far = max(math.hypot(p.pose.position.x, p.pose.position.y) for p in poses)
        return GoalResponse.REJECT if far > 900 else GoalResponse.ACCEPT

    def navigate(self, handle: Any) -> object:
        """Carry out one goal."""
        return self.through(handle, [handle.request.pose], NavigateToPose)

    def follow(self, handle: Any) -> object:
        """Carry out several."""
        return self.through(handle, handle.request.poses, FollowWaypoints)

    def through(self, handle: Any, poses: Sequence[Any], kind: Any) -> object:
        """Drive through places until the last, a cancel or a failure."""
        result = kind.Result()
        for count, pose in enumerate(poses):
            while True:
                left = self.step(pose.pose.position.x, pose.pose.position.y)
                if handle.is_cancel_requested:
                    self.moves = False
                    self.get_logger().info("stopped")
                    handle.canceled()
                    return result
                if math.hypot(pose.pose.position.x, pose.pose.position.y) > 90:
                    self.moves = False
                    result.error_code, result.error_msg = 208, "no path to the goal"
                    handle.abort()
                    return result
                if left < 1e-3:
                    break
                feedback = kind.Feedback()
                if hasattr(feedback, "distance_remaining"):
                    feedback.distance_remaining = left
                else:
                    feedback.current_waypoint = count
                handle.publish_feedback(feedback)
                time.sleep(TICK_S)
        self.moves = False
        handle.succeed()
        return result

    def step(self, x: float, y: float) -> float:
        """Move on, and return how far it still is, metres."""
        with self.lock:
            dx, dy = x - self.x, y - self.y
            left = math.hypot(dx, dy)
            share = min(1.0, self.speed_m_s * TICK_S / max(left, 1e-9))
            self.x, self.y, self.moves = self.x + dx * share, self.y + dy * share, left > 1e-3
            if left > 1e-3:
                self.heading = math.atan2(dy, dx)
            return left * (1 - share)

    def switch(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        """Switch the lamp, which only goes on."""
        response.success = bool(request.data)
        response.message = "on" if request.data else "the switch is stuck"
        return response

    def tell(self) -> None:
        """Tell everything there is to tell."""
        odom = Odometry()
        odom.header.frame_id, odom.header.stamp = "map", self.get_clock().now().to_msg()
        odom.pose.pose.position.x, odom.pose.pose.position.y = self.x, self.y
        odom.pose.pose.orientation.z = math.sin(self.heading / 2)
        odom.pose.pose.orientation.w = math.cos(self.heading / 2)
        odom.twist.twist.linear.x = self.speed_m_s if self.moves else 0.0
        self.told["odom"].publish(odom)
        self.left = max(0.0, self.left - 1e-5)
        self.told["battery"].publish(BatteryState(percentage=self.left))
        image = Image(height=2, width=3, encoding="rgb8", step=9, data=bytes(range(18)))
        image.header = odom.header
        self.told["camera"].publish(image)
        status = DiagnosticStatus(level=DiagnosticStatus.OK, name="base", message="fine")
        self.told["diagnostics"].publish(DiagnosticArray(status=[status]))


def main() -> None:
    """Run until interrupted."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--speed", type=float, default=0.5)
    given, _ = parser.parse_known_args()
    rclpy.init()
    turtle = Turtle(given.speed)
    executor = MultiThreadedExecutor(4)
    executor.add_node(turtle)
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        executor.spin()


if __name__ == "__main__":
    main()
