"""The reference rover of examples/wire_rover, on a clock that a test moves."""

from __future__ import annotations

import itertools
import runpy
from pathlib import Path

EXAMPLE = Path(__file__).parents[3] / "examples" / "wire_rover" / "rover.py"


def test_a_drive_ends_at_its_goal_even_if_the_clock_ticks_within_a_step() -> None:
    space = runpy.run_path(str(EXAMPLE))
    ticks = itertools.count(1000)
    space["Rover"].step.__globals__["clock"] = lambda: next(ticks)
    rover = space["Rover"]()
    assert rover.begin(("run", "far", 1), "navigate", {"x": 1.0, "y": 0.0}) == ""
    for k in range(1, 20):
        rover.step(0.1)
        assert ((("run", "far", 1) in rover.done), round(rover.x, 6)) == (False, round(0.05 * k, 6))
    rover.step(0.1)
    assert (("run", "far", 1) in rover.done, round(rover.x, 6)) == (True, 1.0)
