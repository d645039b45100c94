"""Backups of before open: `fixtures/backup-1` was written by the program as it was at revision 0006.

`revision-0006.tar.xz` is what its `outcrop backup` made of the repository of `fixtures/v0.1.0`, compressed.
"""

from __future__ import annotations

import hashlib
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
from ground.resources.backups import restore as restoring
from ground.resources.backups import rows as row_module
from ground.resources.backups.backup import ROWS, SECRETS
from ground.resources.backups.check_files import check_files, damaged_files
from ground.resources.backups.container import Listing, Part, write_container
from ground.resources.backups.restore import drill, restore
from ground.resources.backups.rows import Record
from ground.resources.backups.secrets import seal
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


PHRASE = "open sesame"
TABLES = ("people", "credentials", "signing_keys")


def with_keys(target: Path, revision: str) -> Path:
    """Write a backup of an older schema with a person, an API key and a signing key."""
    at = "2026-01-01T00:00:00+00:00"
    person = {"id": "psn-1", "name": "Ann", "role": "admin", "mission_roles": {}, "active": True}
    person |= {
        "author": "system",
        "created_utc": at,
        "modified_utc": at,
        "revision": 1,
        "password_hash": None,
    }
    owned = {"person_id": "psn-1", "name": "script", "created_utc": at}
    signing = {"id": "0123456789abcdef", "public": "p" * 44, "revoked_utc": None, **owned}
    credential = {"id": "key-1", "kind": "api_key", "secret_sha256": "a" * 64, "expires_utc": at, **owned}
    lines = [json.dumps(record) for record in (["people", person], ["signing_keys", signing])]
    rows = ("\n".join(lines) + "\n").encode()
    head = Listing(revision, at, {"people": 1, "signing_keys": 1}, hashlib.sha256(rows).hexdigest())
    secrets = seal({"passwords": {"psn-1": "$argon2id$x"}, "credentials": [credential]}, PHRASE)
    write_container(target, head, [Part(ROWS, rows), Part(SECRETS, secrets)])
    return target


def counts(repo: Repository) -> list[int]:
    with repo.database.read() as session:
        return [len(session.execute(select(Base.metadata.tables[name])).all()) for name in TABLES]


@pytest.mark.parametrize("revision", ["0009", "0013"])
def test_people_and_their_keys_come_back_from_an_older_schema(
    sqlite_repo: Repository, tmp_path: Path, revision: str
) -> None:
    source = with_keys(tmp_path / "old.tar", revision)
    assert drill(sqlite_repo, source, passphrase=PHRASE) == []
    restore(sqlite_repo, source, passphrase=PHRASE)
    assert counts(sqlite_repo) == [1, 1, 1]
    with sqlite_repo.database.read() as session:
        people = session.execute(select(Base.metadata.tables["people"])).mappings().one()
    assert people["password_hash"] == "$argon2id$x"


def test_rows_that_a_migration_loses_stop_a_restore_before_anything_is_written(
    sqlite_repo: Repository, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source, before = with_keys(tmp_path / "old.tar", "0013"), counts(sqlite_repo)
    plain = row_module.read_rows
    monkeypatch.setattr(
        row_module, "read_rows", lambda *given: (r for r in plain(*given) if r[0] != "signing_keys")
    )
    with pytest.raises(ArchiveError, match=r"between the schemas 0013 and .*: 0 of 1 rows of signing_keys"):
        restore(sqlite_repo, source, passphrase=PHRASE)
    assert counts(sqlite_repo) == before


@pytest.mark.parametrize("table", TABLES[1:])
def test_a_drill_sees_what_the_way_to_this_schema_lost(
    sqlite_repo: Repository, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, table: str
) -> None:
    plain = restoring.brought_up

    def losing(records: list[Record], revision: str) -> list[Record]:
        return [record for record in plain(records, revision) if record[0] != table]

    monkeypatch.setattr(restoring, "brought_up", losing)
    source = with_keys(tmp_path / "old.tar", "0013")
    found = drill(sqlite_repo, source, passphrase=PHRASE)
    assert found == [f"0 of 1 rows of {table} came back"]
