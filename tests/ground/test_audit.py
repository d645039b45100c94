"""Heads of the histories, signed and kept elsewhere, show what a chain alone cannot: a whole new chain."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from sqlalchemy import select, update
from typer.testing import CliRunner

from ground.cli.main import app, register_all
from ground.errors import InvalidInputError
from ground.gdr.history import (
    GENESIS,
    ChainRow,
    EventRow,
    event_digest,
    heads_of,
    verify_against,
    verify_chains,
)
from ground.gdr.repository import Repository
from ground.resources.missions.value import Mission
from ground.uplink.audit_head import read_head, write_head
from ground.uplink.keys import make_key, public_text
from tests.ground.conftest import Api


def rewrite(repo: Repository, chain_id: str) -> None:
    """Let the owner of the database change an event and every hash behind it."""
    with repo.database.write() as session:
        query = select(EventRow).where(EventRow.chain_id == chain_id).order_by(EventRow.seq)
        previous = GENESIS
        for event in session.scalars(query):
            event.actor = "Somebody Else"
            event.sha256 = previous = event_digest(event, previous)
        session.get_one(ChainRow, chain_id).sha256 = previous


def test_a_rewritten_history_is_found_by_a_head_that_was_kept(
    api: Api, mission: Mission, tmp_path: Path
) -> None:
    key = make_key(tmp_path / "ann.key")
    api.post(f"/missions/{mission.id}/targets", {"east_m": 1.0, "north_m": 1.0})
    with api.repo.database.read() as session:
        write_head(tmp_path / "head.json", heads_of(session), tmp_path / "ann.key")
    heads = read_head(tmp_path / "head.json", public_text(key))
    api.post(f"/missions/{mission.id}/targets", {"east_m": 2.0, "north_m": 1.0})
    with api.repo.database.read() as session:
        assert verify_against(session, heads) == []
    rewrite(api.repo, mission.id)
    with api.repo.database.read() as session:
        assert verify_chains(session)[1] == [], "the new chain holds together"
        faults = verify_against(session, heads)
    assert [(f.chain_id, f.reason) for f in faults] == [
        (mission.id, "the event is not the one that was the head")
    ]


def test_a_head_that_was_altered_or_is_anothers_is_refused(tmp_path: Path) -> None:
    make_key(tmp_path / "ann.key")
    other = public_text(make_key(tmp_path / "bob.key"))
    write_head(tmp_path / "head.json", {"msn-1": (3, "0" * 64)}, tmp_path / "ann.key")
    assert read_head(tmp_path / "head.json") == {"msn-1": (3, "0" * 64)}
    with pytest.raises(InvalidInputError, match="not by the key that is wanted"):
        read_head(tmp_path / "head.json", other)
    document = json.loads((tmp_path / "head.json").read_text())
    for name, value in (("said", document["said"].replace("3", "4")), ("public", other), ("signature", "x")):
        (tmp_path / "bad.json").write_text(json.dumps({**document, name: value}))
        with pytest.raises(InvalidInputError, match="damaged"):
            read_head(tmp_path / "bad.json")
    (tmp_path / "bad.json").write_text("[1")
    with pytest.raises(InvalidInputError, match="is not a file of"):
        read_head(tmp_path / "bad.json")


def test_heads_are_written_and_held_against_by_command(
    api: Api, mission: Mission, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OUTCROP_DATA_DIR", str(api.repo.data_dir))
    monkeypatch.setenv("OUTCROP_DATABASE_URL", api.repo.database.url.render_as_string(hide_password=False))
    make_key(tmp_path / "ann.key")
    other = public_text(make_key(tmp_path / "bob.key"))
    kept = str(tmp_path / "head.json")

    if not app.registered_groups:
        register_all()

    def outcrop(*words: str) -> tuple[int, str]:
        result = CliRunner().invoke(app, ["audit", *words])
        assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
        return result.exit_code, result.output

    code, said = outcrop("head", kept, "--key", str(tmp_path / "ann.key"))
    assert (code, said) == (0, f"{kept}: the heads of 2 histories\n")
    api.post(f"/missions/{mission.id}/targets", {"east_m": 1.0, "north_m": 1.0})
    code, said = outcrop("verify", "--against", kept)
    assert code == 0
    assert f"rows checked, 0 faults, 2 histories checked against {kept}" in said
    assert outcrop("verify", "--against", kept, "--key", other)[0] == 2
    assert outcrop("verify", "--key", other) == (2, "outcrop: --key is for the file of --against\n")
    assert outcrop("verify", "--against", str(tmp_path / "none.json"))[0] == 2
    rewrite(api.repo, mission.id)
    assert outcrop("verify")[0] == 0, "a whole new chain holds together"
    code, said = outcrop("verify", "--against", kept)
    assert code == 1
    assert f"{mission.id} event 2: the event is not the one that was the head" in said
    with api.repo.database.write() as session:
        session.execute(update(EventRow).where(EventRow.chain_id == mission.id).values(actor="Nobody"))
    code, said = outcrop("head", kept, "--key", str(tmp_path / "ann.key"))
    assert code == 2
    assert "content does not match its hash; nothing is signed" in said
