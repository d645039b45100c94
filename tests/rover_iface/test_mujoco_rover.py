"""The rover in MuJoCo against mechanics: work, height, friction; and how its drives end."""

from __future__ import annotations

import math
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from executive.ports import Acknowledgement, Command, CommandId, Result
from rover_iface.contract import CHECKS, check_rover, write_contract_world
from rover_iface.errors import RoverError, WorldError
from rover_iface.frames import Pose
from rover_iface.mobility import settled_pose
from rover_iface.mujoco.model import HeightField
from rover_iface.mujoco.options import PilotOptions, VehicleOptions
from rover_iface.mujoco.rover import MujocoRover
from rover_iface.mujoco.vehicle import Vehicle
from rover_iface.profile import load_profile
from rover_iface.registry import find_rover
from rover_iface.simulator.faults import Fault, FaultKind
from rover_iface.terrain import Terrain
from tests.rover_iface.worlds import bumpy, plane

try:
    import mujoco  # noqa: F401
except ImportError:
    if os.environ.get("CI") == "true":
        raise
    pytest.skip("the package mujoco-core is not installed (extra mujoco)", allow_module_level=True)

make_rover = find_rover("mujoco")
K9 = load_profile("k9")
CERTAIN = VehicleOptions(friction_cv=0.0)


def rover_on(terrain: Terrain, *, heading: float = 0.0, **options: Any) -> MujocoRover:
    world = {"format": "world/1", "start": {"east_m": 0.0, "north_m": 0.0, "heading_rad": heading}}
    rover = make_rover(world, terrain=terrain, **{"vehicle": CERTAIN, **options})
    assert isinstance(rover, MujocoRover)
    return rover


def do(rover: MujocoRover, action: str, **parameters: Any) -> Result:
    rover.send(Command(CommandId("run", f"{action}-{rover.now_ms}", 1), action, parameters))
    while (event := rover.next_event(None)) is not None:
        if isinstance(event, Result):
            return event
    raise AssertionError(f"{action} never ended")


def blind(rover: MujocoRover, x: float, y: float = 0.0) -> Result:
    return do(rover, "navigate", x=x, y=y, mode="blind")


def wheel_slip(rover: MujocoRover) -> float:
    slips = [slip for _, _, slip in rover.odometry if slip is not None]
    return float(np.mean(slips[5:]))


def test_it_keeps_the_contract_of_all_rovers(tmp_path: Path) -> None:
    findings = check_rover(make_rover, write_contract_world(tmp_path))
    assert len(findings) == len(CHECKS)
    assert [f"{f.name}: {f.detail}" for f in findings if not f.passed] == []


@pytest.mark.parametrize("profile", ["k9", "mer"])
def test_it_stands_where_the_wheels_meet_the_ground(profile: str) -> None:
    def waves(x: Any, y: Any) -> Any:
        return 0.05 * np.sin(1.3 * x + 0.4) * np.cos(1.7 * y) + 0.1 * x

    ground = bumpy(waves, half=4.0)
    rover = load_profile(profile)
    field = HeightField.of(ground, (-4.0, -4.0, 4.0, 4.0), 0.05)
    for heading in (0.0, 0.8, 2.5):
        pose = Vehicle(rover, field, Pose(0.2, -0.3, 0.0, heading), 0.65, CERTAIN).pose
        expected = settled_pose(ground, rover, pose.x, pose.y, pose.heading)
        assert pose.z == pytest.approx(expected.z, abs=0.02)
        assert pose.pitch == pytest.approx(expected.pitch, abs=0.04)
        assert pose.roll == pytest.approx(expected.roll, abs=0.04)


