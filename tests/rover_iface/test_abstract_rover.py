"""The abstract rover: it lives in the planning problem, exactly."""

from __future__ import annotations

import json
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from executive.ports import Acknowledgement, Command, CommandId, CommandState, Product, Result, Update
from rover_iface.errors import WorldError
from rover_iface.simulator.abstract_rover import PICTURE_PX, AbstractRover, make_rover
from rover_iface.simulator.faults import Fault, FaultKind, load_faults
from rover_iface.simulator.faulty_hardware import FaultyHardware
from rover_iface.simulator.model import AbstractModel, Future, Noise
from rover_iface.simulator.world import load_world
from tests.rover_iface.worlds import generated, says_what_it_drew, small_problem
from tests.shared import shared

COUNT = iter(range(10**9))


def command(action: str, **parameters: Any) -> Command:
    metadata = {"observation": parameters.pop("observation")} if "observation" in parameters else {}
    return Command(CommandId("run", f"t{next(COUNT)}", 1), action, parameters, metadata)


def do(rover: AbstractRover, action: str, **parameters: Any) -> Result:
    wanted = command(action, **parameters)
    rover.send(wanted)
    while True:
        event = rover.next_event(None)
        assert event is not None
        if isinstance(event, Result) and event.command == wanted.id:
            return event


def fixed(**changes: Any) -> dict[str, Any]:
    """A future in which all is as planned: means, nothing lost, every coin a success."""
    model = AbstractModel.from_problem(small_problem())
    n, m = 3, 3
    future = {
        "leg_time_s": np.nan_to_num(model.leg_time_s[..., 0]),
        "leg_energy_j": np.nan_to_num(model.leg_energy_j[..., 0]),
        "leg_loss_u": np.ones((n, n, n)),
        "obs_time_s": np.full(m, 100.0),
        "obs_energy_j": np.full(m, 100.0),
        "obs_success_u": np.zeros(m),
    }
    return future | changes


def rover(**changes: Any) -> AbstractRover:
    return make_rover(small_problem(), draws=fixed(**changes))


def test_the_first_event_is_the_state_at_time_zero() -> None:
    event = rover().next_event(0)
    assert isinstance(event, Update)
    assert event.t_ms == 0
    assert event.values["energy-used"] == 0.0
    assert event.values["battery-energy"] == 400000.0
    assert event.values["trackerstate T1"] == "idle"
    assert event.values["pose heading"] == 0.0
    assert event.values["range T1"] == 5.0


def test_a_day_takes_the_time_and_energy_of_its_draws_to_the_millisecond() -> None:
    r = rover()
    assert do(r, "trackstart", target="T1").t_ms == 20_000
    leg = do(r, "navigate", target="T1")
    assert leg.t_ms == 20_000 + 600_000 + 45_000
    assert leg.updates["energy-used"] == 200.0 + 50000.0 + 38.0 * 665.0
    assert leg.updates["range T1"] == pytest.approx(0.8)
    placed = do(r, "ipplaceinstrument", target="T1")
    assert placed.success
    assert placed.values["made"] is True
    assert placed.updates["trackerstate T1"] == "idle"
    assert placed.t_ms == 765_000
    assert do(r, "navigate", target="T1").t_ms == 765_000


def test_every_action_says_what_it_drew_from_the_battery() -> None:
    r = rover()
    on_targets = ["trackstart", "navigate", "handoff", "ipplaceinstrument"]
    results = [do(r, action, target="T1") for action in on_targets]
    results += [do(r, action) for action in ("image", "imagepanorama", "downlink")]
    results += [do(r, "turn", angle=0.5), do(r, "heat", duration_s=60.0), do(r, "navigate", x=1.0, y=0.0)]
    says_what_it_drew(r, results)


def test_a_target_is_lost_iff_its_number_is_below_its_chance() -> None:
    for u, state in ((0.29999, "lost"), (0.3, "tracked")):
        loss = np.ones((3, 3, 3))
        loss[0, 1, 2] = u
        r = rover(leg_loss_u=loss)
        do(r, "trackstart", target="T2")
        do(r, "navigate", target="T1")
        assert r.get("trackerstate T2") == state


