"""What the study of relocalisation counts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from studies.relocalisation import figures, grounds, is_false, rows_of


def trial(**changes: Any) -> dict[str, Any]:
    return {
        "kind": "orbital, 1 m posts",
        "ground": "generated 1",
        "negative": False,
        "accepted": True,
        "faults": [],
        "cpu_s": 0.3,
        "made_s": 0.2,
        "error_m": 0.1,
        "up_m": 0.0,
        "turn_rad": 0.01,
        "sigmas": 1.0,
        "nees": 4.0,
    } | changes


@pytest.mark.parametrize(
    ("changes", "false"),
    [
        ({}, False),
        ({"error_m": 1.1}, True),
        ({"error_m": 1.1, "accepted": False}, False),
        ({"negative": True}, True),
        ({"negative": True, "accepted": False}, False),
    ],
)
def test_false_lock_is_an_accepted_pose_that_is_wrong(changes: dict[str, Any], false: bool) -> None:
    assert is_false(trial(**changes)) is false


def test_shares_are_of_all_stops_that_were_there() -> None:
    refused = {key: value for key, value in trial(accepted=False).items() if key != "error_m"}
    entries = [trial(), trial(error_m=0.4, sigmas=3.5), refused | {"faults": ["x"]}]
    entries += [trial(negative=True, accepted=False), trial(negative=True)]
    found = figures(entries)
    assert (found["there"], found["within"], found["refused"], found["beyond"]) == (3, 1, 1, 1)
    assert (found["negatives"], found["negatives_refused"], found["false"]) == (2, 1, 1)
    assert found["faults"] == {"x": 1}
    row = rows_of(entries)[-1]
    assert row[1:4] == ["3", "33.3 %", "33.3 %"]
    assert row[-2:] == ["1 of 2", "1"]


def test_places_without_real_grounds_are_generated(tmp_path: Path) -> None:
    ((place, ground),) = grounds(tmp_path / "none", range(1, 2), 5)
    assert place == 1
    assert ground.name.startswith("generated ")
