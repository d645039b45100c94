"""Single flipped bits in backups, stored files and rows: each is to be found, and its place named.

    .venv/bin/python -m studies.flipped_bits --flips 2000

A mission with plan, runs, products and pictures is taken in and worked on; then one bit at a time is flipped,
looked for by what a person would use, and flipped back:

* in a backup: `restore` has to refuse it and to name the part that the bit lies in;
* in a stored file, or a file of a terrain: `check --contents` has to name the file;
* in a row under the audit chain, as the database stores it: `audit verify` has to name the row, or for the
  history itself the event (the chain, where the bit lies in the event's own number or chain).

Not under the chain are hashes of passwords, jobs, sessions, log-ins and keys of requests. A flip that the
database cannot hold (a key that is taken, not a number) is drawn again, and counted.
"""

from __future__ import annotations

import argparse
import random
import secrets
import sqlite3
import struct
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ground.errors import ArchiveError
from ground.gdr.history import verify_chains
from ground.gdr.migrate import migrate
from ground.gdr.repository import Repository, open_repository
from ground.gdr.seals import SECRET, sealed_tables
from ground.records.actor import Actor, Role
from ground.resources.backups.backup import backup
from ground.resources.backups.check_files import damaged_files
from ground.resources.backups.container import LIST, read_list
from ground.resources.backups.restore import restore
from ground.resources.history.verify_rows import verify_rows
from ground.resources.mission_archives.import_mission import import_mission
from ground.resources.people.accounts import ensure_profiles
from ground.resources.tables import METADATA
from ground.resources.targets.bodies import TargetCreate
from ground.resources.targets.create_target import create_target
from ground.settings import load_settings

ARCHIVE = Path(__file__).resolve().parents[1] / "tests" / "ground" / "fixtures" / "v0.1.0" / "mission.zip"
WHO = Actor("Administrator", Role.ADMIN)
HISTORY = ("events", "event_chains")
Draw = Callable[[random.Random], str | None]
"""Flip one bit, look for it and flip it back; return what was missed, "" if nothing, None to draw again."""


def fresh(folder: Path) -> Repository:
    """Return an empty repository of today's schema."""
    repo = open_repository(load_settings(data_dir=folder, database_url="", executor="inline"))
    migrate(repo.database)
    return repo


def filled(folder: Path) -> Repository:
    """Return a repository with a mission that came in whole, and acts of people on it."""
    repo = fresh(folder)
    ensure_profiles(repo)
    mission = import_mission(repo, WHO, ARCHIVE)
    for n in range(4):
        given = TargetCreate(east_m=0.5 * n, north_m=0.25, name=f"Rock {n}", notes="flat, no dust")
        create_target(repo, WHO, mission.id, given)
    return repo


@contextmanager
def flipped(path: Path, byte: int, bit: int) -> Iterator[None]:
    """Have one bit of a file flipped for a while."""
    content = bytearray(path.read_bytes())
    for _ in range(2):
        content[byte] ^= 1 << bit
        path.write_bytes(content)
        if _ == 0:
            yield


def of_backup(repo: Repository, folder: Path) -> Draw:
    """Return what flips a bit of a backup."""
    target = folder / "backup.tar"
    backup(repo, target)
    members = read_list(target).members
    size = target.stat().st_size
    scratch = open_repository(load_settings(data_dir=folder / "scratch", database_url=""))

    def draw(rng: random.Random) -> str | None:
        byte, bit = rng.randrange(size), rng.randrange(8)
        inside = [name for name, (begin, long, _) in members.items() if begin <= byte < begin + long]
        wanted = inside or [LIST, "last block"]
        with flipped(target, byte, bit):
            try:
                restore(scratch, target)
            except ArchiveError as err:
                return "" if any(name in err.message for name in wanted) else f"byte {byte}: {err.message}"
        return f"byte {byte} bit {bit} of the backup"

    return draw


def of_file(repo: Repository) -> Draw:
    """Return what flips a bit of a stored file or of a file of a terrain."""
    stored = [path for name in ("files", "terrains") for path in sorted((repo.data_dir / name).rglob("*"))]
    paths = [path for path in stored if path.is_file() and path.stat().st_size > 0]

    def draw(rng: random.Random) -> str | None:
        path = rng.choice(paths)
        byte, bit = rng.randrange(path.stat().st_size), rng.randrange(8)
        with flipped(path, byte, bit):
            found = damaged_files(repo)
        said = (
            f"files/{path.name.removesuffix('.br')}"
            if len(path.name.removesuffix(".br")) == 64
            else path.relative_to(repo.data_dir).as_posix()
        )
        return "" if said in found else f"{said} byte {byte} bit {bit}: {found}"

    return draw


