"""Files of recordings, rosbag2 (sqlite3) and MCAP: their messages, as far as the file is whole."""

from __future__ import annotations

import sqlite3
import struct
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from neighbours.robots.errors import MissingExtraError, RecordingError

if TYPE_CHECKING:
    from mcap.records import Chunk, McapRecord

MOST_BYTES = 256 << 20
"""Bytes of a message or an unpacked chunk. Writers make chunks of about 1 MiB; a large picture has 100."""
MAGIC = {"sqlite3": b"SQLite format 3", "mcap": b"\x89MCAP0\r\n"}
"""How files begin."""


@dataclass(frozen=True, slots=True)
class Raw:
    """A message as it lies in the file: time of writing in nanoseconds, encoding `cdr` or `json`."""

    topic: str
    type: str
    encoding: str
    log_ns: int
    data: bytes


def files_of(path: Path) -> list[Path]:
    """Return the files of a recording: itself, or those of a rosbag2 folder in the order of their names."""
    if path.is_file():
        return [path]
    found = sorted(p for p in path.glob("*") if p.suffix in (".db3", ".mcap")) if path.is_dir() else []
    if not found:
        raise RecordingError(
            f"{path} is not a recording: neither a file nor a folder with .db3 or .mcap files"
        )
    return found


def raw_messages(path: Path, broken: Callable[[str], None]) -> Iterator[Raw]:
    """Yield the messages of one file as far as it is whole; `broken` is told where it is not."""
    kind = kind_of(path)
    if kind == "sqlite3":
        yield from _sqlite(path, broken)
    elif kind == "mcap":
        yield from _mcap(path, broken)
    else:
        broken(f"{path.name} is neither MCAP nor sqlite3")


def kind_of(path: Path) -> str:
    """Return `sqlite3` or `mcap` by the first bytes of a file, an empty string of any other."""
    with path.open("rb") as file:
        magic = file.read(16)
    return next((kind for kind, start in MAGIC.items() if magic.startswith(start)), "")


def _sqlite(path: Path, broken: Callable[[str], None]) -> Iterator[Raw]:
    count = 0
    try:
        with closing(sqlite3.connect(f"file:{path}?mode=ro&immutable=1", uri=True)) as base:
            base.execute(
                "PRAGMA writable_schema=ON"
            )  # else a file that is shorter than it says is refused whole
            base.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MOST_BYTES)
            _require_tables(base)
            topics = {row[0]: row[1:] for row in base.execute("SELECT id, name, type FROM topics")}
            for topic, at_ns, data in base.execute("SELECT topic_id, timestamp, data FROM messages"):
                if topic in topics and isinstance(data, bytes) and isinstance(at_ns, int):
                    name, type_ = topics[topic]
                    count += 1
                    yield Raw(str(name), str(type_), "cdr", at_ns, data)
    except (sqlite3.Error, UnicodeDecodeError, OverflowError) as error:
        broken(f"{path.name} is damaged after {count} messages: {error}")


def _require_tables(base: sqlite3.Connection) -> None:
    """Raise unless topics and messages are plain tables: a view may be a query that never ends."""
    made = dict(base.execute("SELECT name, sql FROM sqlite_master WHERE type = 'table'"))
    for name in ("topics", "messages"):
        if not str(made.get(name)).upper().startswith("CREATE TABLE"):
            raise sqlite3.DatabaseError(f"{name} is not a table")


def _unpacked(chunk: Chunk) -> Chunk:
    """Return a chunk without compression.

    Raises
    ------
    ValueError
        If it would be larger than it says, or than what is taken.
    """
    size = chunk.uncompressed_size
    if size > MOST_BYTES:
        raise ValueError(f"a chunk of {size} bytes; {MOST_BYTES} are taken")
    if chunk.compression == "zstd":
        import zstandard

        try:
            with zstandard.ZstdDecompressor().stream_reader(chunk.data) as stream:
                data = stream.read(size + 1)
        except zstandard.ZstdError as error:
            raise ValueError(f"a chunk that cannot be unpacked: {error}") from error
    elif chunk.compression == "lz4":
        import lz4.frame

        data = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=size + 1)
    else:
        return chunk
    if len(data) != size:
        raise ValueError(f"a chunk that is not of the {size} bytes that it says")
    return replace(chunk, compression="", data=data)


def _records(stream: BinaryIO) -> Iterator[McapRecord]:
    """Yield the records of a file, those of chunks too; a chunk is unpacked only within limits."""
    from mcap import records
    from mcap.stream_reader import StreamReader, breakup_chunk

    reader = StreamReader(stream, emit_chunks=True, validate_crcs=True, record_size_limit=MOST_BYTES)
    for record in reader.records:
        if isinstance(record, records.Chunk):
            yield from breakup_chunk(_unpacked(record), validate_crc=True)
        else:
            yield record


def _mcap(path: Path, broken: Callable[[str], None]) -> Iterator[Raw]:
    try:
        from mcap.exceptions import McapError
        from mcap.records import Channel, DataEnd, Message, Schema
    except ImportError:
        raise MissingExtraError("MCAP needs the package mcap: pip install 'outcrop[mcap]'") from None
    schemas: dict[int, str] = {}
    channels: dict[int, tuple[str, str, str]] = {}
    count, over = 0, False
    with path.open("rb") as file:
        try:
            for record in _records(file):
                if isinstance(record, Schema):
                    schemas[record.id] = record.name
                elif isinstance(record, Channel):
                    type_ = schemas.get(record.schema_id, "")
                    channels[record.id] = (record.topic, type_, record.message_encoding)
                elif isinstance(record, Message) and record.channel_id in channels:
                    topic, type_, encoding = channels[record.channel_id]
                    count += 1
                    yield Raw(topic, type_, encoding, record.log_time, bytes(record.data))
                elif isinstance(record, DataEnd):
                    over = True
        except (
            McapError,
            struct.error,
            ValueError,
            EOFError,
            RuntimeError,
            KeyError,
            AssertionError,
        ) as error:
            why = str(error) or type(error).__name__
            place = f"behind its data, all {count} messages," if over else f"after {count} messages"
            broken(f"{path.name} is cut or damaged {place}: {why}")
            return
    if not over:
        broken(f"{path.name} is cut after {count} messages")
