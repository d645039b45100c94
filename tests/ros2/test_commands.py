"""Commands as goals of ROS 2: each way in which one can end has its name, and none is told twice."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace

import pytest

from executive.ports import Acknowledgement, CommandState, Product, Result, Update
from rover_iface.ros2.port import Answered, Broken, CancelRefused, Ended, Fed, GoalStatus, Judged, Statuses
from rover_iface.ros2.poses import RosPose
from tests.ros2.fakes import Bench, message, odometry


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path)


def answers(bench: Bench) -> list[Result | Acknowledgement]:
    return [e for e in bench.heard if isinstance(e, Result | Acknowledgement)]


def only_answer(bench: Bench) -> Result:
    (answer,) = answers(bench)
    assert isinstance(answer, Result)
    return answer


def test_a_goal_that_succeeds_is_a_result(bench: Bench) -> None:
    command = bench.send("navigate", x=3.0, y=4.0, heading=1.0)
    ((name, goal, fields),) = bench.port.sent
    assert name == "/navigate_to_pose"
    pose = fields["pose"]
    assert isinstance(pose, RosPose)
    assert (pose.frame, pose.position) == ("map", (3.0, 4.0, 0.0))
    assert pose.quaternion == pytest.approx((math.cos(0.5), 0, 0, math.sin(0.5)))
    bench.accept()
    assert bench.rover.status(command).state is CommandState.RUNNING
    bench.end(goal, GoalStatus.SUCCEEDED)
    assert only_answer(bench).success
    assert bench.rover.status(command).result == only_answer(bench)


def test_without_a_heading_it_looks_the_way_it_goes(bench: Bench) -> None:
    bench.port.ears["/odom"].waiting = [odometry(1.0, 1.0)]
    bench.turn(after_s=1)
    bench.send("navigate", x=1.0, y=5.0)
    pose = bench.port.sent[-1][2]["pose"]
    assert isinstance(pose, RosPose)
    assert 2 * math.atan2(pose.quaternion[3], pose.quaternion[0]) == pytest.approx(math.pi / 2)


def test_a_route_becomes_poses(bench: Bench) -> None:
    bench.send("patrol", route="1 0; 1 2; 0 2 3.0")
    poses = bench.port.sent[-1][2]["poses"]
    assert isinstance(poses, tuple)
    assert [p.position[:2] for p in poses] == [(1, 0), (1, 2), (0, 2)]
    headings = [2 * math.atan2(p.quaternion[3], p.quaternion[0]) for p in poses]
    assert headings == pytest.approx([0.0, math.pi / 2, 3.0])


@pytest.mark.parametrize(
    "route",
    ["", "1", "1 2 3 4", "1 a", "1 nan", "1 2;;", pytest.param("1 2; " * 1001 + "1 2", id="1002 places")],
)
def test_a_route_that_is_none_is_malformed(bench: Bench, route: str) -> None:
    bench.send("patrol", route=route)
    bench.turn()
    assert only_answer(bench).reason.startswith("malformed: ")
    assert bench.port.sent == []


@pytest.mark.parametrize(
    ("status", "reason"),
    [
        (
            GoalStatus.ABORTED,
            "aborted: the action server /navigate_to_pose (nav2_msgs/action/NavigateToPose)",
        ),
        (GoalStatus.CANCELED, "cancelled: somebody cancelled the goal at /navigate_to_pose: no way"),
        (GoalStatus.UNKNOWN, "lost: "),
    ],
)
def test_a_goal_that_fails_says_how(bench: Bench, status: GoalStatus, reason: str) -> None:
    bench.send("navigate", x=1.0, y=0.0)
    goal = bench.accept()
    bench.turn(Ended(goal, status, SimpleNamespace(error_msg="no way")))
    assert not only_answer(bench).success
    assert only_answer(bench).reason.startswith(reason)


def test_a_rejected_goal_says_so(bench: Bench) -> None:
    bench.send("navigate", x=1.0, y=0.0)
    bench.turn(Judged(bench.port.sent[0][1], False))
    assert only_answer(bench).reason.startswith("rejected: the action server /navigate_to_pose")


def test_a_server_that_is_not_there_is_named(bench: Bench) -> None:
    del bench.port.there["/navigate_to_pose"]
    bench.send("navigate", x=1.0, y=0.0)
    assert bench.turn(after_s=4.9) == []
    bench.turn(after_s=0.3)
    reason = only_answer(bench).reason
    assert reason.startswith("absent: the action server /navigate_to_pose (nav2_msgs/action/NavigateToPose)")
    assert bench.port.sent == []


def test_a_server_that_comes_in_time_gets_the_goal(bench: Bench) -> None:
    del bench.port.there["/navigate_to_pose"]
    bench.send("navigate", x=1.0, y=0.0)
    bench.turn(after_s=2)
    bench.port.there["/navigate_to_pose"] = "late"
    bench.turn(after_s=1)
    assert len(bench.port.sent) == 1


def test_a_server_that_never_answers_is_named_and_its_goal_cancelled(bench: Bench) -> None:
    bench.send("navigate", x=1.0, y=0.0)
    goal = bench.port.sent[0][1]
    bench.turn(after_s=5.1)
    assert only_answer(bench).reason.startswith("unanswered: the action server /navigate_to_pose")
    assert bench.port.cancelled == [goal]
    bench.turn(Judged(goal, True), after_s=60)  # it accepts after all
    assert bench.port.cancelled == [goal, goal]
    assert len(answers(bench)) == 1


def test_a_server_that_goes_away_has_lost_the_goal(bench: Bench) -> None:
    bench.send("navigate", x=1.0, y=0.0)
    goal = bench.accept()
    bench.turn(after_s=1)
    bench.port.there["/navigate_to_pose"] = "another life of it"
    bench.turn(after_s=1)
    assert answers(bench) == []
    bench.turn(after_s=5)
    assert only_answer(bench).reason.startswith("lost: the action server /navigate_to_pose")
    assert goal in bench.port.cancelled


def test_a_result_that_never_comes_is_lost(bench: Bench) -> None:
    bench.send("navigate", x=1.0, y=0.0)
    goal = bench.accept()
    bench.turn(Statuses("/navigate_to_pose", {goal: GoalStatus.SUCCEEDED}))
    bench.turn(after_s=4)
    assert answers(bench) == []
    bench.turn(after_s=2)
    assert "its result did not come" in only_answer(bench).reason


def test_a_result_that_comes_twice_is_told_once(bench: Bench) -> None:
    bench.send("navigate", x=1.0, y=0.0)
    goal = bench.accept()
    for status in (GoalStatus.SUCCEEDED, GoalStatus.SUCCEEDED, GoalStatus.ABORTED):
        bench.end(goal, status)
    bench.turn(Judged(goal, False))
    assert only_answer(bench).success
    assert sum("that is over" in note for note in bench.rover.notes) == 2  # results, and the judgement


def test_answers_for_goals_that_nobody_sent_are_noted(bench: Bench) -> None:
    bench.turn(
        Judged(b"x" * 16, True),
        Ended(b"y" * 16, GoalStatus.SUCCEEDED, None),
        Answered(b"z" * 16, None),
        Fed(b"x" * 16, None),
        CancelRefused(b"x" * 16, True),
    )
    assert answers(bench) == []
    assert sum("that nobody sent" in note for note in bench.rover.notes) == 3


def test_a_command_is_carried_out_once(bench: Bench) -> None:
    for _ in range(3):
        bench.send("navigate", x=1.0, y=0.0)
    goal = bench.accept()
    bench.end(goal, GoalStatus.SUCCEEDED)
    bench.send("navigate", x=1.0, y=0.0)
    bench.turn()
    assert len(bench.port.sent) == 1
    assert len(answers(bench)) == 1


def test_the_id_of_a_goal_is_that_of_its_command_in_every_life(tmp_path: Path) -> None:
    first, second = Bench(tmp_path), Bench(tmp_path)
    for bench in (first, second):
        bench.send("navigate", x=1.0, y=0.0)
        bench.send("navigate", attempt=2, x=1.0, y=0.0)
    ids = [goal for _, goal, _ in first.port.sent]
    assert ids == [goal for _, goal, _ in second.port.sent]
    assert len(set(ids)) == 2
    assert all(len(goal) == 16 for goal in ids)


def test_a_goal_left_over_from_an_earlier_life_is_cancelled(tmp_path: Path) -> None:
    before = Bench(tmp_path)
    before.send("navigate", x=1.0, y=0.0)
    goal = before.accept()
    after = Bench(tmp_path)
    foreign = b"f" * 16
    told = {goal: GoalStatus.EXECUTING, foreign: GoalStatus.EXECUTING}
    after.turn(Statuses("/navigate_to_pose", told))
    assert after.port.cancelled == [goal]
    after.turn(Statuses("/navigate_to_pose", {goal: GoalStatus.CANCELED, foreign: GoalStatus.EXECUTING}))
    assert after.port.cancelled == [goal]


# ---- aborts


def test_an_abort_is_acknowledged_when_the_goal_has_ended(bench: Bench) -> None:
    command = bench.send("navigate", x=1.0, y=0.0)
    goal = bench.accept()
    bench.rover.abort(command)
    assert bench.port.cancelled == [goal]
    assert bench.turn(after_s=0.5) == []
    bench.turn(CancelRefused(goal, unknown=False), after_s=1)
    assert bench.port.cancelled == [goal, goal]
    bench.end(goal, GoalStatus.CANCELED)
    (answer,) = answers(bench)
    assert isinstance(answer, Acknowledgement)


def test_a_goal_that_was_faster_than_its_abort_has_succeeded(bench: Bench) -> None:
    command = bench.send("navigate", x=1.0, y=0.0)
    goal = bench.accept()
    bench.rover.abort(command)
    bench.end(goal, GoalStatus.SUCCEEDED)
    assert only_answer(bench).success


def test_an_abort_before_the_goal_was_accepted_cancels_it_at_once_and_then(bench: Bench) -> None:
    command = bench.send("navigate", x=1.0, y=0.0)
    bench.rover.abort(command)
    (goal,) = bench.port.cancelled
    bench.turn(CancelRefused(goal, unknown=True))
    assert answers(bench) == []
    assert bench.accept() == goal
    assert bench.port.cancelled == [goal, goal]


def test_a_goal_called_off_that_nobody_answered_for_is_not_told_as_stopped(bench: Bench) -> None:
    command = bench.send("navigate", x=1.0, y=0.0)
    bench.rover.abort(command)
    bench.turn(after_s=6)
    assert only_answer(bench).reason.startswith("unanswered: ")


def test_a_goal_called_off_whose_line_broke_is_not_told_as_stopped(bench: Bench) -> None:
    command = bench.send("navigate", x=1.0, y=0.0)
    goal = bench.accept()
    bench.rover.abort(command)
    bench.turn(Broken(goal, "no answer can be read"))
    assert only_answer(bench).reason.startswith("broken: ")


def test_an_abort_before_the_goal_was_sent_ends_it(bench: Bench) -> None:
    del bench.port.there["/navigate_to_pose"]
    command = bench.send("navigate", x=1.0, y=0.0)
    bench.rover.abort(command)
    bench.turn(after_s=1)
    assert isinstance(answers(bench)[0], Acknowledgement)
    assert bench.port.sent == []


def test_a_goal_that_will_not_stop_is_never_told_as_stopped(bench: Bench) -> None:
    command = bench.send("navigate", x=1.0, y=0.0)
    bench.accept()
    bench.rover.abort(command)
    for _ in range(100):
        bench.turn(after_s=1)
    assert answers(bench) == []
    assert len(bench.port.cancelled) >= 99


def test_a_goal_that_takes_too_long_is_cancelled_and_overdue(bench: Bench) -> None:
    bench.send("navigate", x=1.0, y=0.0)
    goal = bench.accept()
    for _ in range(150):
        bench.turn(after_s=4)
    assert bench.port.cancelled == []
    bench.turn(after_s=4)
    assert bench.port.cancelled == [goal]
    bench.end(goal, GoalStatus.CANCELED)
    assert only_answer(bench).reason == "overdue: it took longer than 600 s and was cancelled"


def test_safemode_stops_all_that_runs(bench: Bench) -> None:
    bench.send("navigate", x=1.0, y=0.0)
    goal = bench.accept()
    waits = bench.send("wait", duration_s=100.0)
    safe = bench.send("safemode")
    bench.turn()
    assert [a.command for a in answers(bench)] == [waits]
    bench.end(goal, GoalStatus.CANCELED)
    bench.turn()
    last = answers(bench)[-1]
    assert last.command == safe
    assert isinstance(last, Result)
    assert last.success


# ---- the other ways


def test_a_service_is_asked_and_its_answer_believed(bench: Bench) -> None:
    bench.send("lamp", lit=True)
    _, ticket, fields = bench.port.sent[-1]
    assert fields == {"data": True}
    bench.turn(Answered(ticket, SimpleNamespace(success=True, message="on")))
    assert only_answer(bench).success


@pytest.mark.parametrize(
    ("answer", "reason"),
    [
        (SimpleNamespace(success=False, message="stuck"), "refused: /lamp answered success = False: stuck"),
        (SimpleNamespace(message="?"), "malformed: the answer of /lamp: there is no success"),
    ],
)
def test_a_service_that_refuses_has_failed(bench: Bench, answer: object, reason: str) -> None:
    bench.send("lamp", lit=True)
    bench.turn(Answered(bench.port.sent[-1][1], answer))
    assert only_answer(bench).reason.startswith(reason)


def test_a_service_that_is_silent_or_absent_is_named(bench: Bench) -> None:
    command = bench.send("lamp", lit=True)
    bench.rover.abort(command)  # what is on its way cannot be called off
    bench.turn(after_s=10.1)
    assert only_answer(bench).reason.startswith("unanswered: the service /lamp (std_srvs/srv/SetBool)")
    del bench.port.there["/lamp"]
    bench.send("lamp", attempt=2, lit=True)
    bench.turn(after_s=5.1)
    last = answers(bench)[-1]
    assert isinstance(last, Result)
    assert last.reason.startswith("absent: the service /lamp")


def test_what_breaks_inside_ros_fails_one_command(bench: Bench) -> None:
    bench.send("navigate", x=1.0, y=0.0)
    bench.turn(Broken(bench.port.sent[0][1], "the middleware is gone"))
    assert only_answer(bench).reason.endswith("the middleware is gone")


def test_a_timer_lasts_as_long_as_it_is_told(bench: Bench) -> None:
    bench.send("wait", duration_s=2.0)
    assert bench.turn(after_s=1.9) == []
    bench.turn(after_s=0.1)
    assert only_answer(bench).success


@pytest.mark.parametrize(
    ("action", "parameters", "said"),
    [
        ("dance", {}, "unmapped: the mapping turtle has no action 'dance'"),
        ("navigate", {"x": 1.0}, "malformed: the parameter y is missing"),
        ("navigate", {"x": "far", "y": 0.0}, "malformed: parameter x: 'far' is not a number"),
        ("navigate", {"x": math.nan, "y": 0.0}, "malformed: parameter x: nan is not finite"),
        ("navigate", {"x": 1.0, "y": 0.0, "z": 0.0}, "malformed: the action navigate has no parameter 'z'"),
        ("wait", {}, "malformed: the parameter duration_s is missing"),
        ("wait", {"duration_s": -1.0}, "malformed: parameter duration_s: -1 is out of range"),
        ("lamp", {"lit": 1.0}, "malformed: parameter lit: '1.0' is not a truth value"),
    ],
)
def test_a_command_that_cannot_be_is_refused(
    bench: Bench, action: str, parameters: dict[str, float], said: str
) -> None:
    bench.send(action, **parameters)
    bench.turn()
    assert only_answer(bench).reason.startswith(said)
    assert bench.port.sent == []


def two_pixels() -> SimpleNamespace:
    picture = message(header__frame_id="cam", header__stamp=SimpleNamespace(sec=5, nanosec=0))
    picture.height, picture.width, picture.step, picture.is_bigendian = 2, 1, 8, 0
    picture.encoding, picture.data = "bgr8", bytes([1, 2, 3, 0, 0, 0, 0, 0, 4, 5, 6, 0, 0, 0, 0, 0])
    return picture


def test_an_image_becomes_a_product(bench: Bench, tmp_path: Path) -> None:
    bench.send("image")
    ear = bench.port.ears["/camera/image_raw"]
    ear.waiting = [two_pixels()]
    bench.turn()
    (product,) = [e for e in bench.heard if isinstance(e, Product)]
    assert only_answer(bench).values == {"products": 1.0}
    assert ear.closed
    from PIL import Image

    with Image.open(tmp_path / product.path) as made:
        assert [made.getpixel((0, row)) for row in range(2)] == [(3, 2, 1), (6, 5, 4)]
    assert (tmp_path / f"{product.path}.json").is_file()


def test_an_image_that_the_disk_does_not_take_ends_its_command(bench: Bench, tmp_path: Path) -> None:
    (tmp_path / "products").write_text("in the way")
    bench.send("image")
    ear = bench.port.ears["/camera/image_raw"]
    ear.waiting = [two_pixels()]
    bench.turn()
    assert "cannot be written" in only_answer(bench).reason
    assert ear.closed


@pytest.mark.parametrize(
    ("encoding", "step", "said"),
    [("yuv422", 8, "its encoding is 'yuv422'"), ("bgr8", 2, "rows of 2 bytes"), ("bgr8", 90, "do not fit")],
)
def test_an_image_that_is_none_is_malformed(bench: Bench, encoding: str, step: int, said: str) -> None:
    bench.send("image")
    picture = message(header__frame_id="cam", header__stamp=SimpleNamespace(sec=5, nanosec=0))
    picture.height, picture.width, picture.step, picture.is_bigendian = 2, 1, step, 0
    picture.encoding, picture.data = encoding, bytes(16)
    bench.port.ears["/camera/image_raw"].waiting = [picture]
    bench.turn()
    assert only_answer(bench).reason.startswith("malformed: the image on /camera/image_raw: ")
    assert said in only_answer(bench).reason


def test_a_camera_that_is_silent_is_named(bench: Bench) -> None:
    bench.send("image")
    bench.turn(after_s=5.1)
    assert only_answer(bench).reason == "unanswered: no image came on /camera/image_raw within 5 s"


def test_feedback_is_told_as_telemetry_but_not_at_any_rate(bench: Bench) -> None:
    bench.send("navigate", x=1.0, y=0.0)
    goal = bench.accept()
    for n in range(1000):
        bench.turn(Fed(goal, SimpleNamespace(distance_remaining=10 - n / 1000)), after_s=0.001)
    told = [e for e in bench.heard if isinstance(e, Update) and "distance-left" in e.values]
    assert 2 <= len(told) <= 3


def test_what_a_topic_told_last_is_told_before_a_result(bench: Bench) -> None:
    bench.send("navigate", x=1.0, y=0.0)
    goal = bench.accept()
    bench.turn(after_s=1)
    bench.port.ears["/odom"].waiting = [odometry(1.0, 0.0)]
    update, result = bench.end(goal, GoalStatus.SUCCEEDED)
    assert isinstance(update, Update)
    assert update.values["pose x"] == 1.0
    assert isinstance(result, Result)
