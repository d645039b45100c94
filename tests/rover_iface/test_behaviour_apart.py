"""Behaviour and world know each other through hardware alone; the whole days are in `studies`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from ground.uplink.flight import fly
from rover_iface.contract import write_contract_world
from rover_iface.registry import find_rover
from rover_iface.simulator.faults import Fault, FaultKind
from studies.common.apart import ApartRepertoire, apart
from studies.planted_errors import fly_day, went_on

PLAN = """
(plan :id day :node (block :id all :node-list (
  (task :id see :continue-on-failure t :action trackstart :parameters (target = T1))
  (task :id picture :continue-on-failure t :action image :parameters (target = T2 instrument = scicam))
  (task :id go :continue-on-failure t :action navigate :parameters (x = 0.6 y = 0.0 mode = track))
  (task :id hand :continue-on-failure t :action handoff :parameters (target = T1))
  (task :id place :continue-on-failure t :action ipplaceinstrument :parameters (target = T1))
  (task :id lost :continue-on-failure t :action turn :parameters (angle = 0.2)))))
"""

PLANTED = """
(plan :id day :node (block :id all :node-list (
  (task :id see :continue-on-failure t :action trackstart :parameters (target = T1))
  (task :id look :continue-on-failure t :action pointmast :parameters (target = T1))
  (task :id picture :continue-on-failure t :action image :parameters (target = T2 instrument = scicam))
  (task :id ahead :continue-on-failure t :action navigate :parameters (x = 0.5 y = 0.0 mode = blind))
  (task :id hand :continue-on-failure t :action handoff :parameters (target = T1))
  (task :id turn :continue-on-failure t :action turn :parameters (angle = 0.2))
  (task :id last :action wait :parameters (duration_s = 5)))))
"""


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_contract_world(tmp_path_factory.mktemp("world"))


@pytest.mark.parametrize("kind", ["subframe", pytest.param("full", marks=pytest.mark.slow)])
def test_a_process_that_cannot_import_the_world_flies_the_same_day(
    kind: str, world: Path, tmp_path: Path
) -> None:
    made: list[ApartRepertoire] = []
    journals = []
    for name, given in (("together", {}), ("apart", {"make": apart(kind, made)})):
        out = tmp_path / name
        fault = Fault(FaultKind.SHADOW, at_s=30.0, target="T1")
        rover = find_rover(kind)(world, seed=4, out=out, faults=[fault], **given)
        fly(PLAN, rover, out, run_id="day", sync=False)
        journals.append((out / "journal.jsonl").read_bytes())
    assert made[0].close() == []
    assert journals[0] == journals[1]
    assert b'"success":true' in journals[0]


def test_errors_planted_in_actions_end_those_alone(world: Path, tmp_path: Path) -> None:
    clean = fly_day("subframe", [], tmp_path / "clean", world, plan=PLANTED)
    assert (clean["results"], clean["last"]) == (0, "SUCCEEDED")
    uses = int(str(clean["uses"]))
    at = [1, uses // 4, uses // 3, uses // 2, uses - 5]
    day = fly_day("subframe", at, tmp_path / "day", world, plan=PLANTED)
    assert int(str(day["planted"])) >= 3
    assert day["results"] == day["planted"] == day["tracebacks"]
    assert day["last"] == "SUCCEEDED"
    run = json.loads((tmp_path / "day" / "run.json").read_text(encoding="utf-8"))
    assert run["outcome"] == "SUCCEEDED"


def test_an_error_in_the_last_task_is_its_own_and_the_plan_went_on_to_it(world: Path, tmp_path: Path) -> None:
    uses = int(str(fly_day("subframe", [], tmp_path / "clean", world, plan=PLANTED)["uses"]))
    day = fly_day("subframe", [uses], tmp_path / "day", world, plan=PLANTED)
    assert (day["tasks"], day["last"], went_on(day)) == (["last"], "FAILED", True)
    assert not went_on({**day, "tasks": ["turn"]})