def test_a_drive_over_level_ground_takes_what_speed_and_rolling_resistance_ask_for() -> None:
    rover = rover_on(plane())
    result = blind(rover, 3.0)
    assert result.success, result.reason
    assert math.hypot(rover.pose.x - 3.0, rover.pose.y) < 0.06
    assert result.t_ms / 1000 == pytest.approx(3.0 / K9.mobility.speed_m_s, rel=0.15)
    weight_n = K9.body.mass_kg * CERTAIN.gravity_m_s2
    rolling_j = CERTAIN.rolling_resistance * weight_n * 3.0
    electronics_j = CERTAIN.electronics_w * result.t_ms / 1000
    work_j = (float(result.values["energy_j"]) - electronics_j) * CERTAIN.drive_efficiency
    assert work_j == pytest.approx(rolling_j, rel=0.15)
    assert rover.energy_used_j == pytest.approx(
        float(result.values["energy_j"]) + K9.power.hotel_w * result.t_ms / 1000, rel=1e-6
    )


def test_a_slope_costs_the_height_and_makes_the_wheels_slip() -> None:
    work_j, slips = [], []
    for slope in (0.0, 0.2, 0.35):
        rover = rover_on(plane(slope, half=8.0))
        result = blind(rover, 2.5)
        assert result.success, result.reason
        electronics_j = CERTAIN.electronics_w * result.t_ms / 1000
        work_j.append((float(result.values["energy_j"]) - electronics_j) * CERTAIN.drive_efficiency)
        slips.append(wheel_slip(rover))
    weight_n = K9.body.mass_kg * CERTAIN.gravity_m_s2
    for work, slope in zip(work_j[1:], (0.2, 0.35), strict=True):
        gained_j = weight_n * 2.5 * slope
        assert gained_j < work - 0.8 * work_j[0] < 1.6 * gained_j
    assert slips[0] < slips[1] < slips[2]


def test_beyond_the_angle_of_friction_it_does_not_climb() -> None:
    steep = bumpy(lambda x, _y: math.tan(math.radians(22.0)) * np.maximum(x - 1.0, 0.0))
    result = blind(rover_on(steep, vehicle=VehicleOptions(friction=0.3, friction_cv=0.0)), 4.0)
    assert not result.success
    assert result.reason.startswith("wheels slip: they turned")
    assert blind(rover_on(steep, vehicle=VehicleOptions(friction=0.8, friction_cv=0.0)), 1.8).success


def test_weak_motors_stall_before_a_wall() -> None:
    wall = bumpy(lambda x, _y: np.where(x > 1.5, 0.4, 0.0))
    result = blind(rover_on(wall, vehicle=VehicleOptions(friction_cv=0.0, torque_reserve=0.8)), 4.0)
    assert not result.success
    assert result.reason.startswith("stalled: the wheels turned")
    assert float(result.values["error_m"]) > 2.0


def test_a_tilt_beyond_the_profile_ends_a_drive() -> None:
    # level at first, then a bank that rises to the left
    bank = bumpy(lambda x, y: 0.8 * np.clip(x - 0.8, 0.0, 1.0) * np.clip(y + 3.0, 0.0, 6.0) - 0.0)
    rover = rover_on(bank, vehicle=VehicleOptions(friction=1.2, friction_cv=0.0))
    result = blind(rover, 4.0)
    assert not result.success
    assert "deg is over the limit of 30.0 deg" in result.reason


def test_the_edge_of_the_known_ground_an_empty_battery_and_time_end_a_drive() -> None:
    result = blind(rover_on(plane(half=3.0)), 6.0)
    assert (result.success, result.reason[:13]) == (False, "the ground at")
    result = blind(rover_on(plane(), battery_j=1500.0), 6.0)
    assert (result.success, result.reason) == (False, "the battery is empty")
    hurried = PilotOptions(patience=0.2, patience_s=5.0)
    result = blind(rover_on(plane(), pilot=hurried), 6.0)
    assert not result.success
    assert result.reason.startswith("time limit of 25 s: ")


def test_it_turns_to_a_heading_and_by_more_than_half_a_turn() -> None:
    rover = rover_on(plane())
    assert do(rover, "turn", heading=-1.0).success
    assert rover.pose.heading == pytest.approx(-1.0, abs=0.05)
    before_ms = rover.now_ms
    result = do(rover, "turn", angle=3.6)
    assert result.success
    assert rover.pose.heading == pytest.approx(-1.0 + 3.6, abs=0.1)
    assert (rover.now_ms - before_ms) / 1000 > 3.6 / K9.mobility.turn_rate_rad_s * 0.9
    assert math.hypot(rover.pose.x, rover.pose.y) < 0.3


