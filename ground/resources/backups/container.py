"""The file of a backup: a tar that every tar program reads, with a list of what lies where and its SHA-256.

Each byte of the file belongs to a member of the list, to the list (`backup.json`, the last member), to the
empty blocks behind it or to the last block, which says where the list lies. So a single flipped bit is found,
and the part that it is in is named.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import os
import tarfile
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import IO, Any

from ground.durable import FILE_MODE, put_in_place
from ground.errors import ArchiveError

FORMAT = "backup/2"
LIST = "backup.json"
LAST = tarfile.BLOCKSIZE
_CHUNK = 1 << 20


class _Tap:
    """A file being written that knows the SHA-256 of what was written since the last mark."""

    def __init__(self, file: IO[bytes]) -> None:
        self._file, self._digest, self.position = file, hashlib.sha256(), 0

    def write(self, content: bytes) -> int:
        self._digest.update(content)
        self.position += len(content)
        return self._file.write(content)

    def tell(self) -> int:
        return self.position

    def mark(self) -> str:
        """Return the SHA-256 of what was written since the last mark."""
        found, self._digest = self._digest.hexdigest(), hashlib.sha256()
        return found


@dataclass(frozen=True, slots=True)
class Part:
    """One file of a backup, by its name there: bytes, or a file of the disk."""

    name: str
    content: bytes | Path


@dataclass(frozen=True, slots=True)
class Listing:
    """What a backup says of itself; `members` holds offset, length and SHA-256 of each part with header."""

    revision: str
    made_utc: str
    rows: Mapping[str, int]
    rows_sha256: str
    damaged: tuple[str, ...] = ()
    members: Mapping[str, tuple[int, int, str]] = field(default_factory=dict)


def write_container(target: Path, head: Listing, parts: Iterable[Part]) -> None:
    """Write a backup, its owner's alone; it is there whole or not at all.

    A file of the disk that is gone when its turn comes is left out.
    """
    draft = target.with_name(f".{target.name}.draft")
    draft.unlink(missing_ok=True)
    try:
        with open(draft, "xb", opener=lambda path, flags: os.open(path, flags, FILE_MODE)) as file:
            tap = _Tap(file)
            members: dict[str, list[Any]] = {}
            with tarfile.open(fileobj=tap, mode="w", format=tarfile.PAX_FORMAT) as archive:  # type: ignore[call-overload]
                for part in parts:
                    began = tap.position
                    with contextlib.suppress(FileNotFoundError):  # swept since it was listed
                        _add(archive, part)
                        members[part.name] = [began, tap.position - began, tap.mark()]
                began = tap.position
                said = {**asdict(head), "format": FORMAT, "members": members}
                listed = json.dumps(said, indent=1).encode()
                _add(archive, Part(LIST, listed))
                where = [began, tap.position - began, tap.mark()]
            file.write(_last(where))
        put_in_place(draft, target)
    finally:
        draft.unlink(missing_ok=True)


def _add(archive: tarfile.TarFile, part: Part) -> None:
    info = tarfile.TarInfo(part.name)
    info.mode = FILE_MODE
    if isinstance(part.content, bytes):
        info.size = len(part.content)
        archive.addfile(info, io.BytesIO(part.content))
        return
    with part.content.open("rb") as file:
        info.size = os.fstat(file.fileno()).st_size
        archive.addfile(info, file)


def _last(where: list[Any]) -> bytes:
    text = json.dumps({"format": FORMAT, "list": where}) + "\n"
    return text.encode().ljust(LAST, b"\n")


def read_list(source: Path) -> Listing:
    """Return the list of a backup, of which every bit was checked.

    Raises
    ------
    ArchiveError
        It names the part that is damaged, or says that the file is not a backup.
    """
    size = source.stat().st_size
    with source.open("rb") as file:
        file.seek(max(0, size - LAST))
        last = file.read()
        try:
            where = json.loads(last)["list"]
            begin, length, digest = int(where[0]), int(where[1]), str(where[2])
        except (ValueError, LookupError, TypeError) as err:
            raise ArchiveError(
                f"{source} is not a whole backup: its last block is damaged or cut off"
            ) from err
        if _last([begin, length, digest]) != last:
            raise ArchiveError(f"{source} is damaged: its last block is not as it was written")
        if _digest(file, begin, length) != digest:
            raise ArchiveError(f"{source} is damaged: {LIST} is not what its SHA-256 says")
        file.seek(begin)
        with tarfile.open(fileobj=file, mode="r:") as archive:
            entry = archive.extractfile(LIST)
            assert entry is not None
            found = json.load(entry)
        at = 0
        for name, (start, long, sha256) in found["members"].items():
            if start != at or _digest(file, start, long) != sha256:
                raise ArchiveError(f"{source} is damaged: {name} is not what its SHA-256 says")
            at += long
        file.seek(begin + length)
        if at != begin or any(file.read(size - LAST - begin - length)):
            raise ArchiveError(f"{source} is damaged: the empty blocks behind {LIST} are not empty")
    members = {name: (start, long, sha) for name, (start, long, sha) in found["members"].items()}
    return Listing(
        found["revision"],
        found["made_utc"],
        found["rows"],
        found["rows_sha256"],
        tuple(found["damaged"]),
        members,
    )


def _digest(file: IO[bytes], begin: int, length: int) -> str:
    digest = hashlib.sha256()
    file.seek(begin)
    while length > 0 and (chunk := file.read(min(_CHUNK, length))):
        digest.update(chunk)
        length -= len(chunk)
    return digest.hexdigest() if length == 0 else ""
