"""Reference material that stands beside the repository on development machines."""

from __future__ import annotations

import os
import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[1]
SHARED = ROOT.parent / "shared"


def shared(relative: str) -> Path:
    """Return a path of the reference material, or skip the test where it is absent."""
    path = SHARED / relative
    if not path.exists():
        pytest.skip(f"reference material not present: shared/{relative}")
    return path


def script(name: str) -> ModuleType:
    """Return a module of the folder `scripts`, which is not a package."""
    folder = str(ROOT / "scripts")
    sys.path.insert(0, folder)
    try:
        return import_module(name)
    finally:
        sys.path.remove(folder)


def needed(package: str) -> Any:
    """Return a package of the extra `test`; where it is not installed the tests skip, but never in CI."""
    if os.environ.get("CI") == "true":
        return import_module(package)
    return pytest.importorskip(package, reason=f"needs {package}: pip install 'outcrop[test]'")
