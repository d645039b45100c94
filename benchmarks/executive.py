"""Speed of the executive beside py_trees: see `executive_speed.py`.

    .venv/bin/python benchmarks/executive.py [--quick] [--only STUDY] [--repeat N] [--out FILE]

This file bears the name of the package. So that scripts of this folder still find the package, it puts the
folder last in the search and, when it is imported in place of the package, gives way to it.
"""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

here = Path(__file__).resolve().parent
sys.path[:] = [*(place for place in sys.path if Path(place).resolve() != here), str(here)]

if __name__ == "__main__":
    importlib.import_module("executive_speed").main()
else:
    del sys.modules[__name__]
    importlib.import_module(__name__)
