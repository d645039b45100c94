"""Merging plans over REST: what is joined is a plan like any other, and what is not is named."""

from __future__ import annotations

from typing import Any

import pytest

from executive.crl.reader import parse
from executive.crl.validate import check
from tests.ground.conftest import Api
from tests.ground.planning import PlannedDay, finished
from tests.ground.test_missions_api import problem as problem_of


@pytest.fixture
def day(sqlite_planned_day: PlannedDay) -> tuple[Api, str, dict[str, Any], str]:
    api, plan = sqlite_planned_day.api, sqlite_planned_day.plan
    return api, sqlite_planned_day.mission.id, plan, api("GET", f"/plans/{plan['id']}/crl").text


def edited(text: str, retries: int, task: int = 0) -> str:
    """Return the text with `retries` of one of its tasks set."""
    places = [at for at in range(len(text)) if text.startswith("(task", at)]
    at = places[task] + len("(task")
    return f"{text[:at]} :retries {retries}{text[at:]}"


def merged(api: Api, mission: str, plan: dict[str, Any], ours: str, theirs: str, **more: Any) -> Any:
    body = {"base": {"plan_id": plan["id"]}, "ours": {"crl": ours}, "theirs": {"crl": theirs}, **more}
    return api.post(f"/missions/{mission}/plan-merges", body, status=200)


def test_two_edits_are_one_new_plan_that_nobody_predicted(day: Any) -> None:
    api, mission, plan, text = day
    found = merged(api, mission, plan, edited(text, 2), edited(text, 3, task=1))
    assert found["conflicts"] == []
    new = found["plan"]
    assert (new["state"], new["status"], new["parent_id"]) == ("computed", "merged", plan["id"])
    assert (new["expected_utility"], new["stale"]) == (None, False)
    assert new["planned_request_ids"] == plan["planned_request_ids"]
    assert new["notes"].endswith(
        f"Merged from a text given as ours and a text given as theirs, edits of plan {plan['number']}."
    )
    crl = api("GET", f"/plans/{new['id']}/crl").text
    assert ":retries 2" in crl
    assert ":retries 3" in crl
    assert parse(crl).metadata["plan"] == new["id"]
    assert check(crl).valid
    rules = {rule["rule"]: rule for rule in api.get(f"/plans/{new['id']}/flight-rules")}
    unflown = [rule for rule in rules.values() if "campaign flown here would tell" in rule["detail"]]
    assert len(unflown) == 1
    assert not unflown[0]["holds"]
    for path in ("tree", "report", f"comparison/{plan['id']}", f"why-not/{plan['planned_request_ids'][0]}"):
        told = problem_of(api("GET", f"/plans/{new['id']}/{path}"), 409, "wrong-state")
        assert "was merged from others" in told["detail"]
    problem_of(api("GET", f"/plans/{plan['id']}/comparison/{new['id']}"), 409, "wrong-state")
    problem_of(api("POST", f"/plans/{new['id']}/what-if", json={}), 409, "wrong-state")


def test_a_dry_run_of_a_merged_plan_flies_its_text(day: Any) -> None:
    api, mission, plan, text = day
    new = merged(api, mission, plan, edited(text, 2), text)["plan"]
    run = {"plan_id": new["id"], "rover": "abstract", "seed": 3}
    job = api.post(f"/missions/{mission}/runs", run, status=202)
    done = finished(api, job)
    assert done["state"] == "succeeded"
    assert api.get(f"/runs/{job['subject_id']}")["crl_sha256"] == new["crl_sha256"]


def test_conflicts_are_named_and_a_side_is_taken_in_each(day: Any) -> None:
    api, mission, plan, text = day
    sides = edited(edited(text, 2), 4, task=1), edited(edited(text, 3), 5, task=1)
    before = len(api.get(f"/missions/{mission}/plans")["items"])
    found = merged(api, mission, plan, *sides)
    assert (found["plan"], found["joined"]) == (None, False)
    assert [(c["kind"], c["field"], c["ours"], c["theirs"]) for c in found["conflicts"]] == [
        ("both-changed", "retries", "2", "3"),
        ("both-changed", "retries", "4", "5"),
    ]
    first, second = ({"kind": c["kind"], "id": c["id"], "field": c["field"]} for c in found["conflicts"])
    half = merged(api, mission, plan, *sides, choices=[{**first, "take": "theirs"}])
    assert half["plan"] is None
    both = [{**first, "take": "theirs"}, {**second, "take": "ours"}]
    seen = merged(api, mission, plan, *sides, choices=both, preview=True)
    assert (seen["plan"], seen["joined"]) == (None, True)
    assert len(api.get(f"/missions/{mission}/plans")["items"]) == before
    new = merged(api, mission, plan, *sides, choices=both)["plan"]
    crl = api("GET", f"/plans/{new['id']}/crl").text
    assert ":retries 3" in crl
    assert ":retries 4" in crl
    assert "theirs taken at" in new["notes"]
    assert "ours taken at" in new["notes"]


def test_bad_input_is_named_and_nothing_is_made(day: Any) -> None:
    api, mission, plan, text = day
    url = f"/missions/{mission}/plan-merges"
    base, ours = {"plan_id": plan["id"]}, {"crl": text}
    before = len(api.get(f"/missions/{mission}/plans")["items"])
    for theirs, pointer in (
        ({"crl": "(plan :node (block"}, "/theirs/crl"),
        ({"plan_id": "pln-nobody"}, "/theirs/plan_id"),
        ({}, "/theirs"),
    ):
        told = problem_of(
            api("POST", url, json={"base": base, "ours": ours, "theirs": theirs}), 422, "invalid-input"
        )
        assert pointer in str(told), told
    choice = {"kind": "both-changed", "id": "nobody", "field": "retries", "take": "ours"}
    told = problem_of(
        api("POST", url, json={"base": base, "ours": ours, "theirs": ours, "choices": [choice]}),
        422,
        "invalid-input",
    )
    assert "there is no conflict both-changed at nobody :retries" in told["detail"]
    asked = {"base": base, "ours": ours, "theirs": ours}
    problem_of(api("POST", url, json=asked, who="Scientist"), 403, "forbidden")
    assert len(api.get(f"/missions/{mission}/plans")["items"]) == before