def test_an_aborted_drive_stands_where_it_was_then() -> None:
    whole = rover_on(plane(), pilot=PilotOptions(report_s=0.1))
    whole.send(Command(CommandId("run", "a", 1), "navigate", {"x": 4.0, "y": 1.0, "mode": "blind"}))
    while whole.now_ms < 8_400 and whole.next_event(8_400) is not None:
        pass
    cut = rover_on(plane())
    drive = CommandId("run", "a", 1)
    cut.send(Command(drive, "navigate", {"x": 4.0, "y": 1.0, "mode": "blind"}))
    while cut.now_ms < 8_400 and cut.next_event(8_400) is not None:
        pass
    cut.abort(drive)
    event = cut.next_event(None)
    assert isinstance(event, Acknowledgement)
    assert event.t_ms == 8_400
    assert math.hypot(cut.pose.x - whole.vehicle.pose.x, cut.pose.y - whole.vehicle.pose.y) < 0.007
    assert cut.pose == cut.vehicle.pose
    assert do(cut, "navigate", x=1.0, y=0.3, mode="blind").success, "it drives on after an abort"


def test_one_pair_of_wheels_takes_one_command() -> None:
    rover = rover_on(plane())
    rover.send(Command(CommandId("run", "a", 1), "navigate", {"x": 3.0, "y": 0.0, "mode": "blind"}))
    result = do(rover, "turn", angle=1.0)
    assert (result.success, result.reason) == (False, "the wheels are busy with another command")


def test_looks_cost_time_and_a_blind_drive_has_none() -> None:
    seen, unseen = rover_on(plane()), rover_on(plane())
    looking, blindly = do(seen, "navigate", x=2.0, y=0.0), blind(unseen, 2.0)
    looks = (looking.t_ms - blindly.t_ms) / 1000 / K9.activity("navigator_step").time_s().mean
    assert 2.0 < looks < 4.0


def test_faults_strike_the_dynamics() -> None:
    slippery = Fault(FaultKind.SLIP_BURST, at_s=0.0, amount=3.2)
    slow = Fault(FaultKind.SLOW_DRIVE, at_s=0.0, amount=2.0)
    slipped = blind(rover_on(plane(0.2), faults=[slippery]), 3.0)
    assert slipped.reason.startswith("wheels slip: they turned")
    assert blind(rover_on(plane(), faults=[slow]), 1.0).t_ms > 1.6 * 1000 / K9.mobility.speed_m_s
    result = blind(rover_on(plane(), faults=[Fault(FaultKind.STUCK_WHEEL, at_s=8.0)]), 3.0)
    assert (result.success, result.reason, result.t_ms // 1000) == (False, "wheel stuck", 8)


def test_a_seed_draws_the_grip_and_gives_the_same_drive_again() -> None:
    ground = bumpy(lambda x, y: 0.04 * np.sin(4 * x) * np.cos(5 * y))
    drives = []
    for seed in (3, 3, 4):
        rover = rover_on(ground, vehicle=VehicleOptions(), seed=seed)
        result = blind(rover, 1.5)
        drives.append((rover.vehicle.friction, rover.pose, result.t_ms, result.values))
    assert drives[0] == drives[1]
    assert drives[0][0] != drives[2][0]
    assert drives[0][1] != drives[2][1]


def test_what_is_missing_is_said_in_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(WorldError, match="has no terrain; a rover on terrain needs one"):
        make_rover({"format": "world/1"})
    with pytest.raises(RoverError, match="vehicle option friction is -1; it must be positive"):
        VehicleOptions(friction=-1)
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(RoverError, match=r"needs the package mujoco: pip install 'outcrop\[mujoco\]'"):
        rover_on(plane())
