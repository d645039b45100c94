"""Files and folders that survive the death of the machine once a function here has returned.

A name is durable when its folder was synchronised, not when its file was. What is kept is its owner's alone:
files 0600, folders 0700.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath

FILE_MODE, FOLDER_MODE = 0o600, 0o700
DRAFT = ".draft-"
"""How the name of a file or folder begins that is not in its place yet."""


def sync(path: Path) -> None:
    """Make the content of a file, or the names in a folder, durable."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def make_folder(folder: Path) -> None:
    """Make a folder and those above it, each name durable."""
    missing = []
    while not folder.is_dir():
        missing.append(folder)
        folder = folder.parent
    for made in reversed(missing):
        made.mkdir(mode=FOLDER_MODE, exist_ok=True)
        sync(made.parent)


def put_in_place(draft: Path, target: Path) -> None:
    """Give a draft, a file or a whole folder, its name: afterwards all of it is there, or nothing."""
    if draft.is_dir():
        draft.chmod(FOLDER_MODE)
        for path in sorted(draft.rglob("*"), reverse=True):
            path.chmod(FOLDER_MODE if path.is_dir() else FILE_MODE)
            sync(path)
    sync(draft)
    make_folder(target.parent)
    draft.replace(target)
    sync(target.parent)


def copy_file(source: Path, target: Path) -> None:
    """Copy a file to its place: whole or not at all."""
    make_folder(target.parent)
    draft = target.with_name(f"{DRAFT}{target.name}")
    try:
        draft.touch(FILE_MODE)
        shutil.copyfile(source, draft)
        put_in_place(draft, target)
    finally:
        draft.unlink(missing_ok=True)


def copy_folder(source: Path, target: Path) -> None:
    """Copy a folder to its place, sealed, whole or not at all; what lay there, of a try that failed, goes."""
    make_folder(target.parent)
    draft = target.with_name(f"{DRAFT}{target.name}")
    shutil.rmtree(draft, ignore_errors=True)
    try:
        shutil.copytree(source, draft, copy_function=shutil.copyfile)
        seal_folder(draft)
        if target.exists():
            shutil.rmtree(target)
        put_in_place(draft, target)
    finally:
        shutil.rmtree(draft, ignore_errors=True)


@contextmanager
def removed_on_failure(folder: Path) -> Iterator[None]:
    """Remove a folder if what is done inside fails: put it within the transaction that writes what names it.

    When the commit itself fails, nobody knows whether the rows were written; then the folder stays, and the
    sweep looks whether anything names it.
    """
    try:
        yield
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise


SUMS = ".sha256sums"
"""File in a folder that is kept whole: the SHA-256 of each other file in it."""


_HEAD = "#sha256 "


def seal_folder(folder: Path) -> None:
    """Write down what the files of a folder hold, as `sha256sum` does; a comment has the list's own hash."""
    listed = "".join(f"{digest}  {name}\n" for name, digest in _sums(folder).items())
    own = hashlib.sha256(listed.encode()).hexdigest()
    (folder / SUMS).write_text(f"{_HEAD}{own}\n{listed}", encoding="utf-8")


def read_sums(content: bytes) -> dict[str, str] | None:
    """Return names and hashes in the list of a folder; None if the list itself is damaged.

    Lists of older versions do not say what they were.
    """
    try:
        text = content.decode("utf-8")
    except ValueError:
        return None
    head, _, listed = text.partition("\n") if text.startswith(_HEAD) else ("", "", text)
    if head and head != _HEAD + hashlib.sha256(listed.encode()).hexdigest():
        return None
    said = {}
    for line in listed.splitlines(keepends=True):
        digest, gap, name = line[:64], line[64:66], line[66:-1]
        if len(digest) != 64 or gap != "  " or line[-1] != "\n" or not _is_inside(name):
            return None
        said[name] = digest
    return said


def _is_inside(name: str) -> bool:
    """Return whether a name leads to a place below its folder: whoever owns a store writes its lists."""
    path = PurePosixPath(name)
    return bool(path.parts) and not path.is_absolute() and ".." not in path.parts


def damaged_in(folder: Path) -> list[str]:
    """Return the names of files that are not what was written down; none where nothing was.

    Where the list itself is damaged it alone is named.
    """
    try:
        said = read_sums((folder / SUMS).read_bytes())
    except FileNotFoundError:
        return []
    except OSError:
        return [SUMS]
    if said is None:
        return [SUMS]
    found = _sums(folder)
    odd = {name for name in said.keys() | found.keys() if said.get(name) != found.get(name)}
    return sorted(odd)


def _sums(folder: Path) -> dict[str, str]:
    found = {}
    for path in sorted(folder.rglob("*")):
        if path.is_file() and path.name != SUMS:
            with contextlib.suppress(FileNotFoundError), path.open("rb") as file:
                digest = hashlib.file_digest(file, "sha256").hexdigest()
                found[path.relative_to(folder).as_posix()] = digest
    return found
