"""A robot that speaks ROS 2 behind the wire, in a process of its own."""

from __future__ import annotations

import logging
import shlex
import signal
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from executive.runtime.clocks import MonotonicClock, SteadyClock
from executive.runtime.wire.address import Address, Keys, bound_address, listen
from executive.runtime.wire.server import About, RoverServer

if TYPE_CHECKING:
    from executive.ports import Clock
    from rover_iface.ros2.load import Mapped
    from rover_iface.ros2.rclpy_port import RclpyPort

logger = logging.getLogger(__name__)

CLOCK_S = 5.0
"""How long the first word on `/clock` may take."""


@dataclass(frozen=True, slots=True)
class Bridging:
    """Which mapping is served, where; `ros_args` is what follows `--ros-args`."""

    mapping: Path
    address: Address
    keys: Keys | None = None
    out: Path | None = None
    ros_args: str = ""


def check_mapping(path: Path) -> list[str]:
    """Return what can be said of a mapping, a line each; its types are looked at where ROS is here.

    Raises
    ------
    RoverError
        If the mapping is wrong.
    """
    from rover_iface.errors import RosError
    from rover_iface.ros2.load import load_mapping
    from rover_iface.ros2.ros_types import misfits

    mapped = load_mapping(path)
    mapping, language = mapped.mapping, mapped.language
    lines = [f"{path}: {mapping.name}, {len(mapping.actions)} actions, {len(mapping.telemetry)} topics"]
    lines += [f"not mapped: {name}" for name in language.commands.actions if name not in mapping.actions]
    if find_spec("rclpy") is None:
        return [*lines, "types: not looked at, rclpy is not here"]
    for wrong in misfits(mapping):
        raise RosError(f"{path}: {wrong}")
    return [*lines, "types: every field is there"]


def serve_ros2(bridging: Bridging, say: Callable[[str], None]) -> None:
    """Serve a robot until the process is interrupted; `say` is told in a line where it listens.

    Raises
    ------
    RoverError
        If the mapping is wrong, or ROS 2 or one of its packages is missing.
    WireError
        If the place is taken, or leads off the machine without keys.
    """
    from rover_iface.errors import RoverError
    from rover_iface.ros2.load import load_mapping
    from rover_iface.ros2.rclpy_port import RclpyPort
    from rover_iface.ros2.rover import RosRover

    mapped = load_mapping(bridging.mapping)
    try:
        ros_args = shlex.split(bridging.ros_args)
    except ValueError as err:
        raise RoverError(f"--ros-args {bridging.ros_args!r} cannot be split: {err}") from err
    port = RclpyPort(mapped.mapping, ros_args)
    try:
        with tempfile.TemporaryDirectory() as scratch:
            out, clock = bridging.out or Path(scratch), _clock(mapped, port)
            server = RoverServer(RosRover(mapped, port, clock, out=out), _about(mapped), clock, out=out)
            door = listen(bridging.address, bridging.keys)
            for number in (signal.SIGINT, signal.SIGTERM):
                signal.signal(number, lambda *_: server.stop_serving())
            say(f"{mapped.mapping.name} listens on {bound_address(bridging.address, door)}")
            try:
                server.serve(door, bridging.keys)
            finally:
                door.close()
                if bridging.address.path is not None:
                    bridging.address.path.unlink(missing_ok=True)
    finally:
        port.close()


def _about(mapped: Mapped) -> About:
    language = mapped.language
    dictionary = {"name": language.name, "version": language.version, "sha256": language.sha256}
    return About(mapped.mapping.name, mapped.mapping.rate if mapped.mapping.sim_time else 1.0, dictionary)


def _clock(mapped: Mapped, port: RclpyPort) -> Clock:
    if not mapped.mapping.sim_time:
        return MonotonicClock()
    end = time.monotonic() + CLOCK_S
    while port.clock.now_ms() == 0:
        if time.monotonic() > end:
            logger.warning("sim_time is set and nothing tells /clock: the rover's clock stands still")
            break
        time.sleep(0.05)
    return SteadyClock(port.clock, report=logger.warning)
