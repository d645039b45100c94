"""What a rover is told of its targets by the world that it lives in."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from rover_iface.errors import WorldError
from rover_iface.profile import load_profile
from rover_iface.simulator.true_ground import world_targets
from rover_iface.simulator.world import World
from tests.rover_iface.worlds import small_problem


def world(normal: Any) -> World:
    problem = {**small_problem(), "format": "problem/2"}
    problem["targets"][0]["normal"] = normal
    return World("small", Path(), load_profile("k9"), problem=problem)


def test_targets_of_a_problem_have_the_normals_of_their_surfaces() -> None:
    """The rover took each face to be level, so that its tool might be put aside, or not put down at all."""
    found = world_targets(world([0.6, 0.0, 0.8]))
    assert found[0].normal == pytest.approx((0.6, 0.0, 0.8))
    assert found[1].normal == (0.0, 0.0, 1.0)


@pytest.mark.parametrize("normal", [[0.0, 0.0, 0.0], [0.0, 3.0, 4.0], [float("nan"), 0.0, 1.0], "up"])
def test_what_is_no_direction_is_refused(normal: Any) -> None:
    with pytest.raises(WorldError, match="malformed member"):
        world_targets(world(normal))
