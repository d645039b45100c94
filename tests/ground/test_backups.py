"""A backup is proof: checked bit by bit, without secrets, and good for any moment before it."""

from __future__ import annotations

import stat
import sys
import tarfile
from datetime import UTC, datetime
from pathlib import Path

import pytest
from sqlalchemy import select

from ground.errors import ArchiveError, NotFoundError
from ground.gdr.history import SYSTEM, Change, EventRow, record, verify_chains
from ground.gdr.repository import Repository, open_repository
from ground.records.actor import SYSTEM_ACTOR, Role
from ground.resources.backups.backup import backup
from ground.resources.backups.check_files import damaged_files
from ground.resources.backups.container import Listing, Part, read_list, write_container
from ground.resources.backups.restore import drill, restore
from ground.resources.history.as_of import BESIDE
from ground.resources.history.verify_rows import verify_rows
from ground.resources.missions.value import Mission
from ground.resources.packages.row import CounterRow
from ground.resources.people.accounts import create_person
from ground.resources.people.credentials import identify
from ground.resources.people.row import PersonRow
from ground.resources.plans.row import PlanRow
from ground.resources.targets.row import TargetRow
from tests.ground.conftest import Api, settings_for
from tests.ground.test_archives import contents
from tests.ground.test_missions_api import upload


def fresh(tmp_path: Path) -> Repository:
    return open_repository(settings_for(tmp_path / "fresh"))


def flip(path: Path, byte: int, bit: int = 0) -> None:
    content = bytearray(path.read_bytes())
    content[byte] ^= 1 << bit
    path.write_bytes(content)


def test_any_flipped_bit_of_a_backup_is_found_and_its_part_named(tmp_path: Path) -> None:
    target = tmp_path / "b.tar"
    parts = [Part("rows.jsonl", b"[]\n" * 40), Part("files/ab/cd/abcd", b"x" * 700), Part("empty", b"")]
    write_container(target, Listing("", "", {}, ""), parts)
    assert list(read_list(target).members) == ["rows.jsonl", "files/ab/cd/abcd", "empty"]
    places = read_list(target).members
    for byte in range(0, target.stat().st_size, 13):
        flip(target, byte, byte % 8)
        with pytest.raises(ArchiveError) as caught:
            read_list(target)
        for name, (begin, length, _) in places.items():
            if begin <= byte < begin + length:
                assert f"{name} is not what" in caught.value.message
        flip(target, byte, byte % 8)
    assert read_list(target)
    with tarfile.open(target) as archive:
        assert archive.getnames() == ["rows.jsonl", "files/ab/cd/abcd", "empty", "backup.json"]