def test_a_drive_that_fails_is_back_and_its_target_is_not_driven_to_again() -> None:
    problem = small_problem()
    problem["format"] = "problem/2"
    for leg in problem["legs"]:
        leg["p_fail"] = 0.4 if leg["from"] == "start" and leg["to"] == "T1" else 0.0
    numbers = np.zeros((3, 3))
    numbers[0, 1] = 0.39
    r = make_rover(problem, draws=fixed(leg_fail_u=numbers))
    with pytest.raises(WorldError, match='"leg_fail_u" is missing'):
        make_rover(problem, draws=fixed())
    begun = r.pose
    first = do(r, "navigate", target="T1")
    assert (first.success, first.reason) == (False, "no way through")
    assert first.t_ms == 1000 * r.model.leg_time_s[0, 1, 0]
    assert first.values["energy_j"] == r.model.leg_energy_j[0, 1, 0]
    assert (r.pose.x, r.pose.y) == pytest.approx((begun.x, begun.y))
    assert r.place == 0
    for action, target, reason in (
        ("navigate", "T1", "a drive to T1 failed before"),
        ("trackstart", "T2", "a drive was tried already"),
    ):
        refused = do(r, action, target=target)
        assert (refused.success, refused.reason, refused.t_ms) == (False, reason, first.t_ms)
    assert do(r, "navigate", target="T2").success
    numbers[0, 1] = 0.4
    assert do(make_rover(problem, draws=fixed(leg_fail_u=numbers)), "navigate", target="T1").success


def test_a_lost_coin_fails_the_action_but_the_observation_is_made() -> None:
    r = rover(obs_success_u=np.array([0.9, 0.0, 0.0]))
    do(r, "trackstart", target="T1")
    do(r, "navigate", target="T1")
    placed = do(r, "ipplaceinstrument", target="T1")
    assert not placed.success
    assert placed.reason == "no usable product"
    assert placed.values["made"] is True
    again = do(r, "ipplaceinstrument", target="T1")
    assert "was made before" in again.reason
    assert again.t_ms == placed.t_ms


@pytest.mark.parametrize(
    ("before", "action", "parameters", "reason"),
    [
        ([], "ipplaceinstrument", {"target": "T1"}, "not at the observation point"),
        ([("navigate", {"target": "T1"})], "ipplaceinstrument", {"target": "T1"}, "is not tracked"),
        ([("navigate", {"target": "T1"})], "trackstart", {"target": "T1"}, "not at the start"),
        ([("trackstart", {"target": "T1"})], "trackstart", {"target": "T1"}, "already tracked"),
        ([], "navigate", {"target": "T2", "require_tracked": True}, "target T2 is not tracked"),
        ([], "navigate", {"target": "T7"}, "unknown target"),
        (
            [("trackstart", {"target": "T2"}), ("navigate", {"target": "T2"})],
            "ipplaceinstrument",
            {"target": "T2"},
            "must wait for another",
        ),
        ([], "navigate", {}, "target or x and y is needed"),
        ([], "navigate", {"target": "T1", "speed": 3}, 'unknown parameter "speed"'),
        ([], "dance", {}, 'unknown action "dance"'),
        ([], "wait", {}, 'parameter "duration_s" is missing'),
    ],
)
def test_what_cannot_be_done_fails_at_once_without_time_or_energy(
    before: list[tuple[str, dict[str, Any]]], action: str, parameters: dict[str, Any], reason: str
) -> None:
    r = rover()
    for name, given_ in before:
        assert do(r, name, **given_).success
    now, used = r.now_ms, r.energy_used_j
    result = do(r, action, **parameters)
    assert not result.success
    assert reason in result.reason
    assert (r.now_ms, r.energy_used_j) == (now, used)


def test_an_observation_is_chosen_by_its_id_else_by_kind() -> None:
    r = rover()
    do(r, "navigate", target="T1")
    assert do(r, "image", target="T1", observation="T1-img").success
    assert not do(r, "image", target="T1").success


def test_a_repeat_of_a_command_is_ignored() -> None:
    r = rover()
    wanted = command("wait", duration_s=5)
    assert r.status(wanted.id).state is CommandState.UNKNOWN
    r.send(wanted)
    r.send(wanted)
    assert r.status(wanted.id).state is CommandState.RUNNING
    events = []
    while (event := r.next_event(None)) is not None:
        events.append(event)
    r.send(wanted)
    assert r.next_event(None) is None
    results = [e for e in events if isinstance(e, Result)]
    assert len(results) == 1
    assert r.status(wanted.id).result == results[0]


