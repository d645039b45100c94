"""Write-ahead journal: everything that happened to a run, durable before any effect of it leaves.

A journal is a text file of JSON lines. Each line ends in a checksum over the text before it and carries its
number, so that a torn tail, a gap and a foreign line are told apart:

``{"n":7,"k":"trace","t":12000,"e":"start","a":["snd"],"crc":"9c0f3a11"}``

=========== ========================================================================================
kind `k`    members
=========== ========================================================================================
header      `format` "journal/1", `run`, `plan` (text), `plan_digest`, `start` (first step, ms), `risks`,
            `clock` (source), `rate`, `instant` (UTC of plan time 0, null on a virtual clock without epoch)
step        `t`, `events`: a macro step and its input
deadline    `t`: the first node with an expired upper bound took its transition
restart     `t`: the executive came back
trace       `t`, `e`, `a`: an event of the trace and its arguments
send        `id` (run, task, attempt), `action`, `parameters`, `metadata`, `issue`
abort       `id`
utility     `t`, `option`, `value`: a utility that is not that of the plan
note        `t`, `kind`, `text`, `node`: a risk, an event without a use, a rejected replacement
end         `t`, `outcome`, `reward`, `utility`
=========== ========================================================================================

The records `step`, `deadline` and `restart` are inputs: they determine all the others.
"""

from __future__ import annotations

import contextlib
import json
import os
import threading
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import UnionType
from typing import Any, Protocol

from executive.errors import JournalError
from executive.runtime.codec import Entry
from executive.runtime.lines import documents_of, lines_of

FORMAT = "journal/1"

Record = Mapping[str, object]
"""A record as it was read: nothing is known of its members (`require`)."""


def record_of(line: str) -> dict[str, object] | None:
    """Return the record of a line, or None if the line is not whole."""
    body, mark, tail = line.rpartition(',"crc":"')
    if not mark or len(tail) != 10 or tail[8:] != '"}':
        return None
    if f"{zlib.crc32(body.encode()):08x}" != tail[:8]:
        return None
    try:
        record = json.loads(line)
    except ValueError:
        return None
    return record if isinstance(record, dict) else None


class Sink(Protocol):
    """Where the records of a run go."""

    def append(self, records: Sequence[Entry], *, durable: bool) -> None:
        """Add records; with `durable` they are safe when the call returns."""

    def close(self) -> None: ...


class MemoryJournal:
    """A journal that lives as long as its process: for simulations and tests.

    One thread appends, any may read. What was appended stays as it was then, whatever becomes of the objects
    that it was made from.
    """

    def __init__(self, records: Sequence[dict[str, object]] = ()) -> None:
        self._records: list[dict[str, object]] = list(records)
        self._unread: list[str] = []
        """What nobody has asked for yet, as a file holds it: text costs less than objects."""
        self._number = self.durable = len(self._records)
        """How many records there are; `durable`: how many were said to be safe."""
        self._reading = threading.Lock()

    @property
    def records(self) -> list[dict[str, object]]:
        """All records, as a file would hold them."""
        with self._reading:  # held by readers alone: nobody who reads keeps a run waiting
            fresh = self._unread[:]
            if fresh:
                self._records += json.loads(f"[{','.join(fresh)}]")
                del self._unread[: len(fresh)]
            return self._records

    def append(self, records: Sequence[Entry], *, durable: bool) -> None:
        self._unread += documents_of(self._number, records)
        self._number += len(records)
        if durable:
            self.durable = self._number

    def close(self) -> None:
        pass


