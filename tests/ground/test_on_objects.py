"""The service with its files in an object store: the same days as on a disk, several machines, outages."""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import text

from ground.app.service import JOB_KINDS
from ground.durable import SUMS
from ground.errors import StoreAwayError
from ground.gdr.bucket import SIGN
from ground.gdr.files import key_of
from ground.gdr.repository import Repository, open_repository
from ground.gdr.terrain_folders import _cache
from ground.jobs.worker import Worker
from ground.resources.backups.backup import backup
from ground.resources.backups.check_files import check_files, damaged_files, sweep_files
from ground.resources.backups.restore import drill, restore
from ground.resources.missions.value import Mission
from ground.resources.people.accounts import ensure_profiles
from ground.resources.products.row import ProductRow
from ground.resources.runs.row import RunRow
from ground.resources.upkeep.diagnose import diagnose
from ground.resources.upkeep.prune import prune
from ground.settings import SettingsError, load_settings
from tests.ground.campaigns.test_campaigns_api import (  # noqa: F401 - the same on objects
    test_a_plan_is_flown_many_times,
)
from tests.ground.conftest import Api, open_api, settings_for, yard
from tests.ground.planning import file_requests, finished, planned
from tests.ground.s3 import S3
from tests.ground.test_approvals import brought_in
from tests.ground.test_calibrate_mission import (  # noqa: F401 - the same on objects
    folders,
    test_over_the_interface_it_is_a_job_that_gives_the_mission_its_calibration,
)
from tests.ground.test_missions_api import problem, upload
from tests.ground.test_next_sol import (  # noqa: F401 - the same on objects
    test_a_sol_is_executed_and_the_next_begins_where_it_ended,
)
from tests.ground.test_recordings import (  # noqa: F401 - the same on objects
    test_an_uploaded_recording_comes_in_over_rest_and_a_wrong_one_is_named,
)
from tests.ground.test_traverses import (  # noqa: F401 - the same on objects
    seen,
    test_a_run_is_asked_for_its_panorama_by_name,
    test_stops_are_adjusted_and_the_new_solution_moves_the_frame_once_it_is_chosen,
)


@pytest.fixture
def sqlite_repo(sqlite_template: Path, tmp_path: Path, s3_server: S3) -> Iterator[Repository]:
    """Give a repository whose files are in a bucket of its own; here it stands for every other."""
    (tmp_path / "data").mkdir()
    shutil.copyfile(sqlite_template, tmp_path / "data" / "outcrop.db")
    url = f"s3://{s3_server.bucket()}/outcrop"
    repository = open_repository(settings_for(tmp_path / "data", objects=url))
    ensure_profiles(repository)
    yield repository
    repository.database.dispose()


@pytest.fixture
def repo(sqlite_repo: Repository) -> Repository:
    return sqlite_repo


def another_machine(repo: Repository, place: Path) -> Repository:
    """Return the same service on another machine: it shares database and object store, and no disk."""
    settings = repo.settings.model_copy(
        update={"data_dir": place, "database_url": repo.settings.database_address}
    )
    return open_repository(settings)


@pytest.fixture
def over(api: Api, mission: Mission) -> tuple[Api, dict[str, Any]]:
    """Give a service with a dry run that is over, and its run."""
    file_requests(api, mission)
    plan = planned(api, mission)
    order = {"plan_id": plan["id"], "seed": 4}
    job = finished(api, api.post(f"/missions/{mission.id}/runs", order, status=202))
    assert job["state"] == "succeeded", job["problem"]
    return api, api.get(job["result_url"])


def products_of(api: Api, run: dict[str, Any]) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = api.get(f"/missions/{run['mission_id']}/products?run_id={run['id']}")[
        "items"
    ]
    assert found
    return found


def test_everything_is_told_by_a_machine_that_shares_no_disk(
    over: tuple[Api, dict[str, Any]], tmp_path: Path
) -> None:
    api, run = over
    paths = [f"/runs/{run['id']}/{part}" for part in ("trace", "telemetry", "snapshot")]
    paths.append(f"/missions/{run['mission_id']}/terrain/point?east_m=1&north_m=1")
    here = [api.get(path) for path in paths]
    heights = f"/missions/{run['mission_id']}/terrain/heights"
    archive = api("GET", f"/missions/{run['mission_id']}/archive").content
    far = another_machine(api.repo, tmp_path / "far")
    _cache.clear()
    for there in open_api(far):
        assert [there.get(path) for path in paths] == here
        assert there("GET", heights).content == api("GET", heights).content
        assert len(there("GET", f"/missions/{run['mission_id']}/archive").content) == len(archive)
        for product in products_of(api, run):
            content = there("GET", f"/products/{product['id']}/file")
            assert content.content == api("GET", f"/products/{product['id']}/file").content
    far.database.dispose()


