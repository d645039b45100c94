"""`outcrop plan diff` and `outcrop plan merge` as their users run them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from ground.cli.plan import register

BASE = "(block :id root :node-list ((task :id a :action image :retries 1) (task :id b :action downlink)))"


def run(*arguments: str) -> tuple[int, str]:
    app = typer.Typer()
    register(app)
    app.command("other")(lambda: None)
    result = CliRunner().invoke(app, ["plan", *arguments])
    return result.exit_code, result.output


@pytest.fixture
def files(tmp_path: Path) -> dict[str, str]:
    texts = {
        "base": BASE,
        "same": BASE.replace(":retries 1", ":retries 1 ; as before\n"),
        "ours": BASE.replace(":retries 1", ":retries 2"),
        "theirs": BASE.replace("downlink", "handoff"),
        "against": BASE.replace(":retries 1", ":retries 3"),
        "broken": "(block :id root",
    }
    for name, text in texts.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    return {name: str(tmp_path / name) for name in texts} | {"out": str(tmp_path / "out.crl")}


def test_diff_says_what_differs_by_its_exit_status_too(files: dict[str, str]) -> None:
    assert run("diff", files["base"], files["same"]) == (0, "the plans mean the same\n")
    code, told = run("diff", files["base"], files["ours"])
    assert (code, told) == (1, "steps       task a :retries: 1 -> 2\n")
    code, told = run("diff", "--json", files["base"], files["ours"])
    assert code == 1
    assert json.loads(told)["changes"][0]["after"] == "2"
    code, told = run("diff", files["base"], files["broken"])
    assert code == 2
    assert "broken" in told
    assert "line 1" in told


def test_merge_writes_a_plan_only_without_conflict(files: dict[str, str]) -> None:
    out = Path(files["out"])
    code, told = run("merge", files["base"], files["ours"], files["against"], "--out", files["out"])
    assert code == 1
    assert "both-changed: a :retries: was: 1; ours: 2; theirs: 3" in told
    assert not out.exists()
    code, _ = run("merge", files["base"], files["ours"], files["theirs"], "--out", files["out"])
    assert code == 0
    assert ":retries 2" in out.read_text()
    assert "handoff" in out.read_text()
    arguments = ("merge", files["base"], files["ours"], files["against"], "--out", files["out"])
    assert run(*arguments, "--take", "theirs")[0] == 0
    assert ":retries 3" in out.read_text()
    assert run(*arguments, "--take", "mine")[0] == 2


def test_a_problem_is_still_planned_by_the_bare_word(tmp_path: Path) -> None:
    code, told = run(str(tmp_path / "absent.json"), "--out", str(tmp_path))
    assert code == 2
    assert "absent.json" in told
    code, told = run("--out", str(tmp_path), str(tmp_path / "absent.json"))
    assert code == 2
    assert "absent.json" in told
