"""Start the bridge beside a robot: ros2 launch turtle.launch.py socket:=/run/outcrop/turtle.sock."""

from __future__ import annotations

from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess
from launch.substitutions import LaunchConfiguration


def generate_launch_description() -> LaunchDescription:
    """Return the bridge as a process that is begun again whenever it ends."""
    bridge = ExecuteProcess(
        cmd=[
            *("outcrop", "rover", "ros2", str(Path(__file__).parent / "turtle.yaml")),
            *("--listen", ["unix:", LaunchConfiguration("socket")]),
            *("--out", LaunchConfiguration("out")),
        ],
        output="screen",
        respawn=True,
        respawn_delay=1.0,
    )
    return LaunchDescription(
        [
            DeclareLaunchArgument("socket", default_value="/tmp/turtle.sock"),
            DeclareLaunchArgument("out", default_value="/tmp/turtle-products"),
            bridge,
        ]
    )
