"""A disk that loses, tears and reorders what was not synchronised, and may stop at any operation."""

from __future__ import annotations

import random
from pathlib import Path


class CrashError(BaseException):
    """The machine is off."""


class CrashingDisk:
    """Files in memory: what programs see now, and what would be there after a power cut.

    Until a file is synchronised any of its old, new, cut or zeroed contents may be what a crash leaves; until
    its folder is, a rename may have happened or not, each by itself. `stop_at` is the operation, counted from
    0, at which the machine goes off, before or in the middle of it.
    """

    def __init__(self, rng: random.Random, stop_at: int | None = None) -> None:
        self.rng, self.stop_at, self.operations = rng, stop_at, 0
        self.seen: dict[Path, bytes] = {}
        self.durable: dict[Path, bytes] = {}
        self._pending: list[tuple[Path, bytes]] = []
        self._unsynced: set[Path] = set()

    def _tick(self) -> None:
        if self.operations == self.stop_at:
            raise CrashError
        self.operations += 1

    def read(self, path: Path) -> bytes | None:
        return self.seen.get(path)

    def write(self, path: Path, content: bytes) -> None:
        self._tick()
        self.seen[path] = content
        self._unsynced.add(path)

    def sync(self, path: Path) -> None:
        self._tick()
        if path in self.seen:
            self._unsynced.discard(path)
            self.durable.setdefault(path, self.seen[path])
            self.durable[path] = self.seen[path]
            return
        for name, content in self._pending:
            self.durable[name] = content
        self._pending.clear()

    def rename(self, source: Path, target: Path) -> None:
        self._tick()
        content = self.seen.pop(source)
        self.seen[target] = content
        if source in self._unsynced:
            self._unsynced.discard(source)
            content = self._torn(content)
        self._pending.append((target, content))

    def _torn(self, content: bytes) -> bytes:
        cut = self.rng.randrange(len(content) + 1)
        return self.rng.choice([content, content[:cut], content[:cut] + b"\0" * (len(content) - cut), b""])

    def after_crash(self, stop_at: int | None = None) -> CrashingDisk:
        """Return the disk as the machine finds it when it is on again."""
        left = dict(self.durable)
        for path in self._unsynced:
            if path in self.seen and self.rng.random() < 0.5:
                left[path] = self._torn(self.seen[path])
        for name, content in self.rng.sample(self._pending, len(self._pending)):
            if self.rng.random() < 0.5:
                left[name] = content
        new = CrashingDisk(self.rng, stop_at)
        new.seen, new.durable = dict(left), dict(left)
        return new
