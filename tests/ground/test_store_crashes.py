"""The file store on a disk that forgets what was not synchronised."""

from __future__ import annotations

from pathlib import Path

import pytest

from ground import durable
from ground.gdr import packed, store
from studies.crash_points import study_of_the_store


def test_no_crash_point_loses_a_stored_file_or_leaves_one_damaged() -> None:
    found = study_of_the_store(400, seed=20261123)
    assert found["points"] >= 400
    assert (found["lost"], found["silent damage"]) == (0, 0)


def _content_not_synchronised(draft: Path, target: Path) -> None:
    durable.make_folder(target.parent)
    draft.replace(target)
    durable.sync(target.parent)


def _name_not_synchronised(draft: Path, target: Path) -> None:
    durable.sync(draft)
    durable.make_folder(target.parent)
    draft.replace(target)


@pytest.mark.parametrize(
    ("careless", "told"),
    [(_content_not_synchronised, "silent damage"), (_name_not_synchronised, "lost")],
)
def test_a_careless_store_is_found_out(careless: object, told: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (store, packed):
        monkeypatch.setattr(module, "put_in_place", careless)
    assert study_of_the_store(60, seed=1)[told] > 0
