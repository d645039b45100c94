"""Back up a whole repository into one file, and restore it."""

from __future__ import annotations

import hashlib
import json
import shutil
import tarfile
import tempfile
from datetime import datetime
from pathlib import Path
from typing import Any

from sqlalchemy import insert, select, text

from ground.errors import ArchiveError, ConflictError
from ground.gdr.base import Utc, utc_now
from ground.gdr.migrate import current_revision, migrate
from ground.gdr.repository import Repository
from ground.resources.runs.read_snapshot import JOURNAL
from ground.resources.tables import METADATA

FORMAT = "backup/1"
FOLDERS = ("files", "terrains")


def backup(repo: Repository, target: Path) -> dict[str, int]:
    """Write database and files into a tar file; return how many rows of each table it holds.

    The database is read in one transaction, then the files it names are copied: files never change and
    come before their rows, so the copy is consistent while the server goes on. Of the folders of runs the
    journals of those that are over go with it.
    """
    counts: dict[str, int] = {}
    runs: list[str] = []
    with tempfile.TemporaryDirectory(prefix="outcrop-backup-") as work:
        rows = Path(work) / "rows.jsonl"
        with repo.database.read() as session, rows.open("w", encoding="utf-8") as out:
            if not repo.database.is_sqlite:
                session.execute(text("SET TRANSACTION ISOLATION LEVEL REPEATABLE READ, READ ONLY"))
            for table in METADATA.sorted_tables:
                if table.name in {"credentials", "login_failures", "idempotency_keys"}:
                    continue
                counts[table.name] = 0
                for row in session.execute(select(table)).mappings():
                    record = {k: _plain(value) for k, value in row.items()}
                    out.write(json.dumps([table.name, record]) + "\n")
                    counts[table.name] += 1
                    if table.name == "runs" and row["state"] not in {"queued", "running"}:
                        runs.append(row["id"])
        parts = [p for name in FOLDERS for p in sorted((repo.data_dir / name).rglob("*")) if p.is_file()]
        parts += [p for run in runs if (p := repo.run_dir(run) / JOURNAL).is_file()]
        head = {
            "format": FORMAT,
            "files": {p.relative_to(repo.data_dir).as_posix(): p.stat().st_size for p in parts},
            "revision": current_revision(repo.database),
            "made_utc": utc_now().isoformat(),
            "rows": counts,
            "rows_sha256": hashlib.sha256(rows.read_bytes()).hexdigest(),
        }
        draft = target.with_name(f".{target.name}.draft")
        with tarfile.open(draft, "w") as archive:
            manifest = Path(work) / "backup.json"
            manifest.write_text(json.dumps(head, indent=1), encoding="utf-8")
            archive.add(manifest, "backup.json")
            archive.add(rows, "rows.jsonl")
            for part in parts:
                archive.add(part, part.relative_to(repo.data_dir).as_posix())
        draft.replace(target)
    return counts


def restore(repo: Repository, source: Path) -> dict[str, int]:
    """Fill an empty repository from a backup; return how many rows of each table came back.

    Raises
    ------
    ConflictError
        If the repository is not empty.
    ArchiveError
        If the file is damaged or no backup.
    """
    with tempfile.TemporaryDirectory(prefix="outcrop-restore-") as work:
        folder = Path(work)
        try:
            with tarfile.open(source) as archive:
                archive.extractall(folder, filter="data")
            head = json.loads((folder / "backup.json").read_text(encoding="utf-8"))
            content = (folder / "rows.jsonl").read_bytes()
        except (OSError, ValueError, KeyError, tarfile.TarError, EOFError) as err:
            raise ArchiveError(f"{source} is no whole backup: {err}") from err
        if head.get("format") != FORMAT:
            raise ArchiveError(f"{source} has the format {head.get('format')!r}; {FORMAT} is readable")
        if hashlib.sha256(content).hexdigest() != head["rows_sha256"]:
            raise ArchiveError(f"{source} is damaged: rows.jsonl is not what backup.json says")
        for name, size in dict(head["files"]).items():
            part = folder / name
            if not part.is_file() or part.stat().st_size != size:
                raise ArchiveError(f"{source} is no whole backup: {name} is missing or cut off")
        migrate(repo.database, str(head["revision"]))
        tables = METADATA.tables
        with repo.database.write() as session:
            for name in ("missions", "terrains"):
                if session.execute(select(tables[name].c.id).limit(1)).first() is not None:
                    raise ConflictError(
                        "the repository is not empty; restore into a new data folder or database"
                    )
            for table in reversed(METADATA.sorted_tables):
                session.execute(table.delete())
            for line in content.decode().splitlines():
                name, record = json.loads(line)
                session.execute(insert(tables[name]).values(**_typed(tables[name], record)))
        for name in (*FOLDERS, "runs"):
            if (folder / name).is_dir():
                shutil.copytree(folder / name, repo.data_dir / name, dirs_exist_ok=True)
    migrate(repo.database)
    return {str(k): int(count) for k, count in head["rows"].items()}


def _plain(value: Any) -> Any:
    return value.isoformat() if isinstance(value, datetime) else value


def _typed(table: Any, record: dict[str, Any]) -> dict[str, Any]:
    return {
        name: datetime.fromisoformat(value)
        if isinstance(table.c[name].type, Utc) and isinstance(value, str)
        else value
        for name, value in record.items()
    }