def test_two_actions_run_side_by_side() -> None:
    r = rover()
    r.next_event(0)
    drive, wait = command("navigate", target="T1"), command("wait", duration_s=30)
    r.send(drive)
    r.send(wait)
    first, second = r.next_event(None), r.next_event(None)
    assert isinstance(first, Result)
    assert isinstance(second, Result)
    assert (first.command, first.t_ms) == (wait.id, 30_000)
    assert (second.command, second.t_ms) == (drive.id, 600_000)


def test_an_abort_stops_the_drive_where_it_is_and_is_acknowledged_at_once() -> None:
    r = rover()
    r.next_event(0)
    drive = command("navigate", target="T1")
    r.send(drive)
    assert r.next_event(300_000) is None
    r.abort(drive.id)
    event = r.next_event(300_000)
    assert isinstance(event, Acknowledgement)
    assert event.t_ms == 300_000
    assert event.updates["pose x"] == pytest.approx(2.1)
    assert event.updates["energy-used"] == pytest.approx(25_000 + 38 * 300)
    assert r.next_event(None) is None
    rest = do(r, "navigate", target="T1")
    assert rest.t_ms == 600_000
    assert rest.updates["energy-used"] == pytest.approx(50_000 + 38 * 600)


def test_a_result_that_is_on_its_way_is_not_aborted() -> None:
    r = rover()
    r.next_event(0)
    wanted = command("wait", duration_s=0)
    r.send(wanted)
    r.abort(wanted.id)
    assert isinstance(r.next_event(0), Result)
    assert r.next_event(None) is None


def test_progress_reports_walk_along_the_route() -> None:
    r = make_rover(small_problem(), draws=fixed(), progress_s=100.0)
    r.next_event(0)
    r.send(command("navigate", target="T1"))
    poses = []
    while (event := r.next_event(None)) is not None:
        if isinstance(event, Update):
            poses.append((event.t_ms, event.values["pose x"], event.values["energy-used"]))
    assert [t for t, _, _ in poses] == [100_000, 200_000, 300_000, 400_000, 500_000]
    assert [x for _, x, _ in poses] == pytest.approx([0.7, 1.4, 2.1, 2.8, 3.5])
    assert r.energy_used_j == 50000.0 + 38 * 600.0


def test_progress_at_bends_says_as_much_as_progress_all_the_time() -> None:
    """A line between its few reports goes through every report of a pose each 5 s."""
    problem = small_problem()
    for leg in problem["legs"]:
        if (leg["from"], leg["to"]) == ("start", "T1"):
            leg["route"] = [[0.0, 0.0], [2.0, 1.5], [2.0, 3.0], [4.2, 0.0]]

    def reports(at_bends: bool) -> list[tuple[float, float, float, float, float]]:
        world = {"format": "world/1", "problem": problem, "progress_at_bends": at_bends}
        r = make_rover(world, draws=fixed(), progress_s=5.0)
        r.next_event(0)
        found = [(0.0, 0.0, 0.0, 0.0, 0.0)]
        state: dict[str, Any] = {}
        r.send(command("navigate", target="T1"))
        while (event := r.next_event(None)) is not None:
            state |= event.values if isinstance(event, Update) else getattr(event, "updates", {})
            keys = ("pose x", "pose y", "pose heading", "energy-used")
            x, y, heading, used = (float(state.get(key, 0.0)) for key in keys)
            found.append((event.t_ms / 1000, x, y, heading, used))
        return found

    full, few = np.array(reports(False)), np.array(reports(True))
    assert len(full) > 100
    assert len(few) <= 8
    for column in (1, 2, 4):
        between = np.interp(full[:, 0], few[:, 0], few[:, column])
        assert between == pytest.approx(full[:, column], abs=1e-6 * np.abs(full[:, column]).max())
    near = np.min(np.abs(full[:, :1] - few[None, :, 0]), axis=1) <= 5.0
    heading = np.interp(full[:, 0], few[:, 0], few[:, 3])
    assert heading[~near] == pytest.approx(full[~near, 3])


