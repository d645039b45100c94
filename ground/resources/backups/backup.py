"""Back up a whole repository into one file."""

from __future__ import annotations

import hashlib
import json
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sqlalchemy import select, text
from sqlalchemy.orm import Session

from ground.durable import DRAFT
from ground.errors import DamagedFileError, NotFoundError
from ground.gdr.base import utc_now
from ground.gdr.migrate import current_revision
from ground.gdr.packed import packed_path
from ground.gdr.repository import Repository
from ground.resources.backups.check_files import damaged_files, missing_files
from ground.resources.backups.container import Listing, Part, write_container
from ground.resources.backups.rows import LEFT_OUT, plain, read_rows
from ground.resources.backups.secrets import seal
from ground.resources.runs.read_snapshot import JOURNAL
from ground.resources.tables import METADATA

FOLDERS = ("files", "terrains")
UNFINISHED = ".draft"
"""End of the name of a file of a campaign that is being written."""
ROWS, SECRETS = "rows.jsonl", "secrets.json"


@dataclass(frozen=True, slots=True)
class Saved:
    """How many rows of each table a backup holds, and the files that were damaged or missing before."""

    rows: dict[str, int]
    damaged: list[str]


def backup(repo: Repository, target: Path, *, passphrase: str | None = None) -> Saved:
    """Write database and files into a file of its owner's alone.

    The database is read in one transaction, then the files it names are copied: files never change and
    come before their rows, so the copy is consistent while the server goes on. Of runs and campaigns that are
    over the journals and the folders go with it. What is damaged goes with it too; that and
    what is missing is named.

    Hashes of passwords and of API keys and secrets of webhooks are left out, or sealed with `passphrase`.

    Raises
    ------
    NotFoundError
        If there is no folder to write it into.
    """
    if not target.parent.is_dir():
        raise NotFoundError(f"{target} cannot be written: there is no folder {target.parent}")
    with tempfile.TemporaryDirectory(prefix="outcrop-backup-") as work:
        rows = Path(work) / ROWS
        with repo.database.read() as session, rows.open("w", encoding="utf-8") as out:
            if not repo.database.is_sqlite:
                session.execute(text("SET TRANSACTION ISOLATION LEVEL REPEATABLE READ, READ ONLY"))
            counts = {table.name: 0 for table in METADATA.sorted_tables if table.name not in LEFT_OUT}
            over: dict[str, list[str]] = {"runs": [], "campaigns": []}
            for name, row in read_rows(session):
                if name == "people":
                    row["password_hash"] = None
                out.write(json.dumps([name, row]) + "\n")
                counts[name] += 1
                if name in over and row["state"] not in {"queued", "running"}:
                    over[name].append(row["id"])
            secret = None if passphrase is None else seal(_secrets(session), passphrase)
        damaged = damaged_files(repo) + missing_files(repo)
        digest = hashlib.sha256(rows.read_bytes()).hexdigest()
        revision = current_revision(repo.database) or ""
        head = Listing(revision, utc_now().isoformat(), counts, digest, tuple(damaged))
        write_container(target, head, _parts(repo, rows, over, secret))
    return Saved(counts, damaged)


def _parts(
    repo: Repository, rows: Path, over: Mapping[str, Sequence[str]], secret: bytes | None
) -> Iterator[Part]:
    yield Part(ROWS, rows)
    if secret is not None:
        yield Part(SECRETS, secret)
    for path in _paths(repo, over):
        name = path.relative_to(repo.data_dir)
        drafts = (part for part in name.parts if part.startswith(DRAFT) or part.endswith(UNFINISHED))
        if path.is_file() and not any(drafts):
            yield Part(name.as_posix(), path)


def _paths(repo: Repository, over: Mapping[str, Sequence[str]]) -> Iterator[Path]:
    """Yield what goes into a backup, on the disk of this machine: brought one after the other if need be."""
    for sha256 in sorted(repo.files.hashes()):
        try:
            path = repo.files.path(sha256)
        except DamagedFileError:  # named already, and nobody has another
            continue
        yield from (path, packed_path(path))
    terrains = repo.folders("terrains")
    for name in terrains.names():
        yield from sorted(repo.terrain_dir(name).rglob("*"))
    for name in over["campaigns"]:
        yield from sorted(repo.campaign_dir(name).rglob("*"))
    for name in over["runs"]:
        journal = repo.run_dir(name) / JOURNAL
        yield from (journal, packed_path(journal))


def _secrets(session: Session) -> dict[str, Any]:
    people, credentials = METADATA.tables["people"], METADATA.tables["credentials"]
    hooks = METADATA.tables["webhook_states"]
    keys = select(credentials).where(credentials.c.kind == "api_key")
    return {
        "passwords": dict(session.execute(select(people.c.id, people.c.password_hash)).all()),
        "credentials": [plain(row) for row in session.execute(keys).mappings()],
        "webhook_states": [plain(row) for row in session.execute(select(hooks)).mappings()],
    }
