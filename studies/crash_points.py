"""Crash points of the rover's ledger and of the file store, on disks that lose what was not synchronised.

    TMPDIR=/dev/shm .venv/bin/python -m studies.crash_points --points 100000

Each point is a power cut at a random operation of a random sequence of entries, some of them while the
ledger is mended after the one before. An entry whose `append` returned has to be there afterwards (else a
package could run twice), none may be there that was never given, and the ledger has to open. A file whose
`put` returned has to be in the store with its content, and no other may stand there damaged. The journal
has a study of its own, `executive_crash_points`. The store's part writes real files: in memory
100,000 points take 8 minutes of a processor; on a disk they did not end in 90.
"""

from __future__ import annotations

import argparse
import random
import secrets
import tempfile
from collections import Counter
from pathlib import Path

from ground.errors import GroundError
from ground.gdr.files import FileStore
from ground.uplink.ledger import Ledger
from studies.common.crashing_folder import CrashingFolder
from tests.ground.crashing_disk import CrashError, CrashingDisk

FOLDER = Path("world")
OPERATIONS_OF_A_FILE = 9
"""At most: three folders made and their names synchronised, the file synchronised, renamed, and its name."""
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


def life_of_a_store(rng: random.Random, scratch: Path) -> Counter[str]:
    """Return what became of the files of a store whose machine goes off several times."""
    found: Counter[str] = Counter()
    (scratch / "0").mkdir()
    disk = CrashingFolder(scratch / "0", rng)
    sure: set[str] = set()
    for life in range(1, rng.randint(2, 7)):
        disk.stop_at = rng.randrange(3 * OPERATIONS_OF_A_FILE)
        try:
            with disk.watched():
                store = FileStore(disk.folder / "files")
                for _ in range(8):
                    content = rng.randbytes(rng.randrange(1, 200))
                    put = store.put_packed if rng.random() < 0.5 else store.put_bytes
                    sure.add(put(content).sha256)
        except CrashError:
            found["points"] += 1
        disk = disk.after_crash(scratch / str(life))
        store = FileStore(disk.folder / "files")
        there = set(store.hashes())
        found["lost"] += len(sure - there)
        found["silent damage"] += sum(not store.is_sound(sha256) for sha256 in there)
        sure &= there
    return found


def study(points: int, seed: int) -> Counter[str]:
    """Return the counts over at least so many crash points of the ledger."""
    rng = random.Random(seed)
    total: Counter[str] = Counter()
    while total["points"] + total["does not open"] < points:
        total += one_life(rng)
    return total


def study_of_the_store(points: int, seed: int) -> Counter[str]:
    """Return the counts over at least so many crash points of the file store."""
    rng = random.Random(seed)
    total: Counter[str] = Counter()
    while total["points"] < points:
        with tempfile.TemporaryDirectory(prefix="outcrop-store-") as scratch:
            total += life_of_a_store(rng, Path(scratch))
    return total


def main() -> None:
    """Print the counts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=secrets.randbelow(2**31))
    asked = parser.parse_args()
    for what, looked_at in (("ledger", study), ("store", study_of_the_store)):
        found = looked_at(asked.points, asked.seed)
        bad = {name: found[name] for name in ("lost", "silent damage", "does not open")}
        print(f"{what}, seed {asked.seed}: {found['points']} crash points, {bad}", flush=True)


if __name__ == "__main__":
    main()
