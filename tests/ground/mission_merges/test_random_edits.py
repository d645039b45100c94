"""Random edits of a mission and its copy, merged: a part of the study, with a seed that stays."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

import pytest

from ground.gdr.repository import Repository
from ground.resources.mission_merges import compared
from ground.resources.mission_setup.create_mission import FolderTerrain, create_mission
from ground.versions.merge import Take
from studies.mission_merges import BAD, PEOPLE, pairs_of, study


def test_no_edit_is_lost_without_a_named_conflict(repo: Repository, terrain_folder: Path) -> None:
    seed = 20261123  # the study draws fresh ones
    pairs = 30 if repo.database.is_sqlite else 6
    found, faults = study(repo, pairs, seed, FolderTerrain(terrain_folder))
    print(f"seed {seed}: {dict(sorted(found.items()))}")
    assert faults == [], seed
    assert not any(found[name] for name in BAD), seed
    assert found["merged"] > pairs / 2, seed
    assert found["edits"] > pairs, seed


def _take_ours(self: Any, kind: Any, key: Any, *_: Any) -> Any:
    """Forget to name what both changed."""
    return Take.OURS


def _drop_orders(kind: str, document: Any, rename: Any) -> Any:
    """Forget one member of requests."""
    return {name: found for name, found in _FIELDS(kind, document, rename).items() if name != "window_s"}


_FIELDS: Callable[..., Any] = compared.fields_of


@pytest.mark.parametrize("broken", ["conflicts", "member", "removal"])
def test_the_study_finds_a_merge_that_loses_edits(
    sqlite_repo: Repository, terrain_folder: Path, monkeypatch: pytest.MonkeyPatch, broken: str
) -> None:
    if broken == "conflicts":
        monkeypatch.setattr("ground.versions.rows._Merge._decide", _take_ours)
    elif broken == "member":
        monkeypatch.setattr("ground.resources.mission_merges.read_sides.fields_of", _drop_orders)
    else:
        monkeypatch.setattr("ground.resources.mission_merges.apply_merge.REMOVED", ())
    source = create_mission(sqlite_repo, PEOPLE[0], name="Source", source=FolderTerrain(terrain_folder)).id
    pairs = pairs_of(sqlite_repo, source, 20, Random(20261123), Counter())
    assert any(pair.faults for pair in pairs)  # it looks no further than the first
