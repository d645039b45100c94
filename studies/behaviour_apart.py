"""The same day twice: behaviour beside the simulated world, and in a process that cannot import it.

    .venv/bin/python -m studies.behaviour_apart --rover full --seed 2 --out DIR

The journals must be the same byte for byte: then behaviour got nothing from the world but what passes through
`Hardware`. The days are those of `studies.full_day` and `studies.subframe_day`.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from ground.uplink.flight import fly
from rover_iface.registry import find_rover
from rover_iface.terrain import generate_terrain
from studies import full_day, subframe_day
from studies.common.apart import ApartRepertoire, apart

DAYS = {"full": full_day.fly_day, "subframe": subframe_day.fly_day}


def main() -> None:
    """Fly both days and say whether their journals are the same."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rover", choices=list(DAYS), default="full")
    parser.add_argument("--seed", type=int, default=2)
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    fly_day = DAYS[arguments.rover]
    together, alone = arguments.out / "together", arguments.out / "apart"
    fly_day(arguments.seed, together)
    made: list[ApartRepertoire] = []
    # the same plan: the planner's time limit makes another on a busy machine
    plan = (together / "plan.crl").read_text(encoding="utf-8")
    world = json.loads((together / "world.json").read_text(encoding="utf-8"))
    terrain = generate_terrain(arguments.seed)
    make = apart(arguments.rover, made)
    rover = find_rover(arguments.rover)(world, terrain=terrain, seed=arguments.seed, out=alone, make=make)
    fly(plan, rover, alone, run_id="day", sync=False)
    found = [module for own in made for module in own.close()]
    journals = [(folder / "journal.jsonl").read_bytes() for folder in (together, alone)]
    same = journals[0] == journals[1]
    print(f"{len(made)} process, {len(found)} modules of the simulated world in it")
    print(
        f"journals of {len(journals[0])} and {len(journals[1])} bytes: {'the same' if same else 'different'}"
    )
    if not same or found:
        raise SystemExit(1)


if __name__ == "__main__":
    main()
