"""Comments on what a mission holds, and on single steps of a plan."""

from __future__ import annotations

from tests.ground.planning import PlannedDay
from tests.ground.test_missions_api import problem


def test_a_step_of_a_plan_is_commented_and_nothing_else_has_parts(sqlite_planned_day: PlannedDay) -> None:
    api, mission, plan = sqlite_planned_day.api, sqlite_planned_day.mission, sqlite_planned_day.plan
    comments = f"/missions/{mission.id}/comments"
    of_plan = {"subject_kind": "plan", "subject_id": plan["id"], "text": "Why so early?"}
    made = api.post(comments, {**of_plan, "part": "main/2"}, who="Scientist")
    assert (made["part"], made["author"]) == ("main/2", "Scientist")
    assert api.post(comments, of_plan)["part"] is None
    assert [c["part"] for c in api.get(comments)["items"]] == ["main/2", None]
    target = api.get(f"/missions/{mission.id}/targets")["items"][0]["id"]
    of_target = {"subject_kind": "target", "subject_id": target, "text": "x", "part": "main/2"}
    wrong = problem(api("POST", comments, of_target), 422, "invalid-input")
    assert [error["pointer"] for error in wrong["errors"]] == ["/part"]
    problem(api("POST", comments, {**of_plan, "part": ""}), 422, "invalid-input")
