"""Exceptions at random inside actions: whether each ends its own task, and the plan goes on.

    .venv/bin/python -m studies.planted_errors --out DIR [--errors 50] [--seed N]

Days of the contract's world, in turn on the `subframe` and the `full` rover, are flown by the executive with
errors planted at uses of the hardware that are drawn at random. Each must be a task result with the reason
`internal-error` and a traceback in `rover.log`, and each day must come to its end.
"""

from __future__ import annotations

import argparse
import json
import secrets
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ground.uplink.flight import fly
from rover_iface.behaviour import repertoire
from rover_iface.contract import write_contract_world
from rover_iface.simulator import full_rover, subframe_rover
from rover_iface.simulator.engine import INTERNAL_ERROR
from studies.common.planted import PlantedHardware, planted

ROVERS = {
    "subframe": (subframe_rover.make_rover, repertoire.subframe),
    "full": (full_rover.make_rover, repertoire.full),
}
PER_DAY = 6
"""Errors a day: half of its tasks meet none."""

PLAN = """
(plan :id day :node (block :id all :node-list (
  (task :id see-1 :continue-on-failure t :action trackstart :parameters (target = T1))
  (task :id see-2 :continue-on-failure t :action trackstart :parameters (target = T2))
  (task :id look :continue-on-failure t :action pointmast :parameters (target = T1))
  (task :id picture :continue-on-failure t :action image :parameters (target = T2 instrument = scicam))
  (task :id go-1 :continue-on-failure t :action navigate :parameters (target = T1 mode = track))
  (task :id hand-1 :continue-on-failure t :action handoff :parameters (target = T1))
  (task :id place-1 :continue-on-failure t :action ipplaceinstrument :parameters (target = T1))
  (task :id back :continue-on-failure t :action navigate :parameters (x = 1.5 y = 0.0 mode = track))
  (task :id stop-1 :continue-on-failure t :action trackstop :parameters (target = T1))
  (task :id turn :continue-on-failure t :action turn :parameters (angle = 0.2))
  (task :id around :continue-on-failure t :action imagepanorama :parameters (from_azimuth = 0.5
    to_azimuth = 0.0))
  (task :id last :action wait :parameters (duration_s = 5)))))
"""


def fly_day(rover: str, at: list[int], out: Path, world: Path, *, plan: str = PLAN) -> dict[str, object]:
    """Return what came of a day with errors at these uses of the hardware; its folder is `out`."""
    make, own = ROVERS[rover]
    made: list[PlantedHardware] = []
    flown = make(world, seed=4, out=out, make=planted(own, at, made))
    flight = fly(plan, flown, out, run_id="day", sync=False)
    lines = (json.loads(line) for line in (out / "journal.jsonl").read_text("utf-8").splitlines())
    events = [event for line in lines for event in line.get("events", ())]
    failed = [e for e in events if e["e"] == "result" and e["reason"] == INTERNAL_ERROR]
    log = out / "rover.log"
    return {
        "rover": rover,
        "at": at,
        "uses": made[0].uses,
        "planted": made[0].raised,
        "results": len(failed),
        "tasks": [e["command"][1] for e in failed],
        "tracebacks": log.read_text("utf-8").count("PlantedError: ") if log.exists() else 0,
        "ended": flight.outcome.outcome,
        "last": dict(flight.outcome.outcomes).get("last", ""),
    }


def went_on(day: Mapping[str, Any]) -> bool:
    """Return whether the plan of a day came to its last task, which may have met an error of its own."""
    return day["last"] == "SUCCEEDED" or "last" in day["tasks"]


def main() -> None:
    """Fly days until so many errors were met, and print what became of them."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--errors", type=int, default=50)
    parser.add_argument("--seed", type=int, default=None, help="drawn and printed when absent")
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    seed = secrets.randbelow(1 << 31) if arguments.seed is None else arguments.seed
    rng = np.random.default_rng(seed)
    world = write_contract_world(arguments.out / "world")
    print(f"seed {seed}")
    clean = {name: fly_day(name, [], arguments.out / f"clean-{name}", world) for name in ROVERS}
    found: list[dict[str, object]] = []
    while sum(int(str(day["planted"])) for day in found) < arguments.errors:
        rover = list(ROVERS)[len(found) % 2]
        at = sorted(int(n) for n in rng.integers(1, int(str(clean[rover]["uses"])) + 1, PER_DAY))
        found.append(fly_day(rover, at, arguments.out / f"{len(found):02d}-{rover}", world))
        print(json.dumps(found[-1]), flush=True)
    count = {k: sum(int(str(d[k])) for d in found) for k in ("planted", "results", "tracebacks")}
    on = sum(map(went_on, found))
    print(f"{len(found)} days: {count}; {on} plans went on to their last task")
    if not count["planted"] == count["results"] == count["tracebacks"] or on != len(found):
        raise SystemExit(1)


if __name__ == "__main__":
    main()
