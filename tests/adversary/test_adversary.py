"""A few scripts of attackers; `python -m studies.adversary` plays thousands."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from tests.adversary.model import BAD, Script


def test_no_script_lets_anything_run_that_two_people_did_not_sign_or_anything_twice(tmp_path: Path) -> None:
    total: Counter[str] = Counter()
    for seed in range(30):
        folder = tmp_path / str(seed)
        folder.mkdir()
        total += Script(folder, seed).play()
    assert {name: total[name] for name in BAD} == dict.fromkeys(BAD, 0)
    assert total["runs"] >= total["scripts"] == 30
