"""F Prime's compiler and ground data system, in an environment of their own."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]


@dataclass(frozen=True)
class FPrime:
    """The programs of F Prime."""

    folder: Path

    def compile(self, model: Path, out: Path) -> Path:
        """Return the dictionary that `fpp-to-dict` makes of a model."""
        out.mkdir(exist_ok=True)
        self._run("fpp-to-dict", "-d", out, "-f", "4.0.0", "-p", "7", model)
        return out / "TopTopologyDictionary.json"

    def encode(self, sequence: Path, dictionary: Path) -> bytes:
        """Return a sequence as F Prime's own sequence compiler writes it."""
        made = sequence.with_suffix(".bin")
        told = self._run("fprime-seqgen", "--dictionary", dictionary, sequence, made)
        assert made.is_file(), told
        return made.read_bytes()

    def _run(self, program: str, *arguments: str | Path) -> str:
        done = subprocess.run(
            [self.folder / "bin" / program, *arguments], capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout + done.stderr


@pytest.fixture(scope="session")
def fprime() -> FPrime:
    """Give F Prime's programs, made by `scripts/fprime-venv` where need be.

    `OUTCROP_FPRIME_VENV` names the environment; in CI it is made, elsewhere it is taken if it is there.
    """
    folder = Path(os.environ.get("OUTCROP_FPRIME_VENV", ROOT / ".fprime-venv"))
    if not os.environ.get("CI") and not (folder / ".outcrop-fprime").is_file():
        pytest.skip(f"no F Prime in {folder}: scripts/fprime-venv {folder} makes it, within a minute")
    base = {**os.environ, "OUTCROP_VENV": sys.prefix}
    done = subprocess.run(
        [ROOT / "scripts/fprime-venv", folder], capture_output=True, text=True, env=base, check=False
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return FPrime(folder)
