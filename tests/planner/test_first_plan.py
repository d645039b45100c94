"""What a first plan in a fresh process does not wait for."""

from __future__ import annotations

import subprocess
import sys

PROBE = """
import sys
import planner.solve
print(*(name for name in sys.modules if name in ("scipy.sparse", "scipy.optimize", "ortools", "shapely")))
"""


def test_planning_imports_no_package_that_a_first_plan_does_not_need() -> None:
    found = subprocess.run([sys.executable, "-c", PROBE], capture_output=True, text=True, check=True)
    assert found.stdout.split() == []
