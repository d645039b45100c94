"""A planned day, emitted as CRL and flown by the executive on the rover that renders what it sees."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from executive.crl import canonical_text
from ground.uplink.flight import Flight, fly
from planner.emit_crl import emit
from planner.problem import problem_from_dict
from planner.solve import solve
from rover_iface.contract import write_contract_world
from rover_iface.simulator.subframe_rover import make_rover
from rover_iface.simulator.terrain_rover import TerrainRover
from rover_iface.simulator.world import load_world


@pytest.fixture(scope="module")
def day(tmp_path_factory: pytest.TempPathFactory) -> tuple[TerrainRover, Flight, Path]:
    folder = write_contract_world(tmp_path_factory.mktemp("world"))
    document = dict(load_world(folder).problem_document())
    for target in document["targets"]:
        target["observations"][0]["refs"] = {"request": f"request of {target['id']}"}
    problem = problem_from_dict(document)
    plan = solve(problem, max_branches=0, time_limit_s=10.0, seed=1)
    crl = canonical_text(emit(problem, plan.tree, plan_id="day"))
    out = tmp_path_factory.mktemp("run")
    rover = make_rover(folder, seed=4, out=out)
    return rover, fly(crl, rover, out, run_id="day", about={"rover": "subframe"}, sync=False), out


def test_the_executive_flies_the_plan_on_the_subframe_rover(
    day: tuple[TerrainRover, Flight, Path],
) -> None:
    rover, flight, out = day
    assert flight.outcome.outcome == "SUCCEEDED"
    ended = [json.loads(line) for line in (out / "trace.jsonl").read_text().splitlines()]
    drives = [r for r in ended if r[1] == "end" and str(r[2]).startswith("navigate-")]
    assert len(drives) == 2
    assert rover.body.chassis.travelled_m > 4.0
    assert {r.target for r in rover.truth.history} == {"T1", "T2"}


def test_each_image_of_an_observation_names_its_request(day: tuple[TerrainRover, Flight, Path]) -> None:
    _, _, out = day
    rows = [json.loads(line) for line in (out / "products.jsonl").read_text().splitlines()]
    images = [row for row in rows if row["label"]["kind"] in ("image", "hazcam", "microscopic")]
    assert images
    for row in images:
        assert row["label"]["target"] in ("T1", "T2")
        assert row["label"]["request"] == f"request of {row['label']['target']}"
        assert (out / row["path"]).stat().st_size > 1000