def test_a_job_is_done_by_a_machine_that_shares_no_disk(api: Api, mission: Mission, tmp_path: Path) -> None:
    """The order is written on one machine; path network, plan and run are worked out on another."""
    file_requests(api, mission)
    far = another_machine(api.repo, tmp_path / "far")
    _cache.clear()
    order = {"iterations": 3, "time_limit_s": 60.0, "max_branches": 2}
    job = api.post(f"/missions/{mission.id}/plans", order, status=202)
    payloads_elsewhere(api.repo, far)
    Worker(far, JOB_KINDS, slots=1).run_until_idle()
    done = api.get(f"/jobs/{job['id']}")
    assert done["state"] == "succeeded", done["problem"]
    far.database.dispose()


def payloads_elsewhere(repo: Repository, far: Repository) -> None:
    """Give the far machine the same data folder under its own name, as two machines with one path have."""
    with repo.database.write() as session:
        session.execute(
            text("UPDATE jobs SET payload = replace(payload, :here, :there) WHERE state = 'queued'"),
            {"here": str(repo.data_dir), "there": str(far.data_dir)},
        )


@pytest.mark.parametrize(
    ("asked", "start", "stop"), [("0-9", 0, 10), ("5-", 5, None), ("-7", -7, None), ("3-3", 3, 4)]
)
def test_a_part_of_a_file_passes_through_and_the_whole_is_checked(
    over: tuple[Api, dict[str, Any]], tmp_path: Path, asked: str, start: int, stop: int | None
) -> None:
    api, run = over
    product = products_of(api, run)[0]
    path = f"/products/{product['id']}/file"
    whole = api("GET", path).content
    far = another_machine(api.repo, tmp_path / "far")
    for there in open_api(far):
        headers = {"Range": f"bytes={asked}"}
        part, same = there("GET", path, headers=headers), api("GET", path, headers=headers)
        assert (part.status_code, same.status_code) == (206, 206)
        assert part.content == same.content == whole[start:stop]
        for name in ("content-range", "content-length", "etag", "accept-ranges", "content-security-policy"):
            assert part.headers[name] == same.headers[name]
        assert (
            part.headers["content-type"].partition(";")[0] == same.headers["content-type"].partition(";")[0]
        )
        assert not (far.files.folder / key_of(product["sha256"])).exists()  # nothing was brought
        beyond = {"Range": f"bytes={len(whole)}-"}
        assert there("GET", path, headers=beyond).status_code == 416
        assert there("GET", path, headers=beyond).headers["content-range"] == f"bytes */{len(whole)}"
        changed = there("GET", path, headers={**headers, "If-Range": '"another"'})
        assert (changed.status_code, changed.content) == (200, whole)
        several = there("GET", path, headers={"Range": "bytes=0-1,3-4"})
        assert several.status_code in {200, 206}
    far.database.dispose()


def test_with_the_store_away_the_service_says_so_and_loses_nothing(
    over: tuple[Api, dict[str, Any]],
    s3_server: S3,
    tmp_path: Path,
) -> None:
    api, run = over
    product = products_of(api, run)[0]
    url = api.repo.settings.objects
    assert api.get("/readyz")["checks"]["files"] == "ok"
    far = another_machine(api.repo, tmp_path / "far")
    for there in open_api(far):
        with s3_server.away():
            told = api.get("/readyz")
            assert told["status"] == "degraded"
            assert told["checks"]["files"].startswith(
                f"degraded: the object store {url}/files does not answer"
            )
            for refused in (
                there("GET", f"/products/{product['id']}/file"),
                there("GET", f"/products/{product['id']}/file", headers={"Range": "bytes=0-3"}),
                there("GET", f"/runs/{run['id']}/trace"),
                api("POST", "/uploads?file_name=a.bin", content=b"never half here"),
            ):
                said = problem(refused, 503, "unavailable")
                assert "does not answer" in said["detail"]
                assert "\n" not in said["detail"]
            assert api.get(f"/runs/{run['id']}")["state"] == "succeeded"  # rows need no store
            (finding,) = [f for f in diagnose(api.repo) if "object store" in f.what]
            assert "mend OUTCROP_OBJECTS" in finding.remedy
            with pytest.raises(StoreAwayError, match="does not answer"):
                backup(api.repo, tmp_path / "none.tar")
            assert not (tmp_path / "none.tar").exists()
        assert api.get("/readyz")["checks"]["files"] == "ok"
        assert there("GET", f"/products/{product['id']}/file").status_code == 200
        assert upload(api, "a.bin", b"here again")
        assert check_files(api.repo).without_file == damaged_files(api.repo) == []
        assert not [f for f in diagnose(api.repo) if "object store" in f.what]
    far.database.dispose()


