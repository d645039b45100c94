"""Carry a plan out on a robot behind the bridge: python drive.py PLAN ADDRESS FOLDER."""

import sys
from pathlib import Path

from executive.runtime import LiveRuntime
from executive.runtime.wire import Address, WireRover

plan, address, folder = Path(sys.argv[1]), Address.parse(sys.argv[2]), Path(sys.argv[3])
folder.mkdir(parents=True, exist_ok=True)
rover = WireRover(address, run=folder.name, out=folder)
rover.wait_ready()
runtime = LiveRuntime(plan.read_text(), rover, run_id=folder.name, journal=folder / "journal.jsonl")
outcome = runtime.run()
for record in outcome.trace:
    print(f"{record.t_ms / 1000:8.3f} s  {record.event:10} {' '.join(map(str, record.arguments))}")
rover.wait_for_products(10)
rover.close(over=True)
print(outcome.outcome)