def test_a_flipped_bit_is_refused_by_restore_and_found_by_check(
    api: Api, mission: Mission, tmp_path: Path
) -> None:
    upload(api, "a.bin", b"something" * 100)
    saved = backup(api.repo, tmp_path / "b.tar")
    assert saved.damaged == []
    begin, length, _ = read_list(tmp_path / "b.tar").members["rows.jsonl"]
    flip(tmp_path / "b.tar", begin + length // 2)
    with pytest.raises(ArchiveError, match=r"rows\.jsonl is not what its SHA-256 says"):
        restore(fresh(tmp_path), tmp_path / "b.tar")
    stored = next(iter(api.repo.files.hashes()))
    flip(api.repo.files.path(stored), 5)
    terrain = next(p for p in (api.repo.data_dir / "terrains").rglob("*.tif"))
    flip(terrain, 900)
    damaged = [f"files/{stored}", terrain.relative_to(api.repo.data_dir).as_posix()]
    assert damaged_files(api.repo) == damaged
    assert backup(api.repo, tmp_path / "c.tar").damaged == damaged
    missing = restore(fresh(tmp_path), tmp_path / "c.tar").missing
    assert missing == [f"{name} was damaged or missing before the backup was made" for name in damaged]
    upload(api, "a.bin", b"something" * 100)
    assert damaged_files(api.repo) == damaged[1:], "a file that comes again heals the stored one"


def test_drafts_stay_out_and_what_vanishes_stops_no_backup(
    api: Api, mission: Mission, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    data = api.repo.data_dir
    for draft in (data / "files" / ".draft-9-a", data / "terrains" / ".draft-trn-1" / "dem.tif"):
        draft.parent.mkdir(exist_ok=True)
        draft.write_bytes(b"half")
    upload(api, "a.bin", b"here")
    kept = next(iter(api.repo.files.hashes()))
    upload(api, "b.bin", b"soon gone")
    (vanishing,) = set(api.repo.files.hashes()) - {kept}
    is_file = Path.is_file

    def listed_then_gone(path: Path) -> bool:
        found = is_file(path)
        if path.name == vanishing and found and sys._getframe(1).f_code.co_name == "_parts":
            path.unlink()
        return found

    monkeypatch.setattr(Path, "is_file", listed_then_gone)
    saved = backup(api.repo, tmp_path / "b.tar")
    assert saved.damaged == []
    names = list(read_list(tmp_path / "b.tar").members)
    assert [name for name in names if name.startswith("files/")] == [f"files/{kept[:2]}/{kept[2:4]}/{kept}"]
    assert not any(".draft-" in name for name in names)
    assert backup(api.repo, tmp_path / "c.tar").damaged == [f"files/{vanishing}"]
    assert restore(fresh(tmp_path), tmp_path / "c.tar").missing == [
        f"files/{vanishing} was damaged or missing before the backup was made"
    ]


def test_a_backup_into_no_folder_is_refused_in_words(api: Api, tmp_path: Path) -> None:
    with pytest.raises(NotFoundError, match=r"there is no folder .*nowhere"):
        backup(api.repo, tmp_path / "nowhere" / "b.tar")


def test_what_is_kept_is_its_owners_alone(api: Api, mission: Mission, tmp_path: Path) -> None:
    upload(api, "a.bin", b"something")
    backup(api.repo, tmp_path / "b.tar")
    kept = [tmp_path / "b.tar", api.repo.data_dir, *api.repo.data_dir.glob("files/**/*")]
    kept += list((api.repo.data_dir / "terrains").rglob("*"))
    for path in kept:
        mode = stat.S_IMODE(path.stat().st_mode)
        assert mode == (0o700 if path.is_dir() else 0o600), f"{path} has mode {mode:o}"
    fresh(tmp_path).database.dispose()
    assert stat.S_IMODE((tmp_path / "fresh" / "outcrop.db").stat().st_mode) == 0o600


def test_secrets_go_only_when_asked_for_and_sealed(api: Api, tmp_path: Path) -> None:
    create_person(api.repo, SYSTEM_ACTOR, "Ann", Role.PLANNER, "correct horse battery")
    key = api.post("/api-keys", {"name": "script"})["secret"]
    with api.repo.database.read() as session:
        hashed = session.scalars(select(PersonRow.password_hash).where(PersonRow.name == "Ann")).one()
    assert hashed is not None
    backup(api.repo, tmp_path / "plain.tar")
    backup(api.repo, tmp_path / "sealed.tar", passphrase="open sesame")
    for name in ("plain.tar", "sealed.tar"):
        assert b"$argon2" not in (tmp_path / name).read_bytes()
    with pytest.raises(ArchiveError, match="do not open"):
        restore(fresh(tmp_path), tmp_path / "sealed.tar", passphrase="another")
    with pytest.raises(ArchiveError, match="holds no secrets"):
        restore(fresh(tmp_path), tmp_path / "plain.tar", passphrase="open sesame")
    repo = fresh(tmp_path)
    restore(repo, tmp_path / "sealed.tar", passphrase="open sesame")
    with repo.database.read() as session:
        assert session.scalars(select(PersonRow.password_hash).where(PersonRow.name == "Ann")).one() == hashed
    assert key in identify(repo, [key])
    repo.database.dispose()


def test_a_backup_restores_as_of_any_moment_before_it(api: Api, mission: Mission, tmp_path: Path) -> None:
    url = f"/missions/{mission.id}/targets"
    rock = api.post(url, {"east_m": 1.0, "north_m": 1.0, "name": "Rock"})
    gone = api.post(url, {"east_m": 2.0, "north_m": 1.0, "name": "Gone"})
    given = {"target_id": gone["id"], "instrument": "science_camera", "value": 1.0}
    api.post(f"/missions/{mission.id}/observation-requests", given)
    moment = datetime.now(UTC)
    before = contents(api.repo)
    api("PATCH", f"/targets/{rock['id']}", {"name": "Slab"}, headers={"If-Match": "*"})
    api("DELETE", f"/targets/{gone['id']}", headers={"If-Match": "*"})
    api.post(url, {"east_m": 3.0, "north_m": 1.0, "name": "New"})
    api.post(f"/missions/{mission.id}/path-networks", {}, status=202)
    backup(api.repo, tmp_path / "b.tar")
    repo = fresh(tmp_path)
    assert restore(repo, tmp_path / "b.tar", until=moment).missing == []
    after = contents(repo)
    with repo.database.read() as session:
        assert verify_chains(session)[1] == verify_rows(session).faults == []
        marks = session.scalars(select(EventRow).where(EventRow.action == "restore")).all()
        assert [m.chain_id for m in marks] == [SYSTEM]
        assert {t.name for t in session.scalars(select(TargetRow))} == {"Rock", "Gone"}
    differing = {name for name in before if before[name] != after[name]}
    assert differing <= {"events", "event_chains"}
    repo.database.dispose()
    assert drill(api.repo, tmp_path / "b.tar", until=moment) == []


def test_what_was_signed_since_stays_a_plan_at_the_moment_before(
    api: Api, mission: Mission, tmp_path: Path
) -> None:
    """Signing, packing and waiving tell of a plan in events that hold none of its columns."""
    api.post(f"/missions/{mission.id}/targets", {"east_m": 3.0, "north_m": 1.0})
    api.post(f"/missions/{mission.id}/plans", {"time_limit_s": 1}, status=202)
    with api.repo.database.write() as session:
        session.add(CounterRow(mission_id=mission.id, last=1))
    moment = datetime.now(UTC)
    with api.repo.database.write() as session:
        plan = session.scalars(select(PlanRow.id)).one()
        for action in BESIDE:
            record(session, mission.id, Change("Ann", action, "plan", plan, None, {"package": "pkg-1"}))
        session.get_one(CounterRow, mission.id).last = 2
    backup(api.repo, tmp_path / "b.tar")
    repo = fresh(tmp_path)
    assert restore(repo, tmp_path / "b.tar", until=moment).missing == []
    with repo.database.read() as session:
        assert session.scalars(select(PlanRow.id)).all() == [plan]
        assert session.get_one(CounterRow, mission.id).last == 2, "a counter is never given twice"
        assert verify_rows(session).faults == []
    repo.database.dispose()


def test_a_drill_restores_compares_and_leaves_nothing(api: Api, mission: Mission, tmp_path: Path) -> None:
    backup(api.repo, tmp_path / "b.tar", passphrase="open sesame")
    assert drill(api.repo, tmp_path / "b.tar") == []
    with tarfile.open(tmp_path / "b.tar") as archive:
        archive.extractall(tmp_path / "out", filter="data")
    (tmp_path / "out" / "rows.jsonl").read_text()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["b.tar", "data", "out"]