def test_until_moves_the_clock_and_no_event_is_early() -> None:
    r = rover()
    r.next_event(0)
    assert r.next_event(7_000) is None
    assert r.now_ms == 7_000
    assert do(r, "wait", duration_s=1).t_ms == 8_000


def test_the_same_seed_gives_the_same_day_and_another_seed_another() -> None:
    def day(seed: int) -> list[int]:
        r = make_rover(small_problem(), seed=seed)
        return [do(r, "navigate", target=t).t_ms for t in ("T1", "T2", "T1")]

    assert day(1) == day(1)
    assert day(1) != day(2)


def test_seeded_draws_have_the_mean_and_spread_of_the_problem() -> None:
    model = AbstractModel.from_problem(small_problem())
    legs = np.array([Future.draw(model, s).leg_time_s[0, 1] for s in range(4000)])
    assert legs.mean() == pytest.approx(600, rel=0.02)
    assert legs.std() == pytest.approx(200, rel=0.06)
    assert np.array_equal(legs, np.round(legs, 3))


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**31), st.permutations(["T1", "T2"]), st.booleans())
def test_a_day_agrees_with_the_rules_written_down_by_hand(seed: int, order: list[str], track: bool) -> None:
    problem = small_problem()
    model = AbstractModel.from_problem(problem)
    future = Future.draw(model, seed)
    r = AbstractRover(model, future)
    t, g, here = 0, 0.0, 0
    tracked: set[int] = set()
    if track:
        for k in (1, 2):
            assert do(r, "trackstart", target=f"T{k}").success
            t, g = t + 20_000, g + 200.0
            tracked.add(k)
    for target in order:
        k = int(target[1])
        result = do(r, "navigate", target=target)
        t += round(future.leg_time_s[here, k] * 1000) + 45_000 * len(tracked)
        g += future.leg_energy_j[here, k]
        tracked -= {i for i in tracked if future.leg_loss_u[here, k, i] < model.p_lose[here, k, i]}
        here = k
        assert result.t_ms == t
        assert r.get("energy-used") == g + 38.0 * (t / 1000.0)
        assert {i for i in (1, 2) if r.get(f"trackerstate T{i}") == "tracked"} == tracked


def test_products_are_written_labelled_and_hashed(tmp_path: Path) -> None:
    import hashlib

    from PIL import Image

    ground = generated()
    r = make_rover(small_problem(), draws=fixed(), out=tmp_path, terrain=ground)
    do(r, "trackstart", target="T1")
    do(r, "navigate", target="T1")
    wanted = command("ipplaceinstrument", target="T1", observation="T1-mi")
    r.send(wanted)
    product, result = r.next_event(None), r.next_event(None)
    assert isinstance(product, Product)
    assert isinstance(result, Result)
    assert product.t_ms == result.t_ms
    path = tmp_path / product.path
    assert hashlib.sha256(path.read_bytes()).hexdigest() == product.sha256
    label = json.loads((tmp_path / (product.path + ".json")).read_text())
    assert label["target"] == "T1"
    assert label["observation"] == "T1-mi"
    assert label["pose"]["frame"] == "site"
    assert label["task"] == wanted.id.task
    assert Image.open(path).size == (PICTURE_PX, PICTURE_PX)
    assert result.values["products"] == 1.0


# ---- faults


def test_a_target_is_lost_at_a_time_or_at_a_task() -> None:
    r = make_rover(
        small_problem(), draws=fixed(), faults=[Fault(FaultKind.LOSE_TARGET, at_s=100, target="T1")]
    )
    do(r, "trackstart", target="T1")
    r.send(command("navigate", target="T1"))
    event = r.next_event(None)
    assert isinstance(event, Update)
    assert event.t_ms == 100_000
    assert event.values["trackerstate T1"] == "lost"
    r = make_rover(
        small_problem(), draws=fixed(), faults=load_faults([{"kind": "stuck-wheel", "task": "go"}])
    )
    r.next_event(0)
    r.send(Command(CommandId("run", "go", 1), "navigate", {"target": "T1"}))
    event = r.next_event(None)
    assert isinstance(event, Result)
    assert event.reason == "wheel stuck"


