"""The schemas in the docs are those of the codecs; OUTCROP_WRITE_SCHEMAS=1 writes them anew."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import pytest

from mission.codec import Codec
from mission.day import DAYS
from mission.sol_timeline import SOL_SERIES
from neighbours.flight.flight_map import FLIGHT_MAP
from planner.path_network.calibration_document import CALIBRATIONS
from planner.plan_tree_document import TREES
from planner.problem_document import PROBLEMS, SURE_DRIVES
from rover_iface.profile import PROFILES
from rover_iface.ros2.mapping import MAPPINGS
from rover_iface.simulator.faults import FAULTS
from rover_iface.simulator.world import WORLDS
from rover_iface.terrain.load import TERRAINS
from rover_iface.terrain.rocks import ROCKS

FORMATS = Path(__file__).parents[2] / "docs/formats"


CODECS: list[Codec[Any]] = [
    DAYS, PROFILES, FAULTS, WORLDS, TERRAINS, ROCKS, PROBLEMS, SURE_DRIVES, TREES, CALIBRATIONS, MAPPINGS,
    SOL_SERIES, FLIGHT_MAP,
]  # fmt: skip


@pytest.mark.parametrize("codec", CODECS, ids=lambda codec: str(codec.format))
def test_a_published_schema_is_that_of_its_codec(codec: Codec[Any]) -> None:
    path = FORMATS / f"{codec.format.replace('/', '-')}.schema.json"
    text = json.dumps(codec.schema(), indent=2) + "\n"
    if os.environ.get("OUTCROP_WRITE_SCHEMAS") == "1":
        path.write_text(text, encoding="utf-8")
    assert path.read_text(encoding="utf-8") == text
