"""A mission or a whole repository goes into a file and comes back the same, on either database."""

from __future__ import annotations

import io
import json
import zipfile
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import select

from ground.errors import ArchiveError, ConflictError
from ground.gdr.history import verify_chains
from ground.gdr.packed import read_kept
from ground.gdr.repository import Repository, open_repository
from ground.records.actor import SYSTEM_ACTOR
from ground.resources.backups.backup import backup
from ground.resources.backups.check_files import check_files
from ground.resources.backups.restore import restore
from ground.resources.mission_archives.import_mission import import_mission
from ground.resources.mission_archives.mission_archive import export_mission
from ground.resources.missions.value import Mission
from ground.resources.people.accounts import ensure_profiles
from ground.resources.products.row import ProductRow
from ground.resources.tables import METADATA
from tests.ground.conftest import Api, settings_for
from tests.ground.planning import PlannedDay, finished
from tests.ground.test_missions_api import problem, upload


def contents(repo: Repository) -> dict[str, Any]:
    with repo.database.read() as session:
        return {
            t.name: sorted(map(str, session.execute(select(t)).all()))
            for t in METADATA.sorted_tables
            if t.name not in {"credentials", "login_failures", "invitations", "idempotency_keys"}
        }


@pytest.fixture
def mission(planned_day: PlannedDay) -> Mission:
    return planned_day.mission


@pytest.fixture
def day(planned_day: PlannedDay) -> Api:
    """Give a repository with a plan, a run and products."""
    api = planned_day.api
    order = {"plan_id": planned_day.plan["id"], "seed": 4}
    finished(api, api.post(f"/missions/{planned_day.mission.id}/runs", order, status=202))
    return api


def journals(repo: Repository) -> dict[str, bytes]:
    folders = list((repo.data_dir / "runs").glob("*"))
    return {folder.name: read_kept(folder / "journal.jsonl") for folder in folders}


def other_repository(tmp_path: Path) -> Repository:
    from ground.gdr.migrate import migrate

    repo = open_repository(settings_for(tmp_path / "other"))
    migrate(repo.database)
    ensure_profiles(repo)
    return repo


def test_a_backup_of_any_database_restores_into_a_fresh_one(day: Api, tmp_path: Path) -> None:
    backup(day.repo, tmp_path / "backup.tar")
    fresh = open_repository(settings_for(tmp_path / "fresh"))
    restore(fresh, tmp_path / "backup.tar")
    assert contents(fresh) == contents(day.repo)
    assert check_files(fresh).without_file == []
    assert journals(fresh) == journals(day.repo) != {}
    with fresh.database.read() as session:
        assert verify_chains(session)[1] == []
    with pytest.raises(ConflictError, match="not empty"):
        restore(fresh, tmp_path / "backup.tar")
    fresh.database.dispose()


def test_a_cut_off_backup_is_refused(day: Api, tmp_path: Path) -> None:
    backup(day.repo, tmp_path / "backup.tar")
    whole = (tmp_path / "backup.tar").read_bytes()
    (tmp_path / "half.tar").write_bytes(whole[: len(whole) // 3])
    with pytest.raises(ArchiveError, match="not a whole backup"):
        restore(open_repository(settings_for(tmp_path / "fresh")), tmp_path / "half.tar")


def test_a_mission_moves_to_another_repository_with_files_and_history(
    day: Api, mission: Mission, tmp_path: Path
) -> None:
    export_mission(day.repo, SYSTEM_ACTOR, mission.id, tmp_path / "mission.zip")
    other = other_repository(tmp_path)
    moved = import_mission(other, SYSTEM_ACTOR, tmp_path / "mission.zip")
    assert (moved.id, moved.counts.products) == (
        mission.id,
        day.get(f"/missions/{mission.id}")["counts"]["products"],
    )
    with other.database.read() as session:
        assert verify_chains(session)[1] == []
        for product in session.scalars(select(ProductRow)):
            assert other.files.path(product.sha256).is_file()
    with pytest.raises(ConflictError, match="here already"):
        import_mission(other, SYSTEM_ACTOR, tmp_path / "mission.zip")
    other.database.dispose()


def test_an_archive_goes_out_and_in_over_rest(day: Api, mission: Mission) -> None:
    archive = day("GET", f"/missions/{mission.id}/archive")
    assert archive.headers["content-type"] == "application/zip"
    answer = day("POST", "/missions/import", {"upload_id": upload(day, "m.zip", archive.content)})
    problem(answer, 409, "conflict")
    assert (
        day("DELETE", f"/missions/{mission.id}", headers={"If-Match": "*"}, who="Administrator").status_code
        == 204
    )


def changed(content: bytes, name: str, change: Any) -> bytes:
    """Return a zip with one file changed."""
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as source, zipfile.ZipFile(out, "w") as target:
        for entry in source.namelist():
            body = source.read(entry)
            target.writestr(entry, change(body) if entry == name else body)
    return out.getvalue()


def test_a_changed_archive_is_refused(day: Api, mission: Mission, tmp_path: Path) -> None:
    export_mission(day.repo, SYSTEM_ACTOR, mission.id, tmp_path / "mission.zip")
    whole = (tmp_path / "mission.zip").read_bytes()
    other = other_repository(tmp_path)

    def newer(body: bytes) -> bytes:
        return json.dumps({**json.loads(body), "format": "mission/9"}).encode()

    for content, message in (
        (changed(whole, "rows.json", lambda body: body.replace(b'"Near"', b'"Nigh"')), "SHA-256 differs"),
        (changed(whole, "manifest.json", newer), "mission/9"),
        (whole[: len(whole) // 2], "damaged"),
    ):
        (tmp_path / "bad.zip").write_bytes(content)
        with pytest.raises(ArchiveError, match=message):
            import_mission(other, SYSTEM_ACTOR, tmp_path / "bad.zip")
    other.database.dispose()
