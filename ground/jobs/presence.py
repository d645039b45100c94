"""Which workers there are and how they fare, told in small files of the shared data folder.

A file and not a row: it costs an idle service no statement, and a worker whose database is away is still
heard of.
"""

from __future__ import annotations

import contextlib
import json
import re
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

from ground.durable import make_folder

BEAT_S = 10.0
"""How often a worker says that it is there."""
HASTE_S = 1.0
"""How soon after it spoke it speaks again of how much it does: short jobs change that ten times a second."""
GONE_S = 45.0
"""A worker that missed four beats is gone; a slow engine or a full disk costs one or two."""
FORGOTTEN_S = 2 * 86_400.0
"""What dead workers and their work left so long ago is removed; no job takes longer than a day."""
SUFFIX = ".worker"
TALLY = ".tally"
"""What it counts (`ground.jobs.tally`); a file of its own, so that servers of an older version hear of it."""


@dataclass(frozen=True, slots=True)
class Presence:
    """What a worker says of itself: an empty `trouble` is well, `since_utc` (ISO 8601) when it began."""

    name: str
    executor: str
    running: int
    trouble: str = ""
    since_utc: str = ""

    def told(self) -> str:
        """Return its trouble in a line."""
        since = f" since {self.since_utc}" if self.since_utc else ""
        return f"{self.trouble}{since}, tried again"


class Beat:
    """Says every ten seconds that a worker is there, and sooner when something of it changed: trouble at
    once, how much it does at the first look a second after the last word.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._last: Presence | None = None
        self._at = 0.0

    def say(self, presence: Presence, tally: Callable[[], str] | None = None) -> None:
        """Write the file if it is time, and beside it what was counted; a folder that takes none has none."""
        now = time.monotonic()
        if now - self._at < self._patience_s(presence):
            return
        with contextlib.suppress(OSError):
            make_folder(self._folder)
            if tally is not None:
                self._write(presence.name, TALLY, tally())
            self._write(presence.name, SUFFIX, json.dumps(asdict(presence)) + "\n")
            self._last, self._at = presence, now
            for old in self._folder.iterdir():
                if old.is_file() and time.time() - old.stat().st_mtime > FORGOTTEN_S:
                    old.unlink(missing_ok=True)

    def _patience_s(self, presence: Presence) -> float:
        if self._last is None or replace(self._last, running=presence.running) != presence:
            return 0.0
        return BEAT_S if self._last == presence else HASTE_S

    def _write(self, name: str, suffix: str, text: str) -> None:
        path = _path(self._folder, name, suffix)
        draft = path.with_name(f"{path.name}.draft")
        draft.write_text(text, encoding="utf-8")
        draft.replace(path)

    def leave(self) -> None:
        """Remove the files: the worker ended in order."""
        if self._last is not None:
            with contextlib.suppress(OSError):
                for suffix in (SUFFIX, TALLY):
                    _path(self._folder, self._last.name, suffix).unlink(missing_ok=True)


def present(folder: Path) -> list[Presence]:
    """Return the workers that are there, by name."""
    return [presence for presence, _ in heard(folder)]


def heard(folder: Path) -> list[tuple[Presence, float]]:
    """Return the workers that are there, by name, with the seconds since each was heard of."""
    found = []
    for path, age_s in still_heard(folder, SUFFIX):
        with contextlib.suppress(OSError, ValueError, TypeError):
            found.append((Presence(**json.loads(path.read_text(encoding="utf-8"))), age_s))
    return found


def still_heard(folder: Path, suffix: str) -> Iterator[tuple[Path, float]]:
    """Yield the files of workers that are there, by name, with the seconds since each was written."""
    for path in sorted(folder.glob(f"*{suffix}")):
        with contextlib.suppress(OSError):
            age_s = time.time() - path.stat().st_mtime
            if age_s < GONE_S:
                yield path, age_s


def utc_text(moment: datetime | None) -> str:
    """Return a moment as ISO 8601 to the second, empty for None."""
    return "" if moment is None else f"{moment.astimezone(UTC):%Y-%m-%dT%H:%M:%SZ}"


def _path(folder: Path, name: str, suffix: str) -> Path:
    return folder / f"{re.sub(r'[^A-Za-z0-9_.-]', '-', name)}{suffix}"
