"""Where files and folders are kept: one port, and its adapter for a local disk.

The adapter for an object store is `ground.gdr.bucket`; `ground.gdr.places` opens the one that is set.
"""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterator
from pathlib import Path
from typing import Protocol

from ground.durable import DRAFT, put_in_place

CHUNK = 1 << 20


class Store(Protocol):
    """Pieces by key (`ab/cd/NAME`) below one place, each whole and never changed.

    What was put is kept when the method has returned, also if the machine dies then. `root` is the place of
    the pieces on this machine: of all of them, or of those that were brought.

    Every method but `at` and those that say otherwise raises `StoreAwayError` if the store does not answer.
    """

    @property
    def root(self) -> Path: ...

    @property
    def address(self) -> str:
        """Return what `open_store` takes."""

    @property
    def is_local(self) -> bool:
        """Return whether what lies in `root` is all there is."""

    def at(self, name: str) -> Store:
        """Return the store of what lies below a name."""

    def put(self, key: str, draft: Path) -> None:
        """Keep a draft on the disk of `root` under a key; what lay there goes, the draft too."""

    def keep(self, key: str) -> None:
        """Keep the piece that lies at its place in `root`."""

    def bring(self, *keys: str) -> bool:
        """Have the first of these that is kept lie at its place in `root`; return whether one is there."""

    def holds(self, key: str) -> bool:
        """Return whether a piece is kept."""

    def size(self, key: str) -> int:
        """Return the bytes of a piece; raise FileNotFoundError if it is not there."""

    def chunks(self, key: str, start: int = 0, stop: int | None = None) -> Iterator[bytes]:
        """Yield the bytes of a piece from `start` to before `stop`, as they are kept; see `size`."""

    def pieces(self) -> Iterator[tuple[str, float]]:
        """Yield every key and when it was put, in seconds since 1970."""

    def names(self) -> list[str]:
        """Return the first parts of all keys, sorted; drafts are not."""

    def remove(self, key: str) -> None:
        """Remove a piece, if it is there."""

    def forget(self, key: str) -> bool:
        """Drop a piece that was brought; return whether it can be brought again. Asks no store."""

    def trouble(self) -> str:
        """Return why pieces cannot be had now; empty if they can. Raises nothing."""


class Disk:
    """Pieces in a folder of this machine."""

    is_local = True

    def __init__(self, root: Path) -> None:
        self.root = root

    @property
    def address(self) -> str:
        return str(self.root)

    def at(self, name: str) -> Disk:
        return Disk(self.root / name)

    def put(self, key: str, draft: Path) -> None:
        put_in_place(draft, self.root / key)

    def keep(self, key: str) -> None:
        """Nothing is left to do: it lies where it is kept."""

    def bring(self, *keys: str) -> bool:
        return any((self.root / key).is_file() for key in keys)

    def holds(self, key: str) -> bool:
        return (self.root / key).is_file()

    def size(self, key: str) -> int:
        return (self.root / key).stat().st_size

    def chunks(self, key: str, start: int = 0, stop: int | None = None) -> Iterator[bytes]:
        with (self.root / key).open("rb") as file:
            file.seek(start)
            left = self.size(key) - start if stop is None else stop - start
            while left > 0 and (chunk := file.read(min(CHUNK, left))):
                left -= len(chunk)
                yield chunk

    def pieces(self) -> Iterator[tuple[str, float]]:
        for path in self.root.rglob("*"):
            if path.is_file():
                yield path.relative_to(self.root).as_posix(), path.stat().st_mtime

    def names(self) -> list[str]:
        there = self.root.iterdir() if self.root.is_dir() else ()
        return sorted(path.name for path in there if path.name[0] != ".")

    def remove(self, key: str) -> None:
        (self.root / key).unlink(missing_ok=True)

    def forget(self, key: str) -> bool:  # noqa: ARG002 - it is the only one
        return False

    def trouble(self) -> str:
        return ""


def scratch_name() -> str:
    """Return a name for a draft that no other process and no other thread has."""
    return f"{DRAFT}{os.getpid()}-{secrets.token_hex(6)}"