class FileJournal:
    """A journal on disk. One write and at most one fsync for the records of a macro step.

    Raises
    ------
    JournalError
        If the file exists already (`create`), cannot be written, or the disk is full. After a failed write
        the file is cut back to its last whole record where that is possible, and nothing more is written.
    """

    def __init__(self, path: Path, *, number: int = 0, sync: bool = True) -> None:
        self.path = path
        self.number = number
        self.sync = sync
        self.fsyncs = 0
        self.broken = ""
        self._unsynced = False
        try:
            self._file = os.open(path, os.O_WRONLY | os.O_APPEND)
            self._size = os.fstat(self._file).st_size
            if self._size and sync:
                # What a process before wrote may be in the system's memory alone. It was read, so it is
                # believed, and the rover is told that it is kept.
                self._fsync()
        except OSError as error:
            raise JournalError(f"journal {path} cannot be opened: {error.strerror}") from error

    @classmethod
    def create(cls, path: Path, *, sync: bool = True) -> FileJournal:
        """Begin a new journal; one of a run that has begun is never overwritten."""
        if path.exists() and not never_began(path):
            raise JournalError(f"journal {path} exists already; recover it or choose another name")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            os.close(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o644))
            for folder in (path.parent, path.parent.parent) if sync else ():
                _sync_folder(folder)
        except OSError as error:
            raise JournalError(f"journal {path} cannot be created: {error.strerror}") from error
        return cls(path, sync=sync)

    def append(self, records: Sequence[Entry], *, durable: bool) -> None:
        if self.broken:
            raise JournalError(self.broken)
        data = lines_of(self.number, records)
        try:
            if data:
                self._write(data)
                self.number += len(records)
                self._unsynced = True
            if durable and self.sync and self._unsynced:
                self._fsync()
                self._unsynced = False
        except OSError as error:
            self._give_up(error)

    def _write(self, data: bytes) -> None:
        written = os.write(self._file, data)
        while written < len(data):
            written += os.write(self._file, data[written:])
        self._size += len(data)

    def _fsync(self) -> None:
        os.fsync(self._file)
        self.fsyncs += 1

    def _give_up(self, error: OSError) -> None:
        self.broken = (
            f"journal {self.path} cannot be written: {error.strerror}; "
            f"the {self.number} records before are safe, nothing after them has left the executive"
        )
        with contextlib.suppress(OSError):
            os.truncate(self.path, self._size)
        raise JournalError(self.broken) from error

    def close(self) -> None:
        if self._file >= 0:
            if self._unsynced and self.sync and not self.broken:
                self._fsync()
            os.close(self._file)
            self._file = -1


