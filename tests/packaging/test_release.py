"""A release by tag, of a small project in a repository of its own."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PROJECT = """[build-system]
requires = ["hatchling"]
build-backend = "hatchling.build"

[project]
name = "small"
version = "{version}"
"""
CHANGES = "# Changelog\n\n## 0.2.0 (2026-11-22)\n\n* Plans are made.\n\n## 0.1.0 (2026-10-01)\n\n* A start.\n"


@pytest.fixture
def project(tmp_path: Path) -> Path:
    root = tmp_path / "small"
    (root / "small").mkdir(parents=True)
    (root / "small/__init__.py").write_text("")
    (root / ".gitignore").write_text("dist/\n")
    for command in (
        ["init", "--quiet"],
        ["config", "user.name", "A"],
        ["config", "user.email", "a@example.org"],
        ["config", "core.hooksPath", "/dev/null"],
    ):
        subprocess.run(["git", *command], cwd=root, check=True)
    commit(root, "0.2.0", CHANGES)
    return root


def commit(root: Path, version: str, changes: str) -> None:
    (root / "pyproject.toml").write_text(PROJECT.format(version=version))
    (root / "CHANGELOG.md").write_text(changes)
    subprocess.run(["git", "add", "--all"], cwd=root, check=True)
    subprocess.run(["git", "commit", "--quiet", "--allow-empty", "-m", "all: change"], cwd=root, check=True)


def release(root: Path, version: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(ROOT / "scripts/release.py"), version, "--root", str(root)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def tags(root: Path) -> list[str]:
    listed = subprocess.run(["git", "tag"], cwd=root, check=True, capture_output=True, text=True)
    return listed.stdout.split()


def test_release_builds_and_tags_with_what_users_are_told(project: Path) -> None:
    done = release(project, "0.2.0")
    assert done.returncode == 0, done.stderr
    assert {p.name for p in (project / "dist").iterdir()} == {
        "small-0.2.0.tar.gz",
        "small-0.2.0-py2.py3-none-any.whl",
    }
    message = ["git", "tag", "--list", "--format=%(contents)", "v0.2.0"]
    told = subprocess.run(message, cwd=project, check=True, capture_output=True, text=True).stdout
    assert told.strip() == "0.2.0\n\n* Plans are made."
    again = release(project, "0.2.0")
    assert again.returncode == 1
    assert "version 0.2.0 is tagged already" in again.stderr


@pytest.mark.parametrize(
    ("version", "changes", "why"),
    [
        ("0.1.9", CHANGES, "pyproject.toml says version 0.1.9, not 0.2.0"),
        ("0.2.0", CHANGES.replace("(2026-11-22)", "(unreleased)"), "has no heading '## 0.2.0 (YYYY-MM-DD)'"),
        ("0.2.0", CHANGES.replace("* Plans are made.\n", ""), "tells users nothing under 0.2.0"),
    ],
)
def test_release_is_refused_with_the_reason(project: Path, version: str, changes: str, why: str) -> None:
    commit(project, version, changes)
    done = release(project, "0.2.0")
    assert done.returncode == 1
    assert why in done.stderr
    assert tags(project) == []


def test_release_of_a_changed_tree_is_refused(project: Path) -> None:
    (project / "small/new.py").write_text("")
    done = release(project, "0.2.0")
    assert "the tree has changes that are not committed" in done.stderr
    assert tags(project) == []


def test_release_of_an_older_version_is_refused(project: Path) -> None:
    subprocess.run(["git", "tag", "v0.10.0"], cwd=project, check=True)
    assert "version 0.10.0 is tagged already" in release(project, "0.2.0").stderr
    subprocess.run(["git", "tag", "-d", "v0.10.0"], cwd=project, check=True, capture_output=True)
    subprocess.run(["git", "tag", "v0.2.0rc1"], cwd=project, check=True)
    assert release(project, "0.2.0").returncode == 0


def test_failed_build_leaves_no_tag(project: Path) -> None:
    (project / "pyproject.toml").write_text(PROJECT.format(version="0.2.0") + 'dependencies = "none"\n')
    subprocess.run(["git", "commit", "--quiet", "--all", "-m", "all: break"], cwd=project, check=True)
    done = release(project, "0.2.0")
    assert done.returncode == 1
    assert "the build failed; nothing was tagged" in done.stderr
    assert tags(project) == []


def test_name_that_is_no_version_is_told(project: Path) -> None:
    done = release(project, "next")
    assert done.returncode == 2
    assert "'next' is not a version; one is 1.2.3" in done.stderr
