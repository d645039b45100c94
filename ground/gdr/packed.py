"""Text that is over and only read from then on, kept packed: `NAME.br` beside or instead of `NAME`.

Brotli (RFC 7932) is a dependency already, for the answers of the API. Readers take either form, so folders
and earlier stores stay as they are; what leaves the repository (a mission's archive) is unpacked.

Not every bit of a packed stream changes what comes out, so the stream ends with a checksum of itself, in a
block of metadata (RFC 7932, 9.2) that every reader of Brotli skips. Earlier streams have none.
"""

from __future__ import annotations

import os
import secrets
from pathlib import Path
from zlib import crc32

import brotli

from ground.durable import DRAFT, FILE_MODE, make_folder, put_in_place
from ground.errors import DamagedFileError

SUFFIX = ".br"
QUALITY = 5
"""Of 0 to 11: 5 leaves 1/5 of a journal and 1/46 of live lines at 25 and 125 MB/s, 9 no less at a third of
that speed (docs/results/service.md).
"""

MARK, LAST = b"\xd6\x00", b"\x03"
"""Begin of a block of four bytes of metadata, and the empty last block, each on whole bytes."""
SEAL = len(MARK) + 4 + len(LAST)


def packed_path(path: Path) -> Path:
    """Return where the packed form of a file lies, whether or not it is there."""
    return path.with_name(path.name + SUFFIX)


def pack(content: bytes) -> bytes:
    """Return content packed."""
    packer = brotli.Compressor(mode=brotli.MODE_TEXT, quality=QUALITY)
    found: bytes = packer.process(content) + packer.flush()
    return found + MARK + crc32(found).to_bytes(4, "little") + LAST


def unpack(content: bytes) -> bytes:
    """Return packed content as it was.

    Raises
    ------
    DamagedFileError
        If it is damaged, as from a disk that gives back something else.
    """
    try:
        found: bytes = brotli.decompress(content)
    except brotli.error as err:
        raise DamagedFileError("what was packed cannot be unpacked: it is damaged") from err
    body, seal = content[:-SEAL], content[-SEAL:]
    if seal.startswith(MARK) and seal[len(MARK) : -len(LAST)] != crc32(body).to_bytes(4, "little"):
        raise DamagedFileError("what was packed is not what was written: it is damaged")
    return found


def write_packed(path: Path, content: bytes) -> None:
    """Write the packed form of a file: whole or not at all."""
    target = packed_path(path)
    make_folder(target.parent)
    draft = target.with_name(f"{DRAFT}{os.getpid()}-{secrets.token_hex(6)}")
    try:
        draft.touch(FILE_MODE)
        draft.write_bytes(pack(content))
        put_in_place(draft, target)
    finally:
        draft.unlink(missing_ok=True)


def pack_file(path: Path) -> None:
    """Put the packed form of a file into its place; at every moment one of the two is there whole."""
    write_packed(path, path.read_bytes())
    path.unlink()


def is_kept(path: Path) -> bool:
    """Return whether a file is there in one of its forms."""
    return path.is_file() or packed_path(path).is_file()


def read_kept(path: Path) -> bytes:
    """Return the content of a file in whichever form it is there.

    Raises
    ------
    FileNotFoundError
        If it is there in neither.
    DamagedFileError
        If it is there packed and damaged; the message names its folder and its name.
    """
    try:
        return path.read_bytes()
    except FileNotFoundError:
        if not packed_path(path).is_file():
            raise
    try:
        return unpack(packed_path(path).read_bytes())
    except DamagedFileError as err:
        place = f"{path.parent.name}/{packed_path(path).name}"
        raise DamagedFileError(f"the file {place} cannot be unpacked: it is damaged") from err
