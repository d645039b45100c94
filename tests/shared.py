"""Reference material that stands beside the repository on development machines."""

from __future__ import annotations

from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
SHARED = ROOT.parent / "shared"


def shared(relative: str) -> Path:
    """Return a path of the reference material, or skip the test where it is absent."""
    path = SHARED / relative
    if not path.exists():
        pytest.skip(f"reference material not present: shared/{relative}")
    return path