def _sync_folder(folder: Path) -> None:
    """Make the entries of a folder durable."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


HEADER_BEGINS = b'{"n":0,"k":"header",'


def never_began(path: Path) -> bool:
    """Tell whether a journal holds nothing but the torn beginning of its header: its run may begin anew.

    The header is durable before anything of a run leaves the executive (CRL.md 10).
    """
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        return True
    except OSError as error:
        raise JournalError(f"journal {path} cannot be read: {error.strerror}") from error
    return b"\n" not in data and data[: len(HEADER_BEGINS)] == HEADER_BEGINS[: len(data)]


class JournalFile:
    """What a journal on disk holds; `data` are its bytes where somebody has read them already.

    Attributes
    ----------
    records
        All whole records, the header first.
    torn
        The last line was not whole (a crash during a write); it is not among the records.
    size
        Bytes up to the end of the last whole record.
    """

    def __init__(self, path: Path, data: bytes | None = None) -> None:
        self.path = path
        self.records: list[dict[str, object]] = []
        self.torn = False
        self.size = 0
        try:
            data = path.read_bytes() if data is None else data
        except OSError as error:
            raise JournalError(f"journal {path} cannot be read: {error.strerror}") from error
        self._read(data)
        self._check_header()

    def _read(self, data: bytes) -> None:
        lines = data.split(b"\n")
        for place, raw in enumerate(lines):
            last = place >= len(lines) - 2
            if not raw and place == len(lines) - 1:
                break
            whole = place < len(lines) - 1
            record = record_of(raw.decode("utf-8", "replace")) if whole else None
            if record is None:
                if last and not any(lines[place + 1 :]):
                    self.torn = True
                    break
                raise JournalError(
                    f"journal {self.path}: line {place + 1} is damaged and is not the last one; "
                    "the records after it cannot be trusted"
                    if place
                    else f"{self.path} is not a journal: line 1 is not a record of format {FORMAT}"
                )
            if record.get("n") != place:
                raise JournalError(
                    f"journal {self.path}: line {place + 1} has number {record.get('n')!r}, expected {place}"
                )
            self.records.append(record)
            self.size += len(raw) + 1

    def _check_header(self) -> None:
        if not self.records:
            what = "its header is torn" if self.torn else "it is empty"
            anew = "; the run never began and may begin anew" if never_began(self.path) else ""
            raise JournalError(f"journal {self.path} has no header: {what}{anew}")
        header = self.records[0]
        if header.get("k") != "header" or header.get("format") != FORMAT:
            raise JournalError(
                f"{self.path} is not a journal of format {FORMAT}: "
                f"its first record has kind {header.get('k')!r} and format {header.get('format')!r}"
            )

    @property
    def header(self) -> dict[str, object]:
        return self.records[0]

    def cut_torn_tail(self) -> None:
        """Remove what follows the last whole record, so that the journal can be continued."""
        if self.torn:
            try:
                os.truncate(self.path, self.size)
            except OSError as error:
                raise JournalError(f"journal {self.path} cannot be repaired: {error.strerror}") from error

    def check_identity(self, *, run_id: str | None = None, plan_digest: str | None = None) -> None:
        """Refuse a journal of another run or another plan."""
        for name, wanted, found in (
            ("run", run_id, self.header.get("run")),
            ("plan digest", plan_digest, self.header.get("plan_digest")),
        ):
            if wanted is not None and wanted != found:
                raise JournalError(
                    f"journal {self.path} belongs to another run: its {name} is {found!r}, not {wanted!r}"
                )


INPUTS = ("step", "deadline", "restart")


def macro_steps(records: Sequence[Record]) -> Iterator[tuple[Record, list[Record]]]:
    """Yield each input record with the records that followed from it."""
    current: Record | None = None
    effects: list[Record] = []
    for record in records:
        if record["k"] in INPUTS:
            if current is not None:
                yield current, effects
            current, effects = record, []
        elif current is not None:
            effects.append(record)
    if current is not None:
        yield current, effects


@dataclass(frozen=True, slots=True)
class PlanTime:
    """What the plan clock is: its source, its rate, and the wall-clock instant of plan time 0 (ISO 8601)."""

    source: str = "virtual"
    rate: float = 1.0
    instant: str | None = None


def plan_time(header: Record) -> PlanTime:
    """Return what a header says of the plan clock; earlier journals said nothing."""
    instant = header.get("instant")
    return PlanTime(
        str(header.get("clock", "virtual")),
        float(require({"rate": 1.0, **header}, "rate", int | float)),
        instant if isinstance(instant, str) else None,
    )


def last_time(records: Sequence[Record]) -> int:
    """Return the plan time of the last input of a journal, milliseconds."""
    times: Iterator[int] = (require(r, "t", int) for r in records if r["k"] in INPUTS)
    return max(times, default=require(records[0], "start", int))


def last_number(records: Sequence[Record]) -> int:
    """Return the highest number of the rover's stream in a journal, 0 if there is none."""
    steps = (require(r, "events", list) for r in records if r["k"] == "step")
    return max((int(e.get("number", 0)) for events in steps for e in events), default=0)


def header_record(
    *, run_id: str, plan_text: str, plan_digest: str, start_ms: int, risks: bool, time: PlanTime
) -> dict[str, object]:
    """Return the first record of a journal."""
    return {
        "k": "header",
        "format": FORMAT,
        "run": run_id,
        "plan_digest": plan_digest,
        "start": start_ms,
        "risks": risks,
        "clock": time.source,
        "rate": time.rate,
        "instant": time.instant,
        "plan": plan_text,
    }


def require(record: Record, member: str, kind: type[Any] | UnionType) -> Any:
    """Return a member of a record, or say what is wrong with it."""
    value = record.get(member)
    if not isinstance(value, kind):
        raise JournalError(f"record {record.get('n')} ({record.get('k')}): member {member!r} is {value!r}")
    return value
