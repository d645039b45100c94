"""Where the public instances of contingent planning lie, beside the repository, and their own evaluator."""

from __future__ import annotations

import importlib
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

FOLDER = Path(__file__).resolve().parents[2].parent / "shared" / "contingency"
INSTANCES = FOLDER / "instances"


def published() -> dict[str, Any]:
    """Return what is published of each instance, by its name."""
    found: dict[str, Any] = json.loads((FOLDER / "results.json").read_text(encoding="utf-8"))
    return found


def chosen(names: Sequence[str]) -> list[str]:
    """Return the names given, or those of all instances; ends the program where a name is none of these."""
    known = published()
    for name in names:
        if name not in known:
            raise SystemExit(f'there is no instance "{name}"; known are {", ".join(known)}')
    return list(names or known)


def reference(module: str) -> ModuleType:
    """Return a module of the instances' own: `instance` generates and reads them, `evaluate` judges plans."""
    if str(FOLDER) not in sys.path:
        sys.path.insert(0, str(FOLDER))
    return importlib.import_module(module)
