"""Fill an empty repository from a backup, as it was when that was made or at any moment before."""

from __future__ import annotations

import hashlib
import json
import tarfile
import tempfile
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Any

from sqlalchemy import select

from ground.durable import copy_file
from ground.errors import ArchiveError, ConflictError
from ground.gdr.database import Database
from ground.gdr.files import FileStore
from ground.gdr.history import SYSTEM, ChainRow, Change, record, verify_chains
from ground.gdr.migrate import migrate
from ground.gdr.places import keep_folder
from ground.gdr.repository import FOLDERS_KEPT, Repository
from ground.resources.backups.backup import FOLDERS, ROWS, SECRETS
from ground.resources.backups.check_files import check_files, damaged_files
from ground.resources.backups.container import FORMAT, LIST, Listing, read_list
from ground.resources.backups.rewind import rewind
from ground.resources.backups.rows import (
    KEPT_APART,
    LEFT_OUT,
    Record,
    brought_up,
    fill,
    parse_rows,
    read_rows,
    shrunken,
)
from ground.resources.backups.secrets import unseal
from ground.resources.history.verify_rows import verify_rows
from ground.resources.tables import METADATA

OLD = "backup/1"
"""Without hashes of its own: its rows and stored files are checked, its terrains against their record."""


@dataclass(frozen=True, slots=True)
class Restored:
    """How many rows of each table came back, and what could not: a sentence each."""

    rows: dict[str, int]
    missing: list[str]


def restore(
    repo: Repository, source: Path, *, until: datetime | None = None, passphrase: str | None = None
) -> Restored:
    """Fill an empty repository from a backup that is checked bit by bit before anything is written.

    With `until` the history is followed back to that moment: the backup may be of any time after it.

    Raises
    ------
    ConflictError
        If the repository is not empty.
    ArchiveError
        If the file is damaged or no backup; it names the part.
    """
    with tempfile.TemporaryDirectory(prefix="outcrop-restore-") as work:
        folder = Path(work)
        head = _unpack(source, folder)
        content = (folder / ROWS).read_bytes()
        if hashlib.sha256(content).hexdigest() != head.rows_sha256:
            raise ArchiveError(f"{source} is damaged: {ROWS} is not what {LIST} says")
        sealed = folder / SECRETS
        secrets = _secrets_of(sealed.read_bytes() if sealed.is_file() else None, passphrase)
        records = brought_up(parse_rows(content, secrets), head.revision)
        migrate(repo.database)
        _require_empty(repo.database)
        missing = [f"{name} was damaged or missing before the backup was made" for name in head.damaged]
        for name in (*FOLDERS, "runs", "campaigns"):
            for path in sorted((folder / name).rglob("*")):
                if path.is_file():
                    copy_file(path, repo.data_dir / path.relative_to(folder))
        _keep(repo, folder)
        with repo.database.write() as session:
            fill(session, METADATA, records)
            if until is not None:
                missing += rewind(session, until)
                last = session.get(ChainRow, SYSTEM)
                after = {"until": until.isoformat(), "made_utc": head.made_utc}
                if last is not None:
                    record(session, SYSTEM, Change("system", "restore", "repository", SYSTEM, None, after))
    return Restored(dict(head.rows), missing)


def _keep(repo: Repository, folder: Path) -> None:
    """Have what lies in the data folder now kept, where an object store does that."""
    if repo.files.store.is_local:
        return
    for path in sorted((folder / "files").rglob("*")):
        if path.is_file():
            repo.files.store.keep(path.relative_to(folder / "files").as_posix())
    for kind in FOLDERS_KEPT:
        for path in sorted((folder / kind).glob("*")):
            keep_folder(repo.folders(kind).at(path.name))


