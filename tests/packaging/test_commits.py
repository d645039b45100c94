"""The check of commit messages, as git runs it."""

from __future__ import annotations

import os
import runpy
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FAULTS = runpy.run_path(str(ROOT / "scripts/commit-msg"))["faults"]
GOOD = "planner: choose branch points by variance of utility"


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    """Return a repository with the hook and one page of docs in it."""
    for command in (
        ["init", "--quiet"],
        ["config", "core.hooksPath", str(ROOT / "scripts")],
        ["config", "user.name", "A"],
        ["config", "user.email", "a@example.org"],
    ):
        subprocess.run(["git", *command], cwd=tmp_path, check=True)
    (tmp_path / "docs/results").mkdir(parents=True)
    write(tmp_path, "docs/planner.md", "It plans.\n")
    assert commit(tmp_path, GOOD) == ""
    return tmp_path


def write(repository: Path, name: str, text: str) -> None:
    (repository / name).write_text(text)
    subprocess.run(["git", "add", "--all"], cwd=repository, check=True)


def commit(repository: Path, message: str) -> str:
    """Return what the hook says against a commit; nothing if it is made."""
    clean = {name: value for name, value in os.environ.items() if not name.startswith("GIT_")}
    command = ["git", "commit", "--quiet", "--allow-empty", "--file", "-"]
    done = subprocess.run(
        command, cwd=repository, input=message, capture_output=True, text=True, check=False, env=clean
    )
    assert (done.returncode == 0) == (done.stderr == "")
    return done.stderr


@pytest.mark.parametrize(
    ("message", "fault"),
    [
        ("Choose branch points", "the subject is not 'room: what it does'"),
        ("planner: choose branch points.", "the subject is not 'room: what it does'"),
        (f"{GOOD} and of nothing else at all", "79 columns, 72 are allowed"),
        (f"{GOOD}\nThe body begins at once.", "the line after the subject is not empty"),
    ],
)
def test_message_of_a_wrong_form_is_refused(message: str, fault: str) -> None:
    assert any(fault in found for found in FAULTS(message, {}))


@pytest.mark.parametrize(
    "message",
    [
        GOOD,
        "planner, ground: one value for a request",
        f"{GOOD}\n\nThe body says why.",
        'Revert "planner: choose branch points by variance of utility, which is far too long"',
    ],
)
def test_message_of_the_right_form_is_taken(message: str) -> None:
    assert FAULTS(message, {}) == []


@pytest.mark.parametrize("figure", ["9 %", "3.4 ms", "0.5 cm", "12 kB", "2 CPU s of 5 s"])
def test_changed_figure_wants_a_body(figure: str) -> None:
    changed = {"docs/planner.md": [f"It plans within {figure}."]}
    (fault,) = FAULTS(GOOD, changed)
    assert f"a figure changes in docs/planner.md: It plans within {figure}." in fault
    assert FAULTS(f"{GOOD}\n\nA second more before.", changed) == []


def test_git_runs_the_check_on_what_is_committed(repository: Path) -> None:
    write(repository, "docs/planner.md", "It plans within 9 %.\n")
    assert "a figure changes in docs/planner.md: It plans within 9 %." in commit(repository, GOOD)
    assert "the subject is not" in commit(repository, "Plan.\n\nWithin 9 %, 12 % before.")
    assert commit(repository, f"{GOOD}\n\nWithin 9 %, 12 % before.") == ""


def test_changed_results_want_a_body(repository: Path) -> None:
    write(repository, "docs/results/planner.md", "| a | b |\n")
    assert "docs/results/planner.md changes" in commit(repository, GOOD)


def test_prose_and_code_want_no_body(repository: Path) -> None:
    write(repository, "docs/planner.md", "It plans with 6 branches, and says so in section 4.2.\n")
    write(repository, "solve.py", "LIMIT_S = 30  # 30 s\n")
    assert commit(repository, GOOD) == ""


def test_commits_of_a_range_are_checked_too(repository: Path) -> None:
    write(repository, "docs/planner.md", "It plans within 9 %.\n")
    command = ["git", "-c", "core.hooksPath=/dev/null", "commit", "--quiet", "-m", GOOD]
    subprocess.run(command, cwd=repository, check=True)
    check = [str(ROOT / "scripts/commit-msg"), "--range", "HEAD~1..HEAD"]
    done = subprocess.run(check, cwd=repository, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "a figure changes in docs/planner.md" in done.stderr
