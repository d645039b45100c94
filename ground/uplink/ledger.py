"""What a rover began, so that none is carried out twice: `executed.jsonl` and its copy in the rover's world.

An entry counts when it is in both files, each written beside its place, synchronised and renamed. Each line
carries a SHA-256 over its text and the sum of the line before, so that of two files the longer sound one is
known and whatever happens to one of them is mended from the other. Who can change both owns the rover.
Lines without a sum are of versions that had one file and appended to it; their torn tail is cut off.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from ground.durable import sync
from ground.errors import AlreadyExecutedError, InvalidInputError

LEDGER, COPY, LOCK = "executed.jsonl", "executed.copy.jsonl", "executed.lock"

Entry = Mapping[str, object]

_MARK = ',"sum":"'


class Disk(Protocol):
    """What the ledger needs of a file system; only what was synchronised survives a crash."""

    def read(self, path: Path) -> bytes | None:
        """Return the content of a file, None if there is none."""

    def write(self, path: Path, content: bytes) -> None:
        """Give a file this content."""

    def sync(self, path: Path) -> None:
        """Make the content of a file, or the names in a folder, durable."""

    def rename(self, source: Path, target: Path) -> None:
        """Put a file in the place of another."""


class RealDisk:
    """The file system of the machine."""

    def read(self, path: Path) -> bytes | None:
        try:
            return path.read_bytes()
        except FileNotFoundError:
            return None

    def write(self, path: Path, content: bytes) -> None:
        path.write_bytes(content)

    def sync(self, path: Path) -> None:
        sync(path)

    def rename(self, source: Path, target: Path) -> None:
        source.replace(target)


@dataclass(frozen=True, slots=True)
class _Read:
    """The sound lines at the head of a file, what follows them, and the sum of the last."""

    lines: tuple[str, ...] = ()
    sums: tuple[str, ...] = ()
    entries: tuple[Entry, ...] = ()
    rest: bytes = b""
    summed: bool = False


class Ledger:
    """The entries of a rover, oldest first; `repaired` says in a sentence what had to be mended."""

    def __init__(self, folder: Path, disk: Disk | None = None) -> None:
        """Read the ledger of a world, and mend it.

        Raises
        ------
        InvalidInputError
            If it is damaged beyond what the copy can tell; nothing may be executed then.
        """
        self._folder, self._disk = folder, disk or RealDisk()
        self.repaired = ""
        main, copy = (self._disk.read(folder / name) for name in (LEDGER, COPY))
        chosen = self._choose(main, copy)
        self._lines, self.entries = list(chosen.lines), list(chosen.entries)
        self._sum = chosen.sums[-1] if chosen.sums else ""
        if chosen.summed and main != copy:
            self._write()

    def append(self, entry: Entry) -> None:
        """Add an entry; it is durable in both files when this returns."""
        body = json.dumps(dict(entry), separators=(",", ":"))[:-1]
        self._sum = hashlib.sha256((self._sum + body).encode()).hexdigest()
        self._lines.append(f'{body}{_MARK}{self._sum}"}}')
        self.entries.append(entry)
        self._write()

    def _write(self) -> None:
        content = "".join(line + "\n" for line in self._lines).encode()
        for name in (LEDGER, COPY):
            draft = self._folder / f".{name}.draft"
            self._disk.write(draft, content)
            self._disk.sync(draft)
            self._disk.rename(draft, self._folder / name)
            self._disk.sync(self._folder)

    def _choose(self, main: bytes | None, copy: bytes | None) -> _Read:
        place = self._folder / LEDGER
        first, second = _read(main or b""), _read(copy or b"")
        if copy is None and not first.summed:  # of a version with one file, or new
            if b"\n" in first.rest:
                raise InvalidInputError(
                    f"the ledger {place} is damaged at line {len(first.lines) + 1}; nothing may be executed"
                )
            if first.rest:
                self.repaired = (
                    f"the torn last line of the ledger {place} was cut off; nothing of it was sent"
                )
            return first
        sound = [read for read in (first, second) if read.summed and not read.rest]
        if not sound:
            raise InvalidInputError(
                f"the ledger {place} is damaged at line {len(first.lines) + 1} and its copy {COPY} cannot "
                "mend it; nothing may be executed"
            )
        longer = max(sound, key=lambda read: len(read.lines))
        if any(read.sums != longer.sums[: len(read.sums)] for read in sound):
            raise InvalidInputError(f"the ledger {place} and its copy {COPY} tell different things")
        if first.sums != longer.sums or first.rest:
            self.repaired = f"the ledger {place} was damaged and was mended from its copy"
        elif second.rest or copy is None:
            self.repaired = f"the copy {COPY} of the ledger was missing or damaged and was mended"
        return longer


def _read(content: bytes) -> _Read:
    lines: list[str] = []
    sums: list[str] = []
    entries: list[Entry] = []
    summed, last = False, ""
    at = 0
    while at < len(content):
        end = content.find(b"\n", at)
        raw = content[at:] if end < 0 else content[at:end]
        line = raw.decode("utf-8", "replace")
        body, mark, _ = line.rpartition(_MARK)
        total = hashlib.sha256((last + (body if mark else line)).encode("utf-8", "replace")).hexdigest()
        sound = line == f'{body}{_MARK}{total}"}}' and end >= 0 if mark else not summed
        entry = _entry(line) if sound and line.encode("utf-8", "replace") == raw else None
        if entry is None:
            break
        summed, last = bool(mark), total
        lines.append(line)
        sums.append(total)
        entries.append(entry)
        at = len(content) if end < 0 else end + 1
    return _Read(tuple(lines), tuple(sums), tuple(entries), content[at:], summed)


def _entry(line: str) -> Entry | None:
    """Return the entry of a line; None if it is none: of what was begun, or which trust file was used."""
    try:
        entry = json.loads(line)
    except (ValueError, RecursionError):
        return None
    if not isinstance(entry, dict):
        return None
    begun = all(isinstance(entry.get(name), str) for name in ("mission", "sha256"))
    known = (begun and type(entry.get("sequence")) is int) or isinstance(entry.get("trust"), str)
    return entry if known else None


@contextlib.contextmanager
def locked_ledger(folder: Path, what: str) -> Iterator[Ledger]:
    """Give the ledger of a world, which no other process has meanwhile; `what` is done, for the others.

    Raises
    ------
    AlreadyExecutedError
        If another process has it; the message says what that one does.
    InvalidInputError
        If there is no such world, or the ledger is damaged.
    """
    try:
        descriptor = os.open(folder / LOCK, os.O_RDWR | os.O_CREAT, 0o644)
    except OSError as err:
        raise InvalidInputError(f"the ledger of {folder} cannot be locked: {err.strerror}") from err
    with os.fdopen(descriptor, "r+", encoding="utf-8", errors="replace") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as err:
            raise AlreadyExecutedError(
                f"the rover of {folder} is busy: {lock.readline()[:200].strip() or 'another process has it'}"
            ) from err
        lock.truncate(0)  # whoever had it before
        lock.write(f"process {os.getpid()} does {what}\n")
        lock.flush()
        try:
            yield Ledger(folder)
        except OSError as err:
            raise InvalidInputError(f"{err.filename or folder}: {err.strerror or err}") from err


def begun(entries: Sequence[Entry]) -> Iterator[Entry]:
    """Yield the entries of packages, oldest first."""
    return (entry for entry in entries if "sequence" in entry)


def pinned(entries: Sequence[Entry]) -> Entry | None:
    """Return the entry of the trust file that was last used."""
    return next((entry for entry in reversed(entries) if "trust" in entry), None)
