"""Crash points of the rover's ledger on a disk that loses, tears and reorders what was not synchronised.

    .venv/bin/python -m studies.crash_points --points 100000

Each point is a power cut at a random operation of a random sequence of entries, some of them while the
ledger is mended after the one before. An entry whose `append` returned has to be there afterwards (else a
package could run twice), none may be there that was never given, and the ledger has to open.
"""

from __future__ import annotations

import argparse
import random
import secrets
from collections import Counter
from pathlib import Path

from ground.errors import GroundError
from ground.uplink.ledger import Ledger
from tests.ground.crashing_disk import CrashError, CrashingDisk

FOLDER = Path("world")
OPERATIONS_OF_AN_ENTRY = 8
"""Write, synchronise, rename and synchronise the folder, for each of two files."""


def one_life(rng: random.Random) -> Counter[str]:
    """Return what became of the entries of a rover whose machine goes off several times."""
    found: Counter[str] = Counter()
    disk, sure, given = CrashingDisk(rng), 0, 0
    for _ in range(rng.randint(1, 6)):
        disk.stop_at = disk.operations + rng.randrange(3 * OPERATIONS_OF_AN_ENTRY)
        try:
            ledger = Ledger(FOLDER, disk)
            given = len(ledger.entries)
            for _ in range(4):
                given += 1
                ledger.append({"mission": "M", "sequence": given, "sha256": str(given)})
                sure = given
        except CrashError:
            found["points"] += 1
        except GroundError:
            found["does not open"] += 1
            return found
        disk = disk.after_crash()
        try:
            numbers = [entry["sequence"] for entry in Ledger(FOLDER, disk).entries]
        except GroundError:
            found["does not open"] += 1
            return found
        if numbers != list(range(1, len(numbers) + 1)) or len(numbers) > given:
            found["silent damage"] += 1
        if len(numbers) < sure:
            found["lost"] += 1
        sure = len(numbers)
        disk = disk.after_crash()
    return found


def study(points: int, seed: int) -> Counter[str]:
    """Return the counts over at least so many crash points."""
    rng = random.Random(seed)
    total: Counter[str] = Counter()
    while total["points"] + total["does not open"] < points:
        total += one_life(rng)
    return total


def main() -> None:
    """Print the counts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=secrets.randbelow(2**31))
    asked = parser.parse_args()
    found = study(asked.points, asked.seed)
    bad = {name: found[name] for name in ("lost", "silent damage", "does not open")}
    print(f"seed {asked.seed}: {found['points']} crash points, {bad}")


if __name__ == "__main__":
    main()
