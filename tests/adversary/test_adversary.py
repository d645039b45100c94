"""A few scripts of attackers; `python -m studies.adversary` plays thousands."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from ground.uplink.verify import Package, read_package
from tests.adversary.ground import Ground, make_ground
from tests.adversary.model import Script as RoverScript
from tests.adversary.oracle import BAD, Rover
from tests.adversary.service import Script as GroundScript

FOUND = (5022, 5054, 5078, 5092, 5120, 5318)
"""Scripts that met a 500 once: rows and stored files were changed behind the server."""


@pytest.fixture(scope="module")
def ground(tmp_path_factory: pytest.TempPathFactory) -> Ground:
    return make_ground(tmp_path_factory.mktemp("ground"))


def judged(rovers: list[Rover]) -> Counter[str]:
    """Return what was found, after holding it to be nothing bad."""
    total: Counter[str] = sum((rover.found for rover in rovers), Counter())
    assert [noted for rover in rovers for noted in rover.noted] == []
    assert {name: total[name] for name in BAD} == dict.fromkeys(BAD, 0)
    return total


def test_no_script_lets_anything_run_that_two_people_did_not_sign_or_anything_twice(tmp_path: Path) -> None:
    scripts = []
    for seed in range(30):
        folder = tmp_path / str(seed)
        folder.mkdir()
        scripts.append(RoverScript(folder, seed))
        scripts[-1].play()
    total = judged([script.rover for script in scripts])
    assert total["runs"] >= total["scripts"] == 30


def test_no_script_on_the_ground_gets_anything_executed_that_was_not_signed(
    ground: Ground, tmp_path: Path
) -> None:
    rovers = []
    for seed in (*range(24), *FOUND):
        folder = tmp_path / str(seed)
        folder.mkdir()
        rovers.append(GroundScript(folder, seed, ground).play())
    total = judged(rovers)
    assert total["packages made"] >= 10
    assert total["runs"] >= 10


def test_the_oracle_finds_out_a_rover_that_believes_everybody_and_forgets(
    ground: Ground, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    believed = read_package

    def believe(content: bytes, _trust: object, _now: object) -> Package:
        return believed(content)

    monkeypatch.setattr("ground.uplink.admission.verify_package", believe)
    monkeypatch.setattr("ground.uplink.admission._begun", lambda *_: None)
    total: Counter[str] = Counter()
    for seed in range(8):
        folder = tmp_path / str(seed)
        folder.mkdir()
        total += GroundScript(folder, seed, ground).play().found
        (folder / "rover").mkdir()
        script = RoverScript(folder / "rover", seed)
        script.play()
        total += script.rover.found
    assert total["unapproved"] > 0
    assert total["twice"] > 0
