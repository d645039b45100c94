"""Files by the hash of their content: data products, uploads, packages, traces."""

from __future__ import annotations

import hashlib
import os
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from ground.durable import FILE_MODE, make_folder, sync
from ground.errors import DamagedFileError
from ground.gdr.packed import SUFFIX, pack, packed_path, read_kept, unpack
from ground.gdr.places import JOB_PATIENCE_S, bring_checked, open_store
from ground.gdr.store import Disk, Store, scratch_name

MOST_NAMED = 10_000
"""A few MB. When they are more, all are forgotten and synchronised again."""
_NAMED: set[tuple[str, int]] = set()
"""Files, by hash and inode, whose names this process has made durable: that stays so while they are there."""


def _private(path: str, flags: int) -> int:
    return os.open(path, flags, FILE_MODE)


@dataclass(frozen=True, slots=True)
class StoredFile:
    sha256: str
    size_bytes: int


@dataclass(frozen=True, slots=True)
class FarFile:
    """A stored file of which nothing lies on this machine; `part(start, stop)` yields bytes of it."""

    size_bytes: int
    part: Callable[[int, int], Iterator[bytes]]


class FileStore:
    """Content-addressed files, `ab/cd/<sha256>`, in a store (a folder stands for that on its disk).

    A file is written beside its place, synchronised and renamed, and its name is synchronised too: it is
    there whole or not at all, and takes the place of one that was damaged. Files come before the rows that
    name them, so a crash leaves at most a file without a record, which `sweep` removes.

    Text that only programs read may lie packed, as `<sha256>.br`; its name is the hash of what was packed.
    """

    def __init__(self, store: Store | Path) -> None:
        self.store: Store = Disk(store) if isinstance(store, Path) else store

    @property
    def folder(self) -> Path:
        """Return where files lie on this machine: all of them, or those that were brought."""
        return self.store.root

    @property
    def address(self) -> str:
        """Return what an order of a job calls this store."""
        return self.store.address

    def _place(self, sha256: str) -> Path:
        return self.store.root / key_of(sha256)

    def path(self, sha256: str) -> Path:
        """Return where on this machine the file with this hash lies; it is brought if need be.

        One that lies packed is at this path with `.br`. One that is in no store is not there.

        Raises
        ------
        DamagedFileError
            If it is not a hash: the row that names it was changed; or if what was brought is damaged.
        StoreAwayError
            If it must be brought and the object store does not answer.
        """
        place = self._place(sha256)
        if not self.store.is_local and not packed_path(place).is_file():
            key = key_of(sha256)
            if not bring_checked(self.store, key, sha256):
                self.store.bring(key + SUFFIX)  # checked by whoever unpacks it
        return place

    def far(self, sha256: str) -> FarFile | None:
        """Return a file that would have to be brought, to be read in parts; None if it is here or nowhere."""
        key = key_of(sha256)
        if self.store.is_local or self._place(sha256).is_file():
            return None
        try:
            size = self.store.size(key)
        except FileNotFoundError:
            return None
        return FarFile(size, lambda start, stop: self.store.chunks(key, start, stop))

    def address_of(self, sha256: str) -> str:
        """Return what an order of a job calls a file."""
        return self.store.at(key_of(sha256)).address

    def put(self, chunks: Iterable[bytes]) -> StoredFile:
        """Store a file and return its hash and size."""
        make_folder(self.folder)
        draft = self.folder / scratch_name()
        digest, size = hashlib.sha256(), 0
        try:
            with open(draft, "wb", opener=_private) as out:
                for chunk in chunks:
                    digest.update(chunk)
                    size += len(chunk)
                    out.write(chunk)
            self.store.put(key_of(digest.hexdigest()), draft)
        finally:
            draft.unlink(missing_ok=True)
        return StoredFile(digest.hexdigest(), size)

    def put_bytes(self, content: bytes) -> StoredFile:
        """Store content; where it lies on this machine's disk whole already, that is made sure of instead.

        Rehearsals of a plan take the same pictures, and to wait for the disk costs more than to look.
        """
        sha256 = hashlib.sha256(content).hexdigest()
        if self.store.is_local and self._lies_whole(sha256):
            return StoredFile(sha256, len(content))
        return self.put([content])

    def _lies_whole(self, sha256: str) -> bool:
        """Return whether a file lies at its place undamaged, its name durable and its age anew.

        Its age comes first: a sweep that has not seen it as old by then leaves it.
        """
        place = self._place(sha256)
        try:
            os.utime(place)
            with place.open("rb") as file:
                seen = sha256, os.fstat(file.fileno()).st_ino
                whole = hashlib.file_digest(file, "sha256").hexdigest() == sha256
        except OSError:
            return False
        if whole and seen not in _NAMED:  # who put it may not have come to this yet
            sync(place.parent)
            if len(_NAMED) >= MOST_NAMED:
                _NAMED.clear()
            _NAMED.add(seen)
        return whole

    def put_file(self, source: Path) -> StoredFile:
        """Store a copy of a file."""
        with source.open("rb") as file:
            return self.put(iter(lambda: file.read(1 << 20), b""))

    def put_packed(self, content: bytes) -> StoredFile:
        """Store text packed and return its hash and size as it was; `read` alone returns it."""
        sha256 = hashlib.sha256(content).hexdigest()
        make_folder(self.folder)
        draft = self.folder / scratch_name()
        try:
            draft.touch(FILE_MODE)
            draft.write_bytes(pack(content))
            self.store.put(key_of(sha256) + SUFFIX, draft)
        finally:
            draft.unlink(missing_ok=True)
        return StoredFile(sha256, len(content))

    def read(self, sha256: str) -> bytes:
        """Return what a file holds, packed or not. What was brought and is damaged is brought again.

        Raises
        ------
        FileNotFoundError
            If it is not there.
        DamagedFileError
            If it is not what was stored.
        StoreAwayError
            If it must be brought and the object store does not answer.
        """
        try:
            return self._read(sha256)
        except DamagedFileError:
            key = key_of(sha256)
            if not (self.store.forget(key) and self.store.forget(key + SUFFIX)):
                raise
        return self._read(sha256)

    def _read(self, sha256: str) -> bytes:
        content = read_kept(self.path(sha256))
        if hashlib.sha256(content).hexdigest() != sha256:
            raise DamagedFileError(f"the file {sha256} is damaged: it does not hold what its name says")
        return content

    def holds(self, sha256: str) -> bool:
        """Return whether a file is there, packed or not."""
        key = key_of(sha256)
        return self.store.holds(key) or self.store.holds(key + SUFFIX)

    def is_sound(self, sha256: str) -> bool:
        """Return whether the store has the file with the content that its name says."""
        key = key_of(sha256)
        digest = hashlib.sha256()
        try:
            if self.store.holds(key):
                for chunk in self.store.chunks(key):
                    digest.update(chunk)
            else:
                digest.update(unpack(b"".join(self.store.chunks(key + SUFFIX))))
        except OSError:
            return False
        return digest.hexdigest() == sha256

    def _forms(self) -> dict[str, list[tuple[str, float]]]:
        """Return key and time of each form of each file."""
        found: dict[str, list[tuple[str, float]]] = defaultdict(list)
        for key, when in self.store.pieces():
            name = key.rpartition("/")[2].removesuffix(SUFFIX)
            if len(name) == 64 and key.count("/") == 2:
                found[name].append((key, when))
        return found

    def hashes(self) -> Iterator[str]:
        """Yield the hash of every stored file."""
        yield from self._forms()

    def sweep(self, wanted: set[str], older_than_utc_s: float) -> list[str]:
        """Remove files that no record names and that are older than a moment; return their hashes."""
        gone = []
        for sha256, forms in self._forms().items():
            if sha256 not in wanted and all(when < older_than_utc_s for _, when in forms):
                for key, _ in forms:
                    self.store.remove(key)
                gone.append(sha256)
        return gone


def files_at(address: str) -> FileStore:
    """Return the files that an order of a job names; see `ground.gdr.store`."""
    return FileStore(open_store(address, JOB_PATIENCE_S))


def key_of(sha256: str) -> str:
    """Return the key of the file with this hash.

    Raises
    ------
    DamagedFileError
        If it is not a hash: the row that names it was changed.
    """
    if len(sha256) != 64 or any(c not in "0123456789abcdef" for c in sha256):
        raise DamagedFileError(f"not a SHA-256 in lower-case hexadecimal: {sha256!r}")
    return f"{sha256[:2]}/{sha256[2:4]}/{sha256}"