def test_a_job_whose_store_stays_away_is_queued_again_and_ends_when_it_is_back(
    api: Api,
    mission: Mission,
    s3_server: S3,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("ground.gdr.files.JOB_PATIENCE_S", 0.0)
    monkeypatch.setattr("ground.gdr.places.JOB_PATIENCE_S", 0.0)
    monkeypatch.setattr("ground.resources.runs.work.JOB_PATIENCE_S", 0.0)
    monkeypatch.setattr(Worker, "RETRY_S", (0.05, 0.1))
    file_requests(api, mission)
    plan = planned(api, mission)
    job = api.post(f"/missions/{mission.id}/runs", {"plan_id": plan["id"], "seed": 4}, status=202)
    worker = Worker(api.repo, JOB_KINDS, slots=1)
    with s3_server.away():
        worker.step()
        assert "does not answer" in worker.engine.trouble
        waits = api.get(f"/jobs/{job['id']}")
        assert waits["state"] == "queued"
        assert "the object store" in str(waits["log"])
        assert waits["attempt"] == 0
    time.sleep(0.2)
    api.jobs()
    done = api.get(f"/jobs/{job['id']}")
    assert done["state"] == "succeeded", done["problem"]
    run = api.get(done["result_url"])
    assert products_of(api, run)


def test_check_backup_restore_and_prune_work_on_what_the_store_has(
    over: tuple[Api, dict[str, Any]],
    s3_server: S3,
    tmp_path: Path,
) -> None:
    api, run = over
    repo = api.repo
    trace = api.get(f"/runs/{run['id']}/trace")
    assert check_files(repo).without_file == damaged_files(repo) == []
    far = another_machine(repo, tmp_path / "far")  # a machine that has none of the files
    saved = backup(far, tmp_path / "backup.tar")
    assert saved.damaged == []
    assert drill(far, tmp_path / "backup.tar") == []
    onto_disk = open_repository(settings_for(tmp_path / "disk"))
    assert restore(onto_disk, tmp_path / "backup.tar").missing == []
    assert damaged_files(onto_disk) == []
    onto_objects = open_repository(
        settings_for(tmp_path / "objects", objects=f"s3://{s3_server.bucket()}/restored")
    )
    assert restore(onto_objects, tmp_path / "backup.tar").missing == []
    shutil.rmtree(tmp_path / "objects" / "files")
    for kind in ("terrains", "runs"):
        shutil.rmtree(tmp_path / "objects" / kind)
    assert check_files(onto_objects).without_file == damaged_files(onto_objects) == []
    for there in open_api(onto_objects):
        assert there.get(f"/runs/{run['id']}/trace") == trace
    spoil_one(s3_server, repo, f"files/{key_of(products_of(api, run)[0]['sha256'])}")
    spoil_one(s3_server, repo, f"terrains/{terrain_of(repo)}/{SUMS}")
    assert damaged_files(repo) == [
        f"files/{products_of(api, run)[0]['sha256']}",
        f"terrains/{terrain_of(repo)}/{SUMS}",
    ]
    for other in (far, onto_disk, onto_objects):
        other.database.dispose()


def terrain_of(repo: Repository) -> str:
    (name,) = repo.folders("terrains").names()
    return name


def spoil_one(s3: S3, repo: Repository, key: str) -> None:
    bucket, _, folder = repo.settings.objects.removeprefix("s3://").partition("/")
    client: Any = s3.client
    client.put_object(Bucket=bucket, Key=f"{folder}/{key}", Body=b"rust")


def test_what_no_record_names_is_swept_from_the_store_too(
    over: tuple[Api, dict[str, Any]],
    s3_server: S3,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    api, run = over
    repo = api.repo
    stray = repo.files.put_bytes(b"stray").sha256
    with repo.database.write() as session:
        for row in session.query(ProductRow).filter_by(run_id=run["id"]):
            session.delete(row)
        session.flush()
        session.delete(session.get_one(RunRow, run["id"]))
    assert {stray} < set(check_files(repo).unnamed)
    assert check_files(repo).strays == [run["id"]]
    assert sweep_files(repo) == []  # they may belong to a request still being answered
    monkeypatch.setattr("ground.resources.backups.check_files.FRESH_S", -3600.0)
    assert {stray, run["id"]} < set(prune(repo, timedelta(days=30)).files)
    assert repo.folders("runs").names() == []
    assert not (repo.data_dir / "runs" / run["id"]).exists()
    keys = objects_of(s3_server, repo)
    assert not [key for key in keys if stray in key or run["id"] in key]
    assert len([key for key in keys if "/terrains/" in key]) > 1


def objects_of(s3: S3, repo: Repository) -> list[str]:
    client: Any = s3.client
    bucket = repo.settings.objects.removeprefix("s3://").partition("/")[0]
    return [item["Key"] for item in client.list_objects_v2(Bucket=bucket).get("Contents", ())]


def test_an_archive_moves_a_mission_from_a_disk_into_an_object_store(
    over: tuple[Api, dict[str, Any]], sqlite_template: Path, tmp_path: Path
) -> None:
    api, run = over
    content = api("GET", f"/missions/{run['mission_id']}/archive").content
    (tmp_path / "disk").mkdir()
    shutil.copyfile(sqlite_template, tmp_path / "disk" / "outcrop.db")
    disk = open_repository(settings_for(tmp_path / "disk"))
    ensure_profiles(disk)
    for there in open_api(disk):
        there.post("/missions/import", {"upload_id": upload(there, "mission.zip", content)})
        assert there.get(f"/runs/{run['id']}/trace")["events"]
    disk.database.dispose()
    assert brought_in(api, run["mission_id"], content).status_code == 201
    assert api.get(f"/runs/{run['id']}/trace")["events"]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("bucket/folder", "use SCHEME://BUCKET/FOLDER, such as s3://rovers/outcrop"),
        ("s3://", "use SCHEME://BUCKET/FOLDER, such as s3://rovers/outcrop"),
        ("s4://x", "the file system 's4' is unknown to fsspec"),
    ],
)
def test_an_address_that_cannot_be_used_is_named_at_start(given: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match=rf"OUTCROP_OBJECTS='{given}': {said}"):
        load_settings(data_dir=tmp_path, objects=given)