def _unpack(source: Path, folder: Path) -> Listing:
    """Return the list of a backup whose files now lie in a folder, all of them checked."""
    try:
        with tarfile.open(source) as archive:
            archive.extractall(folder, filter="data")
        head: dict[str, Any] = json.loads((folder / LIST).read_text(encoding="utf-8"))
    except (OSError, ValueError, KeyError, tarfile.TarError, EOFError) as err:
        _name_damage(source)
        raise ArchiveError(f"{source} is not a whole backup: {err}") from err
    if head.get("format") == FORMAT:
        return read_list(source)
    if head.get("format") != OLD:
        raise ArchiveError(f"{source} has the format {head.get('format')!r}; {FORMAT} and {OLD} are readable")
    for name, size in dict(head["files"]).items():
        part = folder / name
        if not part.is_file() or part.stat().st_size != size:
            raise ArchiveError(f"{source} is not a whole backup: {name} is missing or cut off")
    store = FileStore(folder / "files")
    for sha256 in store.hashes():
        if not store.is_sound(sha256):
            raise ArchiveError(f"{source} is damaged: the stored file {sha256} has another content")
    return Listing(head["revision"], head["made_utc"], head["rows"], head["rows_sha256"])


def _name_damage(source: Path) -> None:
    """Raise with the name of the damaged part of a backup of this version; pass over what else it is."""
    try:
        read_list(source)
    except OSError:
        return
    except ArchiveError as err:
        if "no whole backup" not in err.message:
            raise


def _secrets_of(sealed: bytes | None, passphrase: str | None) -> dict[str, Any]:
    if passphrase is None:
        return {}
    if sealed is None:
        raise ArchiveError("the backup holds no secrets; it was made without a passphrase")
    found: dict[str, Any] = unseal(sealed, passphrase)
    return found


def _require_empty(database: Database) -> None:
    with database.read() as session:
        for name in ("missions", "terrains"):
            if session.execute(select(METADATA.tables[name].c.id).limit(1)).first() is not None:
                raise ConflictError("the repository is not empty; restore into a new data folder or database")


def drill(
    repo: Repository, source: Path, *, until: datetime | None = None, passphrase: str | None = None
) -> list[str]:
    """Restore a backup into a scratch place and compare; return what does not fit, a sentence each.

    The scratch place is a folder with an embedded database, which is removed. Every row that comes back is
    checked against the backup's, or with `until` against what the history up to then says of it, every file
    against its hash, and every history is followed. With the passphrase the secrets are rows as others.
    """
    with tempfile.TemporaryDirectory(prefix="outcrop-drill-") as work:
        place = Path(work)
        settings = repo.settings.model_copy(update={"data_dir": place, "database_url": "", "objects": ""})
        scratch = replace(
            repo,
            settings=settings,
            database=Database(settings.database_address),
            files=FileStore(place / "files"),
        )
        try:
            found = list(restore(scratch, source, until=until, passphrase=passphrase).missing)
            found += [f"{name} is damaged" for name in damaged_files(scratch)]
            found += [f"{owner}: its file is missing" for owner in check_files(scratch).without_file]
            with scratch.database.read() as session:
                found += [f"{f.chain_id} event {f.seq}: {f.reason}" for f in verify_chains(session)[1]]
                found += map(str, verify_rows(session).faults)
                if until is None:
                    wanted, revision = _rows_of(source, passphrase)
                    there = list(read_rows(session, LEFT_OUT - set(KEPT_APART)))
                    found += shrunken(wanted, there)
                    found += _differences(brought_up(wanted, revision), there)
        finally:
            scratch.database.dispose()
    return found


def _rows_of(source: Path, passphrase: str | None) -> tuple[list[Record], str]:
    """Return the rows of a backup as they lie in it, and the revision of their schema."""
    with tarfile.open(source) as archive:
        parts = {}
        for name in {ROWS, LIST, SECRETS} & set(archive.getnames()):
            file = archive.extractfile(name)
            assert file is not None
            parts[name] = file.read()
    secrets = _secrets_of(parts.get(SECRETS), passphrase)
    return parse_rows(parts[ROWS], secrets), json.loads(parts[LIST])["revision"]


def _differences(wanted: list[Record], there: list[Record]) -> list[str]:
    first, second = _by_key(wanted), _by_key(there)
    odd = {key for key in first.keys() | second.keys() if first.get(key) != second.get(key)}
    return [f"{table} {key} did not come back as it was" for table, key in sorted(odd)]


def _by_key(records: list[Record]) -> dict[tuple[str, str], dict[str, Any]]:
    """Return rows by table and primary key."""
    keys = {table.name: [c.name for c in table.primary_key.columns] for table in METADATA.sorted_tables}
    return {(name, "/".join(str(row[k]) for k in keys[name])): row for name, row in records}
