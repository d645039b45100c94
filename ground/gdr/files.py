"""Files by the hash of their content: data products, uploads, traces; and the terrains' folders."""

from __future__ import annotations

import hashlib
import os
import secrets
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from ground.durable import DRAFT, FILE_MODE, make_folder, put_in_place
from ground.errors import DamagedFileError
from ground.gdr.packed import SUFFIX, is_kept, packed_path, read_kept, write_packed


def _private(path: str, flags: int) -> int:
    return os.open(path, flags, FILE_MODE)


@dataclass(frozen=True, slots=True)
class StoredFile:
    sha256: str
    size_bytes: int


class FileStore:
    """Content-addressed files under one folder, `ab/cd/<sha256>`.

    A file is written beside its place, synchronised and renamed, and its name is synchronised too: it is
    there whole or not at all, and takes the place of one that was damaged. Files come before the rows that
    name them, so a crash leaves at most a file without a record, which `sweep` removes.

    Text that only programs read may lie packed, as `<sha256>.br`; its name is the hash of what was packed.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def path(self, sha256: str) -> Path:
        """Return where the file with this hash lies, whether or not it is there.

        Raises
        ------
        DamagedFileError
            If it is not a hash: the row that names it was changed.
        """
        if len(sha256) != 64 or any(c not in "0123456789abcdef" for c in sha256):
            raise DamagedFileError(f"not a SHA-256 in lower-case hexadecimal: {sha256!r}")
        return self.folder / sha256[:2] / sha256[2:4] / sha256

    def put(self, chunks: Iterable[bytes]) -> StoredFile:
        """Store a file and return its hash and size."""
        make_folder(self.folder)
        draft = self.folder / f"{DRAFT}{os.getpid()}-{secrets.token_hex(6)}"
        digest, size = hashlib.sha256(), 0
        try:
            with open(draft, "wb", opener=_private) as out:
                for chunk in chunks:
                    digest.update(chunk)
                    size += len(chunk)
                    out.write(chunk)
            put_in_place(draft, self.path(digest.hexdigest()))
        finally:
            draft.unlink(missing_ok=True)
        return StoredFile(digest.hexdigest(), size)

    def put_bytes(self, content: bytes) -> StoredFile:
        return self.put([content])

    def put_file(self, source: Path) -> StoredFile:
        """Store a copy of a file."""
        with source.open("rb") as file:
            return self.put(iter(lambda: file.read(1 << 20), b""))

    def put_packed(self, content: bytes) -> StoredFile:
        """Store text packed and return its hash and size as it was; `read` alone returns it."""
        sha256 = hashlib.sha256(content).hexdigest()
        write_packed(self.path(sha256), content)
        return StoredFile(sha256, len(content))

    def read(self, sha256: str) -> bytes:
        """Return what a file holds, packed or not.

        Raises
        ------
        FileNotFoundError
            If it is not there.
        DamagedFileError
            If it is not what was stored.
        """
        content = read_kept(self.path(sha256))
        if hashlib.sha256(content).hexdigest() != sha256:
            raise DamagedFileError(f"the file {sha256} is damaged: it does not hold what its name says")
        return content

    def holds(self, sha256: str) -> bool:
        """Return whether a file is there, packed or not."""
        return is_kept(self.path(sha256))

    def is_sound(self, sha256: str) -> bool:
        """Return whether the file is there and has the content that its name says."""
        try:
            if not self.path(sha256).is_file():
                return hashlib.sha256(self.read(sha256)).hexdigest() == sha256
            with self.path(sha256).open("rb") as file:
                return hashlib.file_digest(file, "sha256").hexdigest() == sha256
        except OSError:
            return False

    def hashes(self) -> Iterator[str]:
        """Yield the hash of every stored file."""
        names = {path.name.removesuffix(SUFFIX) for path in self.folder.glob("??/??/*")}
        yield from (name for name in names if len(name) == 64)

    def sweep(self, wanted: set[str], older_than_utc_s: float) -> list[str]:
        """Remove files that no record names and that are older than a moment; return their hashes."""
        gone = []
        for sha256 in list(self.hashes()):
            forms = [p for p in (self.path(sha256), packed_path(self.path(sha256))) if p.is_file()]
            if sha256 not in wanted and all(p.stat().st_mtime < older_than_utc_s for p in forms):
                for path in forms:
                    path.unlink()
                gone.append(sha256)
        return gone
