"""Heads of the histories, signed and kept elsewhere, show what a chain alone cannot: a whole new chain."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from sqlalchemy import select

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
    with pytest.raises(InvalidInputError, match="is no file of"):
        read_head(tmp_path / "bad.json")