def test_without_its_extra_an_object_store_is_refused_by_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ground.settings.find_spec", lambda name: None if name == "s3fs" else object())
    with pytest.raises(SettingsError, match=r"the package s3fs is not installed \(extra `objects`\)"):
        load_settings(data_dir=tmp_path, objects="s3://rovers")


def test_the_sign_that_a_place_is_in_use_is_no_file_of_it(repo: Repository) -> None:
    assert repo.files.store.trouble() == ""
    assert repo.files.store.holds(SIGN)
    assert list(repo.files.hashes()) == []


def test_two_missions_share_a_terrain_that_is_kept_once(repo: Repository, terrain_folder: Path) -> None:
    yard(repo, terrain_folder, "One")
    yard(repo, terrain_folder, "Two")
    assert len(repo.folders("terrains").names()) == 1


def test_a_campaign_of_a_rover_that_sees_brings_the_terrain_to_a_machine_without_it(
    api: Api, mission: Mission
) -> None:
    file_requests(api, mission)
    plan = planned(api, mission)
    order = {"plan_id": plan["id"], "runs": 1, "rover": "subframe", "help_runs": 0}
    asked = api.post(f"/missions/{mission.id}/campaigns", order, status=202)
    shutil.rmtree(api.repo.data_dir / "terrains")
    job = finished(api, asked)
    assert job["state"] == "succeeded", job["problem"]
    assert (api.repo.data_dir / "terrains").is_dir()
