"""Whether a package may be executed on a rover now: signatures, expiry, what the ledger says of it.

What happens between a package and the first command, for simulated and live executions alike. Standard
library and `cryptography` alone: it is part of the on-board file.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from ground.errors import AlreadyExecutedError, ArchiveError, ForbiddenError
from ground.uplink.ledger import Entry, Ledger, begun, locked_ledger, pinned
from ground.uplink.trust import checked as checked_trust
from ground.uplink.trust import read_file, refusals
from ground.uplink.verify import PACKAGE, Package, Trust, read_package, verify_package


@dataclass(frozen=True, slots=True)
class Admitted:
    """A package that may be executed; `earlier` is what the ledger says of it if it was begun before."""

    package: Package
    ledger: Ledger
    earlier: Entry | None
    now_utc: datetime
    name: str

    def entry(self, rover: str, seed: int | None) -> Entry:
        """Return what the ledger keeps once the first command leaves."""
        return {
            "mission": self.package.mission,
            "sequence": self.package.counter,
            "sha256": self.package.sha256,
            "rover": rover,
            "seed": seed,
            "begun_utc": self.now_utc.isoformat(timespec="seconds"),
        }


def utc_now() -> datetime:
    return datetime.now(UTC)


@contextlib.contextmanager
def admitted(
    package: Path,
    world: Path,
    trust_file: Path,
    *,
    check: Callable[[Package], None],
    resume: bool = False,
    on_repair: Callable[[str], None] = lambda _what: None,
    clock: Callable[[], datetime] = utc_now,
    prepare: Callable[[Ledger], None] = lambda _ledger: None,
) -> Iterator[Admitted]:
    """Give a package that may be executed, and the rover's ledger, held as long as this lasts.

    Everything is checked before the first command: the signatures of enough people by the trust file,
    digests, expiry, counter, and what `check` holds of it (raises if it does not fit the rover). `prepare`
    writes what is to be there before, while no other execution has the rover.

    Raises
    ------
    ArchiveError
        If the package is damaged, foreign, expired, signed by too few, or does not fit.
    AlreadyExecutedError
        If the rover has begun this package and this is not a resumption, or one with a later counter, or is
        busy.
    """
    content = read_file(package, "the package")
    with refusals():
        opened = read_package(content)
    name = f"package {opened.counter} of {opened.mission}"
    with locked_ledger(world, name) as ledger:
        if ledger.repaired:
            on_repair(ledger.repaired)
        prepare(ledger)
        earlier = _begun(ledger, opened, name)
        trust = _trust(ledger, trust_file)
        now_utc = _now(clock(), ledger.entries)
        if resume and earlier is not None:  # it was begun in time
            now_utc = min(now_utc, _time(earlier) or now_utc)
        with refusals():
            checked = verify_package(content, trust, now_utc)
        check(checked)
        if pinned(ledger.entries) is None:
            pin(ledger, trust)
        if earlier is not None and not resume:
            raise AlreadyExecutedError(f"{name} was executed before")
        yield Admitted(checked, ledger, earlier, now_utc, name)


def check_plan(package: Package, dictionary: tuple[str, str, str]) -> None:
    """Hold a package to the rover's dictionary (name, version, SHA-256) and its plan to what was approved.

    Raises
    ------
    ArchiveError
        If they are not the same.
    """
    from executive.crl import CrlError, digest, parse

    found = package.manifest.get("dictionary")
    wanted = found if isinstance(found, dict) else {}
    same = (wanted.get("name"), wanted.get("version")) == dictionary[:2]
    if not same or (package.format == PACKAGE and wanted.get("sha256") != dictionary[2]):
        raise ArchiveError(
            f"the package is for the command dictionary {wanted.get('name')!a} {wanted.get('version')!a}; "
            f"this rover has {dictionary[0]} {dictionary[1]}" + (" of another text" if same else "")
        )
    try:
        same = digest(parse(package.crl_text)) == package.manifest["crl_sha256"]
    except (CrlError, RecursionError) as err:
        raise ArchiveError(f"the plan of the package is not CRL: {err}") from err
    if not same:
        raise ArchiveError("the plan of the package is not the one that was approved (SHA-256 differs)")


def commission(world: Path, trust_file: Path) -> Trust:
    """Bind a rover to a trust file for good, one for training too; return what it says.

    Raises
    ------
    ForbiddenError
        If the rover is bound to another one.
    ArchiveError
        If the trust file does not hold together.
    """
    with locked_ledger(world, "commissioning") as ledger:
        return bind(ledger, trust_file, world)


def bind(ledger: Ledger, trust_file: Path, world: Path) -> Trust:
    """Bind the rover whose ledger is held to a trust file; see `commission`."""
    trust = checked_trust(read_file(trust_file, "the trust file"))
    known = pinned(ledger.entries)
    if known is not None and known["trust"] not in trust.chain:
        raise ForbiddenError(f"the rover of {world} is bound to another trust file")
    if known is None or known["trust"] != trust.chain[-1]:
        pin(ledger, trust)
    return trust


def pin(ledger: Ledger, trust: Trust) -> None:
    """Write into the ledger which version of the trust file is used from now on, and none before it."""
    ledger.append({"trust": trust.chain[-1], "version": trust.version})


def _trust(ledger: Ledger, path: Path) -> Trust:
    """Return the trust file, bound to the one that was used before; a later version is bound to at once."""
    known = pinned(ledger.entries)
    last = None if known is None else str(known["trust"])
    trust = checked_trust(read_file(path, "the trust file"), pinned=last)
    if known is None and trust.training:
        raise ArchiveError(
            "the trust file is for training; only a rover that was commissioned with it accepts it "
            "(`outcrop trust install`)"
        )
    if last is not None and last != trust.chain[-1]:
        pin(ledger, trust)
    return trust


def _begun(ledger: Ledger, package: Package, name: str) -> Entry | None:
    """Return what the ledger says of a package that was begun here; refuse one that is older than another."""
    found: Entry | None = None
    for entry in begun(ledger.entries):
        if entry["sha256"] == package.sha256:
            found = entry
        elif entry["mission"] == package.mission and int(str(entry["sequence"])) >= package.counter:
            raise AlreadyExecutedError(
                f"{name} is older than package {entry['sequence']}, which was executed before, or the same "
                "in another file"
            )
    return found


def _time(entry: Entry) -> datetime | None:
    try:
        return datetime.fromisoformat(str(entry.get("begun_utc")))
    except ValueError:
        return None


def _now(clock_utc: datetime, entries: Sequence[Entry]) -> datetime:
    """Return the time, never before that of an execution in the ledger: a clock set back revives nothing."""
    times = [t for t in map(_time, begun(entries)) if t is not None and t.tzinfo is not None]
    return max([clock_utc, *times])
