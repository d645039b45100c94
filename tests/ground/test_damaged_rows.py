"""What was changed behind the server's back and is not a value of ours: named in a 503, never a traceback."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import text
from typer.testing import CliRunner

from ground.errors import DamagedFileError
from ground.gdr.files import FileStore
from ground.gdr.packed import packed_path, read_kept, write_packed
from tests.adversary.ground import Ground, make_ground, service
from tests.adversary.service import program
from tests.ground.approving import hand_in
from tests.ground.conftest import Api
from tests.ground.planning import finished
from tests.ground.test_missions_api import problem


@pytest.fixture(scope="module")
def ground(tmp_path_factory: pytest.TempPathFactory) -> Ground:
    return make_ground(tmp_path_factory.mktemp("damaged"))


@pytest.fixture(scope="module")
def flown(ground: Ground) -> Iterator[Api]:
    """A service whose one plan is signed, packaged and flown; its tests put back what they change."""
    with service(ground.approved) as api:
        assert api("POST", f"/plans/{ground.plan}/package", who="Operator").status_code == 200
        finished(api, api.post(f"/plans/{ground.plan}/execution", {}, status=202, who="Operator"))
        yield api


@contextmanager
def changed(api: Api, table: str, column: str, value: Any, where: str = "1 = 1") -> Iterator[None]:
    """Let a column hold something else for a while."""
    with api.repo.database.engine.begin() as connection:
        connection.execute(text("PRAGMA foreign_keys = OFF"))
        kept = connection.execute(text(f"SELECT id, {column} FROM {table} WHERE {where}")).all()
        connection.execute(text(f"UPDATE {table} SET {column} = :value WHERE {where}"), {"value": value})
    try:
        yield
    finally:
        with api.repo.database.engine.begin() as connection:
            for row, before in kept:
                put = text(f"UPDATE {table} SET {column} = :before WHERE id = :id")
                connection.execute(put, {"before": before, "id": row})


PLACES = [
    ("people", "role", "king", "/people", "king"),
    ("plans", "state", "loved", "/plans/{plan}", "loved"),
    ("plans", "crl_text", "(plan", "/plans/{plan}/crl?canonical=true", "not CRL"),
    ("plans", "crl_text", "(plan", "/plans/{plan}/flight-rules", "not CRL"),
    ("plans", "problem_id", "prb_gone", "/plans/{plan}/flight-rules", "prb_gone"),
    ("runs", "kind", "dream", "/missions/{mission}/runs", "dream"),
    ("runs", "trace_sha256", "../../etc/passwd", "/runs/{run}/trace", "SHA-256"),
    ("products", "sha256", "x", "/products/{product}/file", "SHA-256"),
]


@pytest.mark.parametrize(
    ("table", "column", "junk", "path", "named"), PLACES, ids=[f"{p[0]}-{p[1]}-{p[3]}" for p in PLACES]
)
def test_a_row_that_holds_no_value_of_ours_is_refused_by_name(
    flown: Api, ground: Ground, table: str, column: str, junk: str, path: str, named: str
) -> None:
    run = flown.get(f"/missions/{ground.mission}/runs")["items"][-1]["id"]
    product = flown.get(f"/missions/{ground.mission}/products")["items"][0]["id"]
    address = path.format(mission=ground.mission, plan=ground.plan, run=run, product=product)
    assert flown("GET", address).status_code == 200
    with changed(flown, table, column, junk):
        answer = problem(flown("GET", address), 503, "data-damaged")
    assert named in answer["detail"], answer
    assert flown("GET", address).status_code == 200


@pytest.mark.parametrize("junk", ["x", "", "AAAA", "A" * 43 + "="])
def test_a_signing_key_that_was_exchanged_signs_nothing_and_packages_nothing(
    flown: Api, ground: Ground, junk: str
) -> None:
    """Also a whole key of somebody else: a key's name is its digest."""
    verified = replace(ground, approved=ground.verified)
    with service(verified.approved) as api, changed(api, "signing_keys", "public", junk):
        answer = hand_in(api, ground.plan, "author", "Planner", ground.team.author)
        assert "not the one that was registered" in problem(answer, 503, "data-damaged")["detail"]
    with changed(flown, "signing_keys", "public", junk), changed(flown, "plans", "state", "approved"):
        with flown.repo.database.engine.begin() as connection:
            connection.execute(text("DELETE FROM packages"))
        answer = flown("POST", f"/plans/{ground.plan}/package", who="Operator")
        assert "not the one that was registered" in problem(answer, 503, "data-damaged")["detail"]


def test_a_file_that_is_not_what_was_stored_is_refused_by_name(flown: Api, ground: Ground) -> None:
    run = flown.get(f"/missions/{ground.mission}/runs")["items"][-1]["id"]
    trace = flown.repo.files
    with flown.repo.database.read() as session:
        sha256 = session.execute(
            text("SELECT trace_sha256 FROM runs WHERE id = :id"), {"id": run}
        ).scalar_one()
    path = trace.path(sha256) if trace.path(sha256).is_file() else packed_path(trace.path(sha256))
    whole = path.read_bytes()
    for junk in (b"", whole[: len(whole) // 2], b"[]"):
        path.write_bytes(junk)
        answer = problem(flown("GET", f"/runs/{run}/trace"), 503, "data-damaged")
        assert sha256[:8] in answer["detail"]
    path.write_bytes(whole)
    assert flown("GET", f"/runs/{run}/trace").status_code == 200


def test_damage_of_stored_files_is_named(tmp_path: Path) -> None:
    store = FileStore(tmp_path / "files")
    kept = store.put_bytes(b"what was measured")
    store.path(kept.sha256).write_bytes(b"what was made up.")
    with pytest.raises(DamagedFileError, match=kept.sha256):
        store.read(kept.sha256)
    assert not store.is_sound(kept.sha256)
    with pytest.raises(DamagedFileError, match=r"'\.\./x'"):
        store.path("../x")
    packed = tmp_path / "run1" / "journal.jsonl"
    write_packed(packed, b"{}\n" * 100)
    packed_path(packed).write_bytes(packed_path(packed).read_bytes()[:-3])
    with pytest.raises(DamagedFileError, match=r"run1/journal\.jsonl\.br"):
        read_kept(packed)


def test_a_command_names_the_damage_in_a_line(
    flown: Api, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("OUTCROP_DATA_DIR", str(flown.repo.data_dir))
    with changed(flown, "people", "mission_roles", "[]"):
        ended = CliRunner().invoke(program(), ["ingest", str(tmp_path), "--as", "Planner"])
    assert ended.exit_code == 2
    assert ended.stderr.splitlines() == [ended.stderr.strip()]
    assert "the table people holds in mission_roles" in ended.stderr
