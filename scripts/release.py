"""What `scripts/release` does: check tree and changelog, build sdist and wheel into `dist/`, tag."""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tomllib
from pathlib import Path

VERSION = re.compile(r"(\d+)\.(\d+)\.(\d+)(?:(a|b|rc)(\d+))?")
"""What PEP 440 allows of it here: three numbers, perhaps alpha, beta or candidate."""


def git(root: Path, *arguments: str) -> str:
    """Return what git prints."""
    return subprocess.run(["git", *arguments], cwd=root, check=True, capture_output=True, text=True).stdout


def key(version: str) -> tuple[int, int, int, str, int]:
    """Return what versions are ordered by: a candidate comes before what it is a candidate of."""
    match = VERSION.fullmatch(version)
    if match is None:
        raise ValueError(f"{version!r} is not a version; one is 1.2.3, 1.2.3a1, 1.2.3b1 or 1.2.3rc1")
    major, minor, patch, stage, number = match.groups()
    return int(major), int(minor), int(patch), stage or "z", int(number or 0)


def section(changelog: str, version: str) -> str | None:
    """Return the text under `## VERSION (YYYY-MM-DD)`; None if there is no such heading."""
    heading = rf"^## {re.escape(version)} \(\d{{4}}-\d\d-\d\d\)$\n(.*?)(?=^## |\Z)"
    found = re.search(heading, changelog, re.MULTILINE | re.DOTALL)
    return None if found is None else found[1].strip()


def hindrances(root: Path, version: str) -> list[str]:
    """Return why the tree cannot be released as this version; none if it can."""
    found = []
    if git(root, "status", "--porcelain"):
        found.append("the tree has changes that are not committed")
    told = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    if told != version:
        found.append(f"pyproject.toml says version {told}, not {version}")
    text = section((root / "CHANGELOG.md").read_text(encoding="utf-8"), version)
    if text is None:
        found.append(f"CHANGELOG.md has no heading '## {version} (YYYY-MM-DD)'")
    elif not re.search(r"^\* ", text, re.MULTILINE):
        found.append(f"CHANGELOG.md tells users nothing under {version}")
    tags = [t.removeprefix("v") for t in git(root, "tag", "--list", "v*").split()]
    newer = [t for t in tags if VERSION.fullmatch(t) and key(t) >= key(version)]
    if newer:
        found.append(f"version {max(newer, key=key)} is tagged already")
    return found


def main(arguments: list[str] | None = None) -> int:
    """Release; exit status 0, 1 with the hindrances, or that of the build."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("version")
    parser.add_argument("--root", type=Path, default=Path(__file__).resolve().parents[1])
    given = parser.parse_args(arguments)
    root, version = given.root.resolve(), given.version
    try:
        key(version)
    except ValueError as err:
        parser.error(str(err))
    if hindered := hindrances(root, version):
        print("\n".join(f"release: {hindrance}" for hindrance in hindered), file=sys.stderr)
        return 1
    build = [sys.executable, "-m", "build", "--no-isolation", "--outdir", "dist", "."]
    if subprocess.run(build, cwd=root, check=False).returncode:
        print("release: the build failed; nothing was tagged", file=sys.stderr)
        return 1
    text = section((root / "CHANGELOG.md").read_text(encoding="utf-8"), version)
    git(root, "tag", "--annotate", f"v{version}", "--cleanup=verbatim", "--message", f"{version}\n\n{text}\n")
    print(f"release: tagged v{version}; push it with: git push origin v{version}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
