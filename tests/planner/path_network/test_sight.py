"""Segments that discs close are closed by the exact geometry too, and nearly all that it closes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from planner.errors import NetworkError
from planner.path_network import KeepOut, NetworkOptions, Target, build_network
from planner.path_network.obstacles import build_obstacles, clear_of
from planner.path_network.sight import Discs
from planner.path_network.visibility_graph import _numbered
from tests.planner.path_network.worlds import random_world, rocky_world


@pytest.mark.parametrize("outward_m", [0.0, 0.02, 0.05])
@pytest.mark.parametrize("seed", range(3))
def test_what_discs_close_is_closed_and_little_else_is(seed: int, outward_m: float) -> None:
    corners = 500 if outward_m == 0.0 else 8
    options = NetworkOptions(maximum_corners=corners, outward_m=outward_m or 0.02)
    world = rocky_world(seed, rocks=40, points=0, size_m=60.0)
    obstacles, _ = build_obstacles(world, ())
    blocked = build_obstacles(replace(world, options=options), ())[0].blocked
    rng = np.random.default_rng(seed)
    ends = rng.uniform(-5.0, 65.0, (2, 4000, 2))  # some leave the ground where discs are
    ends[1, :500] = ends[0, :500] + rng.normal(0.0, 0.3, (500, 2))
    ends[1, 500:600] = ends[0, 500:600]  # of no length
    ends[1, 600:900, 0] = ends[0, 600:900, 0]  # along a column of cells
    ends[1, 900:1200, 1] = ends[0, 900:1200, 1]
    closed = obstacles.discs.close(ends[0], ends[1])
    hit = ~clear_of(blocked, shapely.linestrings(np.stack([ends[0], ends[1]], axis=1)))
    assert not (closed & ~hit).any()
    assert closed.sum() > 0.8 * hit.sum()


def test_without_a_clearance_no_segment_is_closed() -> None:
    bodies = [shapely.box(0.0, 0.0, 1.0, 1.0)]
    ends = np.array([[[-1.0, 0.5], [2.0, 0.5]]])
    assert not Discs(bodies, 0.0).close(ends[:, 0], ends[:, 1]).any()
    assert Discs(bodies, 0.6).close(ends[:, 0], ends[:, 1]).all()
    assert not Discs([], 0.6).close(ends[:, 0], ends[:, 1]).any()


def test_points_are_numbered_as_the_nodes_that_they_are_and_then_as_they_come() -> None:
    nodes = np.array([[0.0, 0.0], [5.0, 1.0], [2.0, 2.0]])
    points = np.array([[9.0, 9.0], [2.0, 2.0], [-1.0, 0.0], [9.0, 9.0], [0.0, -0.0]])
    number, more = _numbered(nodes, points)
    assert number.tolist() == [3, 2, 4, 3, 0]
    assert more.tolist() == [[9.0, 9.0], [-1.0, 0.0]]


def test_a_keep_out_that_a_target_lies_in_is_named_as_the_first() -> None:
    world = random_world(3)
    box = [(-2.0, -2.0), (32.0, -2.0), (32.0, 32.0), (-2.0, 32.0)]
    inside = replace(world, keep_outs=(*world.keep_outs, KeepOut("big", box), KeepOut("bigger", box)))
    with pytest.raises(NetworkError, match=r"^start \(15, 15\) lies inside keep-out big$"):
        build_network(inside)
    small = KeepOut("small", [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
    aim = Target("inner", 0.5, 0.5)
    with pytest.raises(NetworkError, match=r"^target inner \(0.5, 0.5\) lies inside keep-out small$"):
        build_network(replace(world, targets=(*world.targets, aim), keep_outs=(*world.keep_outs, small)))
