"""A folder on a disk that forgets: what `ground.durable` did not synchronise may be gone after a crash.

Real calls are made in a real folder, and watched; at a chosen one the machine goes off. What it finds when it
is on again is what was synchronised and, by chance, what was not: a file may be as it was written, cut,
zeroed or empty, a name may be there or not, a renamed file may have its old name still.
"""

from __future__ import annotations

import os
import random
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

from ground import durable
from tests.ground.crashing_disk import CrashError


class CrashingFolder:
    """Watches what is done below `folder`; `stop_at` is the operation, from 0, before which it goes off."""

    def __init__(self, folder: Path, rng: random.Random) -> None:
        self.folder, self.rng = folder, rng
        self.operations, self.stop_at, self.off = 0, -1, False
        self._content: dict[int, bytes] = {}
        """What was synchronised of files, by inode."""
        self._names: dict[Path, set[tuple[str, int]]] = {}
        """Names in folders that were synchronised, with what they named."""

    @contextmanager
    def watched(self) -> Iterator[None]:
        """Watch until the end, or until the machine goes off."""
        whole = {name: getattr(Path, name) for name in ("mkdir", "replace", "unlink")}

        def synced(path: Path) -> None:
            self._tick()  # what the real call would do to the disk below is nothing to us
            if path.is_dir():
                self._names[path] = _names_in(path)
            else:
                self._content[path.stat().st_ino] = path.read_bytes()

        def ticking(name: str) -> Any:
            def call(path: Path, *given: Any, **named: Any) -> Any:
                if self.off and name == "unlink":
                    return None  # a machine that is off tidies nothing up
                self._tick()
                return whole[name](path, *given, **named)

            return call

        with ExitStack() as patches:
            patches.enter_context(patch.object(durable, "sync", synced))
            for name in whole:
                patches.enter_context(patch.object(Path, name, ticking(name)))
            yield

    def _tick(self) -> None:
        if self.operations == self.stop_at:
            self.off = True
            raise CrashError
        self.operations += 1

    def after_crash(self, target: Path) -> CrashingFolder:
        """Return a folder at `target` as the machine finds this one when it is on again."""
        new = CrashingFolder(target, self.rng)
        self._bring(self.folder, target)
        for place, _, files in os.walk(target):
            path = Path(place)
            new._names[path] = _names_in(path)
            new._content |= {(path / n).stat().st_ino: (path / n).read_bytes() for n in files}
        return new

    def _bring(self, source: Path, target: Path) -> None:
        target.mkdir()
        sure = self._names.get(source, set())
        now = _names_in(source)
        there = {inode: name for name, inode in now}
        for name, inode in sure | now:
            gone = (name, inode) not in now
            if gone and inode not in there:
                continue  # deleted; what a deletion leaves hurts nobody
            if ((name, inode) not in sure or gone) and self.rng.random() < 0.5:
                continue
            path, made = source / there[inode], target / name
            if path.is_dir():
                if not made.exists():
                    self._bring(path, made)
                continue
            content = path.read_bytes()
            made.write_bytes(content if self._content.get(inode) == content else self._torn(content))

    def _torn(self, content: bytes) -> bytes:
        cut = self.rng.randrange(len(content) + 1)
        return self.rng.choice([content, content[:cut], content[:cut] + b"\0" * (len(content) - cut), b""])


def _names_in(folder: Path) -> set[tuple[str, int]]:
    return {(path.name, path.stat().st_ino) for path in folder.iterdir()}
