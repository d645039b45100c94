"""Which workers there are and how they fare, told in small files of the shared data folder.

A file and not a row: it costs an idle service no statement, and a worker whose database is away is still
heard of.
"""

from __future__ import annotations

import contextlib
import json
import re
import time
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path

from ground.durable import make_folder

BEAT_S = 10.0
"""How often a worker says that it is there."""
GONE_S = 45.0
"""A worker that missed four beats is gone; a slow engine or a full disk costs one or two."""
FORGOTTEN_S = 2 * 86_400.0
"""What dead workers and their work left so long ago is removed; no job takes longer than a day."""
SUFFIX = ".worker"


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
    """Says every ten seconds that a worker is there, and at once when something of it changed."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._last: Presence | None = None
        self._at = 0.0

    def say(self, presence: Presence) -> None:
        """Write the file if it is time; a folder that takes none leaves it undone."""
        now = time.monotonic()
        if presence == self._last and now - self._at < BEAT_S:
            return
        path = _path(self._folder, presence.name)
        draft = path.with_suffix(".draft")
        with contextlib.suppress(OSError):
            make_folder(self._folder)
            draft.write_text(json.dumps(asdict(presence)) + "\n", encoding="utf-8")
            draft.replace(path)
            self._last, self._at = presence, now
            for old in self._folder.iterdir():
                if old.is_file() and time.time() - old.stat().st_mtime > FORGOTTEN_S:
                    old.unlink(missing_ok=True)

    def leave(self) -> None:
        """Remove the file: the worker ended in order."""
        if self._last is not None:
            with contextlib.suppress(OSError):
                _path(self._folder, self._last.name).unlink(missing_ok=True)


def present(folder: Path) -> list[Presence]:
    """Return the workers that are there, by name."""
    found = []
    for path in sorted(folder.glob(f"*{SUFFIX}")):
        with contextlib.suppress(OSError, ValueError, TypeError):
            if time.time() - path.stat().st_mtime < GONE_S:
                found.append(Presence(**json.loads(path.read_text(encoding="utf-8"))))
    return found


def utc_text(moment: datetime | None) -> str:
    """Return a moment as ISO 8601 to the second, empty for None."""
    return "" if moment is None else f"{moment.astimezone(UTC):%Y-%m-%dT%H:%M:%SZ}"


def _path(folder: Path, name: str) -> Path:
    return folder / f"{re.sub(r'[^A-Za-z0-9_.-]', '-', name)}{SUFFIX}"