def turned(value: object, rng: random.Random) -> object | None:
    """Return a stored value with one bit flipped; None where there is none to flip."""
    if isinstance(value, bytes):
        if not value:
            return None
        content = bytearray(value)
        content[rng.randrange(len(content))] ^= 1 << rng.randrange(8)
        return bytes(content)
    if isinstance(value, int):
        return value ^ (1 << rng.randrange(63))
    if isinstance(value, float):
        (bits,) = struct.unpack("<q", struct.pack("<d", value))
        (other,) = struct.unpack("<d", struct.pack("<Q", (bits ^ (1 << rng.randrange(64))) % 2**64))
        return None if other != other else float(other)
    return None


def of_row(repo: Repository) -> Draw:
    """Return what flips a bit of a row of the embedded database."""
    path = repo.database.url.database
    assert path is not None
    raw = sqlite3.connect(path, isolation_level=None)
    raw.text_factory = bytes
    names = [table.name for table in sealed_tables()] + list(HISTORY)
    names = [name for name in names if raw.execute(f"SELECT 1 FROM {name} LIMIT 1").fetchone()]

    def draw(rng: random.Random) -> str | None:
        table = METADATA.tables[rng.choice(names)]
        rows = [r for (r,) in raw.execute(f"SELECT rowid FROM {table.name}")]
        rowid, column = rng.choice(rows), rng.choice([c.name for c in table.columns if c.name not in SECRET])
        keys = [c.name for c in table.primary_key.columns]

        def read(wanted: list[str]) -> list[Any]:
            listed = ", ".join(f'"{name}"' for name in wanted)
            query = f"SELECT {listed} FROM {table.name} WHERE rowid = ?"
            return list(raw.execute(query, (rowid,)).fetchone())

        def write(value: object) -> None:
            taken = "CAST(? AS TEXT)" if isinstance(value, bytes) else "?"
            raw.execute(f'UPDATE {table.name} SET "{column}" = {taken} WHERE rowid = ?', (value, rowid))

        (value,), before = read([column]), read(keys)
        other = turned(value, rng)
        if other is None:
            return None
        try:
            write(other)
        except sqlite3.Error:
            return None
        after = read(keys)
        with repo.database.read() as session:
            broken = [(f.chain_id, f.seq) for f in verify_chains(session)[1]]
            odd = {f.row for f in verify_rows(session).faults}
        write(value)
        told = [
            [x.decode(errors="replace") if isinstance(x, bytes) else x for x in key]
            for key in (before, after)
        ]
        if table.name == "events":
            exact = column not in keys
            named = any(tuple(key) in broken if exact else key[0] in dict(broken) for key in told)
        elif table.name == "event_chains":
            named = any(key[0] in dict(broken) for key in told)
        else:
            named = any("/".join([table.name, *map(str, key)]) in odd for key in told)
        return "" if named else f"{table.name}.{column} of {told[0]}: {value!r:.60} to {other!r:.60}"

    return draw


def study(flips: int, seed: int) -> tuple[dict[str, Counter[str]], list[str]]:
    """Return by place how many flips were made, found and drawn again; and what was missed."""
    rng = random.Random(seed)
    counts: dict[str, Counter[str]] = {}
    missed: list[str] = []
    with tempfile.TemporaryDirectory(prefix="outcrop-bits-") as work:
        folder = Path(work)
        repo = filled(folder / "data")
        with repo.database.read() as session:
            assert verify_chains(session)[1] == verify_rows(session).faults == []
        draws = {"backup": of_backup(repo, folder), "file": of_file(repo), "row": of_row(repo)}
        places = list(draws)
        for n in range(flips):
            place = places[n % len(places)]
            tally = counts.setdefault(place, Counter(made=0, found=0, again=0))
            while (said := draws[place](rng)) is None:
                tally["again"] += 1
            tally["made"] += 1
            tally["found"] += not said
            missed += [f"{place}: {said}"] if said else []
        repo.database.dispose()
    return counts, missed


def main() -> None:
    """Run the study and print what was found."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--flips", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=None)
    options = parser.parse_args()
    seed = secrets.randbelow(2**31) if options.seed is None else options.seed
    began = time.process_time()
    counts, missed = study(options.flips, seed)
    print(f"seed {seed}, {options.flips} flips, {time.process_time() - began:.0f} s of processor time")
    for place, tally in counts.items():
        print(f"{place:8s} {tally['found']} of {tally['made']} found and named, {tally['again']} drawn again")
    for line in missed:
        print("missed", line)
    raise SystemExit(1 if missed else 0)


if __name__ == "__main__":
    main()
