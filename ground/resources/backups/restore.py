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

from sqlalchemy import Table, insert, select, update

from ground.errors import ArchiveError, ConflictError
from ground.gdr.base import Utc
from ground.gdr.database import Database
from ground.gdr.durable import copy_file
from ground.gdr.files import FileStore
from ground.gdr.history import SYSTEM, ChainRow, Change, record, verify_chains
from ground.gdr.migrate import migrate
from ground.gdr.repository import Repository
from ground.resources.backups.backup import FOLDERS, LEFT_OUT, ROWS, SECRETS, plain
from ground.resources.backups.check_files import check_files, damaged_files
from ground.resources.backups.container import FORMAT, LIST, Listing, read_list
from ground.resources.backups.rewind import rewind
from ground.resources.backups.secrets import unseal
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
        secrets = _secrets_of(folder, passphrase)
        migrate(repo.database, head.revision)
        _require_empty(repo.database)
        missing = [f"{name} was damaged before the backup was made" for name in head.damaged]
        for name in (*FOLDERS, "runs"):
            for path in sorted((folder / name).rglob("*")):
                if path.is_file():
                    copy_file(path, repo.data_dir / path.relative_to(folder))
        with repo.database.write() as session:
            _insert(session, content, secrets)
            if until is not None:
                missing += rewind(session, until)
                last = session.get(ChainRow, SYSTEM)
                after = {"until": until.isoformat(), "made_utc": head.made_utc}
                if last is not None:
                    record(session, SYSTEM, Change("system", "restore", "repository", SYSTEM, None, after))
    migrate(repo.database)
    return Restored(dict(head.rows), missing)


def _unpack(source: Path, folder: Path) -> Listing:
    """Return the list of a backup whose files now lie in a folder, all of them checked."""
    try:
        with tarfile.open(source) as archive:
            archive.extractall(folder, filter="data")
        head: dict[str, Any] = json.loads((folder / LIST).read_text(encoding="utf-8"))
    except (OSError, ValueError, KeyError, tarfile.TarError, EOFError) as err:
        _name_damage(source)
        raise ArchiveError(f"{source} is no whole backup: {err}") from err
    if head.get("format") == FORMAT:
        return read_list(source)
    if head.get("format") != OLD:
        raise ArchiveError(f"{source} has the format {head.get('format')!r}; {FORMAT} and {OLD} are readable")
    for name, size in dict(head["files"]).items():
        part = folder / name
        if not part.is_file() or part.stat().st_size != size:
            raise ArchiveError(f"{source} is no whole backup: {name} is missing or cut off")
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


def _secrets_of(folder: Path, passphrase: str | None) -> dict[str, Any]:
    sealed = folder / SECRETS
    if passphrase is None:
        return {}
    if not sealed.is_file():
        raise ArchiveError("the backup holds no secrets; it was made without a passphrase")
    found: dict[str, Any] = unseal(sealed.read_bytes(), passphrase)
    return found


def _require_empty(database: Database) -> None:
    with database.read() as session:
        for name in ("missions", "terrains"):
            if session.execute(select(METADATA.tables[name].c.id).limit(1)).first() is not None:
                raise ConflictError("the repository is not empty; restore into a new data folder or database")


def _insert(session: Any, content: bytes, secrets: dict[str, Any]) -> None:
    tables = METADATA.tables
    for table in reversed(METADATA.sorted_tables):
        session.execute(table.delete())
    for line in content.decode().splitlines():
        name, document = json.loads(line)
        session.execute(insert(tables[name]).values(**_typed(tables[name], document)))
    people = tables["people"]
    for identifier, hashed in secrets.get("passwords", {}).items():
        session.execute(update(people).where(people.c.id == identifier).values(password_hash=hashed))
    for document in secrets.get("credentials", ()):
        credentials = tables["credentials"]
        session.execute(insert(credentials).values(**_typed(credentials, document)))


def _typed(table: Table, document: dict[str, Any]) -> dict[str, Any]:
    """Return a row of a backup as the database takes it."""
    return {
        name: datetime.fromisoformat(value)
        if isinstance(table.c[name].type, Utc) and isinstance(value, str)
        else value
        for name, value in document.items()
    }


def drill(repo: Repository, source: Path, *, passphrase: str | None = None) -> list[str]:
    """Restore a backup into a scratch place and compare; return what does not fit, a sentence each.

    The scratch place is a folder with an embedded database, which is removed. Every row that comes back is
    held against the backup's, every file against its hash, and every history is followed.
    """
    with tempfile.TemporaryDirectory(prefix="outcrop-drill-") as work:
        place = Path(work)
        settings = repo.settings.model_copy(update={"data_dir": place, "database_url": ""})
        scratch = replace(
            repo,
            settings=settings,
            database=Database(settings.database_address),
            files=FileStore(place / "files"),
        )
        try:
            found = list(restore(scratch, source, passphrase=passphrase).missing)
            found += [f"{name} is damaged" for name in damaged_files(scratch)]
            found += [f"{owner}: its file is missing" for owner in check_files(scratch).without_file]
            with scratch.database.read() as session:
                found += [f"{f.chain_id} event {f.seq}: {f.reason}" for f in verify_chains(session)[1]]
                wanted = _rows_of(source)
                for table in METADATA.sorted_tables:
                    if table.name in LEFT_OUT:
                        continue
                    there = [plain(row) for row in session.execute(select(table)).mappings()]
                    if table.name == "people":
                        there = [{**row, "password_hash": None} for row in there]
                    found += _differences(table, wanted.get(table.name, []), there)
        finally:
            scratch.database.dispose()
    return found


def _rows_of(source: Path) -> dict[str, list[dict[str, Any]]]:
    found: dict[str, list[dict[str, Any]]] = {}
    with tarfile.open(source) as archive:
        entry = archive.extractfile(ROWS)
        assert entry is not None
        for line in entry.read().decode().splitlines():
            name, document = json.loads(line)
            found.setdefault(name, []).append(document)
    return found


def _differences(table: Table, wanted: list[dict[str, Any]], there: list[dict[str, Any]]) -> list[str]:
    keys = [column.name for column in table.primary_key.columns]

    def by_key(rows: list[dict[str, Any]]) -> dict[str, dict[str, Any]]:
        return {"/".join(str(row[k]) for k in keys): row for row in rows}

    first, second = by_key(wanted), by_key(there)
    return [
        f"{table.name} {key} did not come back as it was"
        for key in sorted(first.keys() | second.keys())
        if first.get(key) != {k: v for k, v in second.get(key, {}).items() if k in first.get(key, {})}
    ]
