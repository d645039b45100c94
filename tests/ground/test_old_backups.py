"""Backups of before open: `fixtures/backup-1` was written by the program as it was at revision 0006.

`revision-0006.tar.xz` is what its `outcrop backup` made of the repository of `fixtures/v0.1.0`, compressed.
"""

from __future__ import annotations

import io
import json
import lzma
import tarfile
from pathlib import Path

import pytest
from sqlalchemy import select

from ground.errors import ArchiveError
from ground.gdr.base import Base
from ground.gdr.history import verify_chains
from ground.gdr.migrate import current_revision, newest_revision
from ground.gdr.repository import Repository, open_repository
from ground.resources.backups.check_files import check_files, damaged_files
from ground.resources.backups.restore import drill, restore
from ground.resources.missions.row import MissionRow
from ground.resources.targets.row import TargetRow
from tests.ground.conftest import settings_for

OLD = Path(__file__).parent / "fixtures" / "backup-1" / "revision-0006.tar.xz"


@pytest.fixture
def old(tmp_path: Path) -> Path:
    (tmp_path / "old.tar").write_bytes(lzma.decompress(OLD.read_bytes()))
    return tmp_path / "old.tar"


def of_revision(source: Path, target: Path, revision: str) -> Path:
    """Write a backup that says of itself that it is of another revision."""
    with tarfile.open(source) as old, tarfile.open(target, "w") as new:
        for entry in old:
            file = old.extractfile(entry)
            assert file is not None
            content = file.read()
            if entry.name == "backup.json":
                content = json.dumps({**json.loads(content), "revision": revision}).encode()
                entry.size = len(content)
            new.addfile(entry, io.BytesIO(content))
    return target


def test_a_backup_of_an_older_schema_comes_back_in_this_one(repo: Repository, old: Path) -> None:
    with repo.database.write() as session:
        for table in reversed(Base.metadata.sorted_tables):
            session.execute(table.delete())
    done = restore(repo, old)
    assert done.missing == []
    assert current_revision(repo.database) == newest_revision()
    assert check_files(repo).without_file == damaged_files(repo) == []
    with repo.database.read() as session:
        assert verify_chains(session) == (done.rows["events"], [])
        counts = {t.name: len(session.execute(select(t)).all()) for t in Base.metadata.sorted_tables}
        assert {name: counts[name] for name in done.rows} == done.rows
        assert session.scalars(select(MissionRow)).one().id == "msn-1qgx5dyjny6rm"
        assert {target.feature_type for target in session.scalars(select(TargetRow))} == {""}


def test_an_older_backup_can_be_drilled(sqlite_repo: Repository, old: Path) -> None:
    assert drill(sqlite_repo, old) == []


def test_a_backup_of_a_newer_schema_is_refused_by_name(old: Path, tmp_path: Path) -> None:
    newer = of_revision(old, tmp_path / "newer.tar", "9999")
    repo = open_repository(settings_for(tmp_path / "fresh"))
    with pytest.raises(ArchiveError, match="has the schema '9999', which this version"):
        restore(repo, newer)
    repo.database.dispose()
