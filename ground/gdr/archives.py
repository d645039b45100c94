"""Zip archives from outside: names, sizes and ratios are checked before a byte is written."""

from __future__ import annotations

import re
import stat
import zipfile
import zlib
from pathlib import Path, PurePosixPath

from ground.errors import ArchiveError

MAX_ENTRIES = 100_000
MAX_RATIO = 200
MAX_NAME, MAX_PART = 1000, 200
"""Characters of a name in an archive, and bytes of one part of it; Linux allows 4,095 and 255 with the folder
that it is unpacked in."""
_RATIO_FROM = 1 << 20

_UNSAFE = re.compile(r'[\x00-\x1f\x7f<>:"|?*]')
"""What Windows allows in no name of a file; separators are none of a name's characters at all."""
_DEVICE = re.compile(r"(con|prn|aux|nul|com[0-9]|lpt[0-9])(\.|$)", re.IGNORECASE)
"""Names that are devices on Windows, whatever their ending."""


def name_in_archive(name: str) -> str:
    """Return the last part of a file's name as it can be unpacked on every system and taken in here again."""
    last = _UNSAFE.sub("_", re.split(r"[/\\]", name)[-1]).rstrip(". ")
    last = last.encode("utf-8", "replace")[-MAX_PART + 1 :].decode("utf-8", "ignore")  # endings stay
    return f"_{last}" if not last or _DEVICE.match(last) else last


def is_zip(path: Path) -> bool:
    """Return whether a file is a zip archive."""
    return zipfile.is_zipfile(path)


def checked_names(archive: zipfile.ZipFile, max_bytes: int) -> list[zipfile.ZipInfo]:
    """Return the files of an archive if all may be unpacked.

    Raises
    ------
    ArchiveError
        If a name leads outside, a member is a link, or it would unpack to more than is allowed.
    """
    entries = archive.infolist()
    if len(entries) > MAX_ENTRIES:
        raise ArchiveError(f"the archive has {len(entries)} entries; {MAX_ENTRIES} are allowed")
    total, seen, files = 0, set(), []
    for entry in entries:
        name = entry.filename
        path = PurePosixPath(name)
        if (
            path.is_absolute()
            or ".." in path.parts
            or "\\" in name
            or ":" in path.parts[0:1]
            or any(ord(c) < 32 for c in name)
        ):
            raise ArchiveError(f"the archive holds a name that leads outside: {name!r}")
        if len(name) > MAX_NAME or any(len(part.encode()) > MAX_PART for part in path.parts):
            raise ArchiveError(f"the archive holds a name of {len(name)} characters: {name[:40]!r}...")
        if stat.S_ISLNK(entry.external_attr >> 16):
            raise ArchiveError(f"the archive holds a link: {name!r}")
        if entry.is_dir():
            continue
        if name in seen:
            raise ArchiveError(f"the archive holds {name!r} twice")
        seen.add(name)
        total += entry.file_size
        if total > max_bytes:
            raise ArchiveError(f"the archive unpacks to more than {max_bytes} bytes")
        if entry.file_size > _RATIO_FROM and entry.file_size > MAX_RATIO * max(entry.compress_size, 1):
            raise ArchiveError(f"{name!r} unpacks to {entry.file_size} bytes from {entry.compress_size}")
        files.append(entry)
    return files


def extract_zip(source: Path, folder: Path, *, max_bytes: int) -> None:
    """Unpack an archive into a new folder.

    Raises
    ------
    ArchiveError
        If it is damaged or unsafe.
    """
    folder.mkdir(parents=True)
    try:
        with zipfile.ZipFile(source) as archive:
            left = max_bytes
            for entry in checked_names(archive, max_bytes):
                target = folder / PurePosixPath(entry.filename)
                target.parent.mkdir(parents=True, exist_ok=True)
                with archive.open(entry) as reader, target.open("wb") as writer:
                    while block := reader.read(1 << 20):
                        left -= len(block)
                        if left < 0:
                            raise ArchiveError(f"the archive unpacks to more than {max_bytes} bytes")
                        writer.write(block)
    except OSError as err:
        raise ArchiveError(f"the archive cannot be unpacked: {err.strerror or err}") from err
    except (zipfile.BadZipFile, NotImplementedError, EOFError, RuntimeError, ValueError, zlib.error) as err:
        raise ArchiveError(f"the archive is damaged: {str(err)[:200]}") from err