def test_slow_drive_low_battery_camera_failure_and_silence() -> None:
    r = make_rover(small_problem(), draws=fixed(), faults=[Fault(FaultKind.SLOW_DRIVE, at_s=0, amount=2.0)])
    assert do(r, "navigate", target="T1").t_ms == 1_200_000
    r = make_rover(
        small_problem(), draws=fixed(), faults=[Fault(FaultKind.LOW_BATTERY, at_s=1, amount=500.0)]
    )
    do(r, "wait", duration_s=2)
    assert r.get("battery-energy") == pytest.approx(500 - 38)
    r = make_rover(small_problem(), draws=fixed(), faults=[Fault(FaultKind.CAMERA_FAILURE, at_s=0)])
    assert not do(r, "imagepanorama").success
    r = make_rover(small_problem(), draws=fixed(), faults=[Fault(FaultKind.SILENT, at_s=10)])
    r.next_event(0)
    wanted = command("wait", duration_s=20)
    r.send(wanted)
    assert r.next_event(100_000) is None
    r.abort(wanted.id)
    assert isinstance(r.next_event(None), Acknowledgement)


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ({"kind": "gremlin", "at_s": 1}, "faults[0].kind is \"gremlin\"; it must be 'lose-target'"),
        ({"kind": "silent"}, 'exactly one of "at_s" and "task"'),
        ({"kind": "silent", "at_s": -1}, "faults[0].at_s is -1; it must be at least 0"),
        ({"kind": "lose-target", "at_s": 1}, '"target" is missing'),
        ({"kind": "slow-drive", "at_s": 1}, '"amount" is missing'),
        ({"kind": "slow-drive", "at_s": 1, "amount": 0.5}, "a factor of at least 1"),
        ({"kind": "silent", "at_s": "noon"}, 'faults[0].at_s must be a number, found "noon"'),
        ({"kind": "silent", "at_s": 1, "why": "?"}, "faults[0].why is not a known member"),
        ("silent", 'faults[0] must be an object, found "silent"'),
    ],
)
def test_a_malformed_fault_is_refused(fault: object, message: str) -> None:
    with pytest.raises(WorldError) as caught:
        load_faults([fault])
    assert message in str(caught.value)


# ---- worlds


def test_a_world_of_targets_alone_is_a_problem_too(tmp_path: Path) -> None:
    world = {
        "format": "world/1",
        "name": "w",
        "targets": [{"id": "A", "point_m": [3, 0, 0], "observation_point": {"east_m": 2.2, "north_m": 0}}],
    }
    (tmp_path / "world.json").write_text(json.dumps(world))
    r = make_rover(tmp_path, seed=1)
    do(r, "trackstart", target="A")
    assert do(r, "navigate", target="A").success
    assert r.get("pose x") == 2.2


def test_a_world_of_before_with_notes_on_targets_and_poses_opens() -> None:
    stand = {"east_m": 2.2, "north_m": 0, "frame": "site"}
    target = {"id": "A", "point_m": [3, 0, 0], "colour": "red", "observation_point": stand}
    world = load_world({"format": "world/1", "start": {**stand, "up_m": 0.1}, "targets": [target]})
    assert (world.start.x, world.targets[0].observation_point) == (2.2, world.start)


def test_dust_before_a_target_that_the_world_does_not_have_is_no_fault_of_the_program() -> None:
    hardware: Any = SimpleNamespace(_dusty=set(), body=SimpleNamespace(targets={"T1": None}))
    for name in ("T1", "nobody"):
        assert FaultyHardware.strike(hardware, Fault(FaultKind.LENS_DUST, at_s=0.0, target=name))
    assert hardware._dusty == {"T1"}


@pytest.mark.parametrize(
    ("world", "message"),
    [
        ({"format": "moon/1"}, '"moon/1"; it must be "world/1"'),
        ({"format": "world/1", "colour": "red"}, "colour is not a known member"),
        ({"format": "world/1", "start": [0, 0]}, "start must be an object, found [0, 0]"),
        ({"format": "world/1", "targets": [{"id": "A"}]}, "targets[A].point_m is missing"),
        ({"format": "world/1", "soil": {"colour": 1}}, "soil.colour is not a known member"),
        ({"format": "world/1", "seed": "x"}, 'seed must be a whole number, found "x"'),
        ({"format": "problem/1", "name": "x"}, "malformed member"),
        ("nowhere.json", "No such file"),
    ],
)
def test_a_malformed_world_is_refused(world: Any, message: str) -> None:
    with pytest.raises(WorldError) as caught:
        make_rover(world)
    assert message in str(caught.value)


