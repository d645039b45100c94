"""Scripts of attackers against the ground and the uplink, and what came of them.

    .venv/bin/python -m studies.adversary --scripts 3000
    .venv/bin/python -m studies.adversary --scripts 100 --processes

With `--processes` all scripts are against the ground, and server, commands and executions are processes of
their own, the executions killed at times.
"""

from __future__ import annotations

import argparse
import logging
import secrets
import tempfile
import time
from collections import Counter
from pathlib import Path

from studies.common.attack_processes import ProcessScript
from tests.adversary.ground import make_ground
from tests.adversary.model import Script as RoverScript
from tests.adversary.oracle import BAD
from tests.adversary.service import Script as GroundScript


def main() -> None:
    """Print the counts; end with 1 if an attacker got through."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--scripts", type=int, default=3000, help="half against ground and rover, half the rover"
    )
    parser.add_argument("--processes", action="store_true", help="real processes, killed at times")
    parser.add_argument("--seed", type=int, default=secrets.randbelow(2**31))
    asked = parser.parse_args()
    logging.disable(logging.CRITICAL)
    total: Counter[str] = Counter()
    noted: list[str] = []
    begun = time.process_time()
    with tempfile.TemporaryDirectory(prefix="outcrop-adversary-") as place:
        ground = make_ground(Path(place) / "ground")
        for number in range(asked.scripts):
            seed = asked.seed + number
            with tempfile.TemporaryDirectory(dir=place) as folder:
                if asked.processes:
                    rover = ProcessScript(Path(folder), seed, ground).play()
                elif number % 2:
                    script = RoverScript(Path(folder), seed)
                    script.play()
                    rover = script.rover
                else:
                    rover = GroundScript(Path(folder), seed, ground).play()
            total += rover.found
            noted += [f"seed {seed}: {what}" for what in rover.noted]
    print("\n".join(noted[:200]))
    bad = {name: total[name] for name in BAD}
    print(
        f"seeds from {asked.seed}: {total['scripts']} scripts, {total['packages made']} packages made by the "
        f"ground, {total['packages']} sent, {total['runs']} ran, "
        f"{total['executions killed']} killed; {time.process_time() - begun:.0f} s of CPU"
    )
    print(bad)
    raise SystemExit(1 if any(bad.values()) else 0)


if __name__ == "__main__":
    main()
