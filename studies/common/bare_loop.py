"""How fast a machine is, told by the bare loop: executive and abstract rover on a demo's ten-target plan.

The limits on a run's processor time were set beside the figure that 10,000 such runs take 22 s. Machines
differ threefold: what a run costs in bare loops of the same minute tells more than its seconds.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path

from executive.runtime.loading import load_plan
from executive.runtime.run import run_plan
from rover_iface.registry import find_rover
from rover_iface.simulator.world import load_world

ROOT = Path(__file__).parents[2]
WHERE_LIMITS_WERE_SET_MS = 2.2
WARM, RUNS = 20, 300


def made_day(folder: Path, seed: int) -> Path:
    """Return the folder of a demo day made with a seed, its plan `plan.crl`, its world `problem.json`."""
    made = [sys.executable, "-m", "ground.cli", "demo", "--seed", str(seed), "--out", "day"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"}
    subprocess.run(made, cwd=folder, env=environment, check=True, stdout=subprocess.DEVNULL)
    return folder / "day"


class BareLoop:
    """Runs of a day's plan with nothing written."""

    def __init__(self, day: Path) -> None:
        problem = json.loads((day / "problem.json").read_text(encoding="utf-8"))
        self._world = load_world({"format": "world/1", "problem": problem})
        self._plan = load_plan((day / "plan.crl").read_text(encoding="utf-8"))
        self.ms(WARM)

    def ms(self, runs: int = RUNS) -> float:
        """Return the mean processor time of so many runs, in milliseconds."""
        began = time.process_time()
        for seed in range(runs):
            run_plan(self._plan, find_rover("abstract")(self._world, seed=seed))
        return 1000 * (time.process_time() - began) / runs


def beside(took_ms: float, limit_ms: float, bare_ms: float) -> str:
    """Return in words what something takes beside the bare loop here, and where limits were set."""
    there_ms = took_ms * WHERE_LIMITS_WERE_SET_MS / bare_ms
    return (
        f"{took_ms / bare_ms:.2f} bare loops of {bare_ms:.2f} ms, "
        f"so {there_ms:.2f} ms where one takes {WHERE_LIMITS_WERE_SET_MS} ms ({limit_ms:g} asked)"
    )