def test_draws_of_another_shape_are_refused() -> None:
    with pytest.raises(WorldError, match=r'"leg_time_s" has shape \(2, 2\); the problem needs \(3, 3\)'):
        make_rover(small_problem(), draws=fixed(leg_time_s=np.zeros((2, 2))))
    with pytest.raises(WorldError, match='"obs_success_u" is missing'):
        make_rover(small_problem(), draws={k: v for k, v in fixed().items() if k != "obs_success_u"})


def test_the_public_instances_are_worlds() -> None:
    folder = shared("contingency/instances")
    for path in sorted(folder.glob("*.json")):
        r = make_rover(path, seed=5)
        target = r.model.targets[0]
        assert do(r, "navigate", target=target).success
        assert math.isfinite(r.energy_used_j)


def test_other_actions_take_the_time_of_the_profile() -> None:
    r = rover()
    assert do(r, "stow").t_ms == 45_000
    assert do(r, "heat", duration_s=10).t_ms == 55_000
    turned = do(r, "turn", heading=math.pi / 2)
    assert turned.updates["pose heading"] == pytest.approx(math.pi / 2)
    free = do(r, "navigate", x=3.0, y=4.0, standoff_m=1.0)
    assert free.values["distance_m"] == pytest.approx(4.0)
    assert r.get("pose y") == pytest.approx(3.2)
    before = r.battery_j
    charged = do(r, "recharge", duration_s=600)
    assert r.battery_j - before == pytest.approx((120 - 38) * 600)
    assert charged.values["charged_j"] == pytest.approx(120 * 600)
    assert do(r, "pointmast", azimuth=0.0, elevation=0.1).success
    assert not do(r, "handoff", target="T1").success


def test_the_kind_of_sol_is_drawn_and_multiplies_what_it_says() -> None:
    problem = small_problem()
    problem["format"] = "problem/2"
    problem["sol_kinds"] = [
        {"name": "slow", "p": 0.3, "drive_time_factor": 2.0, "drive_energy_factor": 1.5},
        {"name": "cold", "p": 0.2, "energy_factor": 3.0},
    ]
    plain, model = AbstractModel.from_problem(small_problem()), AbstractModel.from_problem(problem)
    counts = [0, 0, 0]
    for seed in range(600):
        noise = Noise.draw(model, seed)
        kind = model.sols.kind(noise.sol_u)
        counts[2 if kind is None else kind] += 1
        if seed < 40:
            usual, found = Noise.draw(plain, seed).future(plain), noise.future(model)
            drive_s, drive_j, every_j = {0: (2.0, 1.5, 1.0), 1: (1.0, 3.0, 3.0), None: (1.0, 1.0, 1.0)}[kind]
            assert found.leg_time_s == pytest.approx(drive_s * usual.leg_time_s, abs=2e-3)
            assert found.leg_energy_j == pytest.approx(drive_j * usual.leg_energy_j, abs=2e-3)
            assert found.obs_time_s == pytest.approx(usual.obs_time_s)
            assert found.obs_energy_j == pytest.approx(every_j * usual.obs_energy_j, abs=2e-3)
            assert found.energy_factor == pytest.approx([every_j])
    assert np.array(counts) / 600 == pytest.approx([0.3, 0.2, 0.5], abs=0.06)
    cold = fixed(energy_factor=np.array([3.0]))
    with pytest.raises(WorldError, match='"energy_factor" is missing'):
        make_rover(problem, draws=fixed())
    r = make_rover(problem, draws=cold)
    placed = do(r, "trackstart", target="T1")
    assert placed.values["energy_j"] == 600.0
    assert r.get("energy-used") == pytest.approx(600.0 + 3.0 * 38.0 * 20.0)


def test_kinds_whose_chances_sum_to_one_leave_no_ordinary_sol() -> None:
    problem = small_problem()
    problem["format"] = "problem/2"
    problem["sol_kinds"] = [{"name": name, "p": p} for name, p in (("a", 1 / 6), ("b", 2 / 3), ("c", 1 / 6))]
    model = AbstractModel.from_problem(problem)
    assert None not in {model.sols.kind(Noise.draw(model, seed).sol_u) for seed in range(200)}
