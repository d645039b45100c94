"""Plans written by hand over REST and from the command line: checked with places, kept as new plans."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from executive.crl.reader import parse
from executive.crl.validate import check
from ground.cli.main import app, register_all
from tests.ground.planning import finished
from tests.ground.test_cli_resources import serving
from tests.ground.test_missions_api import problem as problem_of
from tests.ground.versions.test_plan_merges import day, edited

__all__ = ["day"]


def checked(api: Any, plan: dict[str, Any], text: str, **more: Any) -> Any:
    return api.post(f"/plans/{plan['id']}/crl-check", {"crl": text}, status=200, **more)


def test_a_text_is_checked_by_the_rover_and_each_finding_has_its_place(day: Any) -> None:
    api, mission, plan, text = day
    before = len(api.get(f"/missions/{mission}/plans")["items"])
    known = {(f["code"], f["line"]) for f in api.get(f"/plans/{plan['id']}/findings")}
    assert {(f["code"], f["line"]) for f in checked(api, plan, text)} == known
    action = re.search(r":action (\S+)", text)
    assert action is not None
    broken = text[: action.start(1)] + "fly-away" + text[action.end(1) :]
    found = [f for f in checked(api, plan, broken) if f["severity"] == "error"]
    assert [f["code"] for f in found] == ["E050"]
    lines = broken.split("\n")
    at = lines[found[0]["line"] - 1][found[0]["column"] - 1 :]
    assert at[: found[0]["length"]].startswith(":action") or at.startswith("fly-away"), at[:40]
    assert "fly-away" in found[0]["message"]
    for nothing in ("", "(plan :node (block", ")"):
        assert checked(api, plan, nothing)[0]["line"] == 1
    assert len(api.get(f"/missions/{mission}/plans")["items"]) == before


def test_the_resource_envelope_of_a_text_begins_at_the_charge_of_the_plan(day: Any) -> None:
    api, _, plan, _ = day
    text = (
        "(plan :id p :resources ((energy :consumable :key :battery-energy :floor 0)) :node (task :id a"
        " :action safemode :expectations ((energy {} 0))))"
    )
    assert not [f for f in checked(api, plan, text.format(-1)) if f["code"] == "W064"]
    assert [f for f in checked(api, plan, text.format(-1e12)) if f["code"] == "W064"]


def test_an_edit_is_a_new_plan_that_nobody_predicted(day: Any) -> None:
    api, mission, plan, text = day
    answer = api("POST", f"/plans/{plan['id']}/edits", json={"crl": edited(text, 2), "name": "By hand"})
    new = answer.json()
    assert (answer.status_code, answer.headers["location"]) == (201, f"/api/v1/plans/{new['id']}")
    assert (new["state"], new["status"], new["strategy"]) == ("computed", "edited", "edited")
    assert (new["name"], new["parent_id"], new["number"]) == ("By hand", plan["id"], plan["number"] + 1)
    assert new["notes"] == f"Edited by hand, beginning with plan {plan['number']}."
    assert (new["expected_utility"], new["stale"]) == (None, False)
    assert new["planned_request_ids"] == plan["planned_request_ids"]
    crl = api("GET", f"/plans/{new['id']}/crl").text
    assert ":retries 2" in crl
    assert parse(crl).metadata["plan"] == new["id"]
    assert check(crl).valid
    told = problem_of(api("GET", f"/plans/{new['id']}/tree"), 409, "wrong-state")
    assert "was edited by hand" in told["detail"]
    changes = api.get(f"/plans/{plan['id']}/difference/{new['id']}")["changes"]
    assert [c["deed"] for c in changes if c["group"] != "words"] == ["changed"]
    rules = api.get(f"/plans/{new['id']}/flight-rules")
    assert [r["holds"] for r in rules if "campaign flown here would tell" in r["detail"]] == [False]
    run = {"plan_id": new["id"], "rover": "abstract", "seed": 3}
    job = api.post(f"/missions/{mission}/runs", run, status=202)
    assert finished(api, job)["state"] == "succeeded"
    assert api.get(f"/runs/{job['subject_id']}")["crl_sha256"] == new["crl_sha256"]
    history = api.get(f"/missions/{mission}/history")["items"]
    assert next(e["reason"] for e in history if e["subject_id"] == new["id"]).startswith("Edited by hand")


def test_what_an_edit_leaves_out_is_named(day: Any) -> None:
    api, _, plan, _ = day
    alone = "(plan :id p :node (task :id a :action safemode))"
    new = api.post(f"/plans/{plan['id']}/edits", {"crl": alone})
    assert new["planned_request_ids"] == []
    assert set(plan["planned_request_ids"]) <= set(new["left_out"])
    assert set(new["left_out"].values()) >= {"not in the edited plan"}


def test_a_text_with_an_error_is_refused_with_its_line_and_nothing_is_made(day: Any) -> None:
    api, mission, plan, text = day
    before = len(api.get(f"/missions/{mission}/plans")["items"])
    url = f"/plans/{plan['id']}/edits"
    for wrong, words in (
        ("(plan :node (block", "line 1"),
        (text.replace(":action ", ":action not-", 1), "not-"),
        ("", "line 1"),
    ):
        told = problem_of(api("POST", url, json={"crl": wrong}), 422, "invalid-input")
        assert "/crl" in str(told)
        assert words in str(told)
    problem_of(api("POST", url, json={"crl": text}, who="Scientist"), 403, "forbidden")
    problem_of(api("POST", "/plans/pln-nobody/edits", json={"crl": text}), 404, "not-found")
    assert len(api.get(f"/missions/{mission}/plans")["items"]) == before
    checked(api, plan, text, who="Scientist")  # looking is free


@pytest.mark.parametrize("path", ["edits", "crl-check"])
def test_a_plan_that_is_not_there_yet_has_no_text_to_edit(day: Any, path: str) -> None:
    api, mission, _, text = day
    job = api("POST", f"/missions/{mission}/plans", json={"iterations": 1, "time_limit_s": 1.0}).json()
    body = {"crl": text}
    problem_of(api("POST", f"/plans/{job['subject_id']}/{path}", json=body), 409, "wrong-state")


def test_a_file_is_checked_and_kept_from_the_command_line(day: Any, tmp_path: Path) -> None:
    api, _, plan, text = day
    file = tmp_path / "edited.crl"
    if not app.registered_groups:
        register_all()
    with serving(api.repo) as server:

        def run(*words: str, code: int = 0) -> str:
            environment = {"OUTCROP_SERVER": server, "OUTCROP_PERSON": "Planner"}
            result = CliRunner().invoke(app, list(words), env=environment)
            assert result.exit_code == code, (words, result.output, result.exception)
            return result.output.strip()

        file.write_text(text.replace(":action ", ":action not-", 1))
        assert re.search(r"^error E050 line \d+ column \d+: ", run("review", "check", plan["id"], f"@{file}"))
        assert "not-" in run("review", "edit", plan["id"], f"@{file}", code=2)
        file.write_text(edited(text, 4))
        new = run("review", "edit", plan["id"], f"@{file}", "name=Typed")
        assert "Typed" in run("review", "show", new)
        assert ":retries 4" in run("review", "crl", new)
