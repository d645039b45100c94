"""Programs of others that come from npm, for tests alone: PlanDev's schema and Open MCT."""

from __future__ import annotations

import fcntl
import os
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

from scripts.build_web import node_environment

ROOT = Path(__file__).parents[1]
LOCKED = ROOT / "tests/neighbours/npm"
FILES = ("package.json", "package-lock.json", ".npmrc")


@cache
def npm_packages() -> Path:
    """Return the folder `node_modules` of what `tests/neighbours/npm` locks, installed where need be.

    `OUTCROP_TEST_NPM` names the folder; in CI it is filled by `npm ci`, elsewhere taken if it is there.
    """
    folder = Path(os.environ.get("OUTCROP_TEST_NPM", ROOT / ".test-npm"))
    lock = (LOCKED / "package-lock.json").read_text()
    stamp = folder / "node_modules/.installed"
    if not os.environ.get("CI") and not stamp.is_file():
        told = f"cp {LOCKED}/* {LOCKED}/.npmrc {folder} && npm ci in it, and touch {stamp}, fills it"
        pytest.skip(f"no packages of npm in {folder}: {told}")
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / ".lock").open("w") as held:
        fcntl.flock(held, fcntl.LOCK_EX)  # processes of the suite may ask at once
        if not stamp.is_file() or stamp.read_text() not in ("", lock):
            for name in FILES:
                shutil.copyfile(LOCKED / name, folder / name)
            npm, environment = node_environment(os.environ)
            done = subprocess.run(
                [*npm, "ci", "--ignore-scripts"], cwd=folder, env=environment, capture_output=True, text=True,
                check=False,
            )  # fmt: skip
            assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
            stamp.write_text(lock)
    return folder / "node_modules"


if __name__ == "__main__":
    os.environ.setdefault("CI", "true")
    sys.stdout.write(f"{npm_packages()}\n")
