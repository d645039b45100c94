"""A run that is over is kept packed: read, backed up and exported as before, and so are folders of before."""

from __future__ import annotations

import hashlib
import io
import zipfile
from pathlib import Path
from typing import Any

import pytest

from ground.gdr.packed import is_kept, packed_path, read_kept, unpack, write_packed
from ground.gdr.repository import Repository, open_repository
from ground.records.actor import SYSTEM_ACTOR
from ground.records.get_resource import get_resource
from ground.resources.backups.backup import backup
from ground.resources.backups.check_files import check_files, damaged_files, sweep_files
from ground.resources.backups.restore import restore
from ground.resources.runs.kind import RUN
from ground.resources.runs.read_run import LiveLines
from ground.resources.runs.value import Run
from tests.ground.conftest import Api, settings_for
from tests.ground.planning import PlannedDay, finished
from tests.ground.test_approvals import brought_in


@pytest.fixture
def flown(planned_day: PlannedDay) -> tuple[Api, str]:
    """Give a repository with a dry run that is over, and its id."""
    api, order = planned_day.api, {"plan_id": planned_day.plan["id"], "seed": 4}
    job = api.post(f"/missions/{planned_day.mission.id}/runs", order, status=202)
    finished(api, job)
    return api, job["subject_id"]


def lines_of(repo: Repository, run: Run, after: int = 0) -> list[tuple[str, Any]]:
    """Return all lines of a run behind one of them, without their numbers, which count from one."""
    lines, found = LiveLines(repo, run), list[tuple[int, str, Any]]()
    while some := lines.behind(found[-1][0] if found else after):
        found += some
    assert [number for number, _, _ in found] == list(range(after + 1, after + 1 + len(found)))
    return [(kind, data) for _, kind, data in found]


def answers(api: Api, run: str) -> dict[str, Any]:
    """Return everything that the API tells of a run."""
    shown = {part: api.get(f"/runs/{run}/{part}") for part in ("trace", "telemetry", "snapshot")}
    found = get_resource(api.repo, SYSTEM_ACTOR, RUN, run)
    lines = [(kind, str(data)) for kind, data in lines_of(api.repo, found)]
    return {**shown, "lines": lines, "behind": lines_of(api.repo, found, len(lines) - 2)}


def texts(api: Api, run: str) -> list[Path]:
    """Return the texts of a run by the name of their unpacked form: of the folder, and of the store."""
    folder = api.repo.run_dir(run)
    stored = [p.with_suffix("") for p in api.repo.files.folder.rglob("*.br")]
    return [folder / "live.jsonl", folder / "journal.jsonl", *stored]


def test_a_run_that_is_over_is_packed_and_tells_the_same(flown: tuple[Api, str]) -> None:
    api, run = flown
    folder, packed = api.repo.run_dir(run), answers(api, run)
    assert {p.name for p in folder.iterdir() if p.is_file()} == {
        *("run.json", "plan.crl", "products.jsonl", "live.jsonl.br", "journal.jsonl.br")
    }
    assert [kind for kind, _ in packed["lines"]][:1] == ["control"]
    assert {"telemetry", "trace", "product"} < {kind for kind, _ in packed["lines"]}
    kept = texts(api, run)
    assert len(kept) == 4
    for path in kept:  # as the version before wrote them
        path.write_bytes(unpack(packed_path(path).read_bytes()))
        packed_path(path).unlink()
    assert answers(api, run) == packed
    assert check_files(api.repo).without_file == damaged_files(api.repo) == []


def test_what_leaves_is_unpacked_and_comes_back_packed(flown: tuple[Api, str], tmp_path: Path) -> None:
    api, run = flown
    mission, before = api.get(f"/runs/{run}")["mission_id"], answers(api, run)
    content = api("GET", f"/missions/{mission}/archive").content
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    assert files[f"runs/{run}/journal.jsonl"] == read_kept(api.repo.run_dir(run) / "journal.jsonl")
    stored = {name: body for name, body in files.items() if name.startswith("files/")}
    assert all(
        hashlib.sha256(body).hexdigest() == name.removeprefix("files/") for name, body in stored.items()
    )
    assert sum(body.startswith(b"{") for body in stored.values()) >= 2  # trace and telemetry, as JSON

    backup(api.repo, tmp_path / "backup.tar")
    fresh = open_repository(settings_for(tmp_path / "fresh"))
    assert restore(fresh, tmp_path / "backup.tar").missing == []
    assert check_files(fresh).without_file == damaged_files(fresh) == []
    assert is_kept(fresh.run_dir(run) / "journal.jsonl")
    fresh.database.dispose()

    assert brought_in(api, mission, content).status_code == 201
    assert not (api.repo.run_dir(run) / "journal.jsonl").exists()
    again = answers(api, run)
    assert {part: again[part] for part in ("trace", "telemetry", "snapshot")} == {
        part: before[part] for part in ("trace", "telemetry", "snapshot")
    }


def test_a_packed_file_that_is_damaged_is_found_and_a_stray_one_swept(flown: tuple[Api, str]) -> None:
    api, run = flown
    stray = hashlib.sha256(b"stray").hexdigest()
    write_packed(api.repo.files.path(stray), b"stray")
    assert check_files(api.repo).unnamed == [stray]
    assert sweep_files(api.repo) == []  # it is fresh
    assert api.repo.files.sweep(set(), 1e12) != []
    assert not api.repo.files.holds(stray)

    path = packed_path(api.repo.files.path(stray))
    write_packed(api.repo.files.path(stray), b"stray again")
    assert f"files/{stray}" in damaged_files(api.repo)
    path.write_bytes(path.read_bytes()[:-3])
    assert f"files/{stray}" in damaged_files(api.repo)
    torn = packed_path(api.repo.run_dir(run) / "journal.jsonl")
    torn.write_bytes(torn.read_bytes()[:-9])
    answer = api("GET", f"/runs/{run}/snapshot")
    assert answer.status_code == 409
    assert "cannot be unpacked: it is damaged" in answer.json()["detail"]
