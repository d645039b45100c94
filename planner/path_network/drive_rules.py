"""Drives that people take out of the network or draw themselves."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely

from planner.errors import NetworkError
from planner.path_network.obstacles import Obstacles
from planner.path_network.values import START, FloatArray, IntArray, NetworkRequest, Point

FORBIDDEN = "the drive was taken out by hand"


def check_rules(request: NetworkRequest) -> None:
    """Raise NetworkError unless each rule is about two places of the request that no other rule is about."""
    known = {START, *(t.id for t in request.targets)}
    seen: set[frozenset[str]] = set()
    for rule in request.drive_rules:
        name = f"rule for the drive {rule.first} - {rule.second}"
        for place in (rule.first, rule.second):
            if place not in known:
                raise NetworkError(f"{name}: target {place!r} is not given")
        pair = frozenset((rule.first, rule.second))
        if len(pair) == 1:
            raise NetworkError(f"{name}: both ends are the same")
        if pair in seen:
            raise NetworkError(f"{name}: there is another one for the same drive")
        if not all(math.isfinite(c) for point in rule.via or () for c in point):
            raise NetworkError(f"{name}: a corner of the path is not a finite number")
        seen.add(pair)


@dataclass(frozen=True, slots=True)
class DrawnWays:
    """The graph with the ways that people drew, and what the rules say of each pair of places.

    Parameters
    ----------
    xy, edges, length_m
        Of the graph, with the drawn corners and pieces behind its own.
    ways
        Nodes of a drawn path, from each of its ends to the other.
    refused
        Pairs without a drive, and why.
    """

    xy: FloatArray
    edges: IntArray
    length_m: FloatArray
    ways: Mapping[tuple[str, str], list[int]]
    refused: Mapping[tuple[str, str], str]


def draw_ways(
    request: NetworkRequest,
    graph: tuple[FloatArray, IntArray, FloatArray],
    number: Mapping[str, int],
    target_of: Mapping[str, str],
    obstacles: Obstacles,
) -> DrawnWays:
    """Return the graph (nodes, edges, lengths) with the drives of the request's rules.

    A drawn path keeps the clearance that every path keeps; one that does not is refused, it is never driven.
    `number` is the node of each place, `target_of` the target of each observation point.

    `graph` is nodes [n, 2], site frame, m; edges [m, 2], node numbers; lengths [m], m.
    """
    xy, edges, length_m = graph
    points = [xy]
    pairs: list[tuple[int, int]] = []
    known = {(int(u), int(v)) for u, v in edges}
    count = len(xy)
    ways: dict[tuple[str, str], list[int]] = {}
    refused: dict[tuple[str, str], str] = {}
    for rule in request.drive_rules:
        ends = [[p for p in number if target_of.get(p, p) == place] for place in (rule.first, rule.second)]
        for a in ends[0]:
            for b in ends[1]:
                if rule.via is None:
                    refused[a, b] = refused[b, a] = FORBIDDEN
                    continue
                if (reason := _blocked(obstacles, [xy[number[a]], *rule.via, xy[number[b]]])) is not None:
                    refused[a, b] = refused[b, a] = reason
                    continue
                nodes = [number[a], *range(count, count + len(rule.via)), number[b]]
                count += len(rule.via)
                if rule.via:
                    points.append(np.array(rule.via, dtype=np.float64))
                ways[a, b], ways[b, a] = nodes, nodes[::-1]
                for u, v in pairwise(nodes):
                    pair = (min(u, v), max(u, v))
                    if pair not in known:
                        known.add(pair)
                        pairs.append(pair)
    xy = np.concatenate(points)
    if pairs:
        added = np.array(pairs, dtype=np.int64)
        edges = np.concatenate([edges, added])
        length_m = np.concatenate([length_m, np.hypot(*(xy[added[:, 0]] - xy[added[:, 1]]).T)])
    return DrawnWays(xy, edges, length_m, ways, refused)


def _blocked(obstacles: Obstacles, corners: Sequence[Point | FloatArray]) -> str | None:
    """Return why a way cannot be driven, naming what it comes too near to; None where it can."""
    line = np.asarray(corners, dtype=np.float64)
    pieces = np.asarray(shapely.linestrings(np.stack([line[:-1], line[1:]], axis=1)))
    ends = (np.broadcast_to(end, (len(pieces), 2)) for end in (line[0], line[-1]))
    if bool(obstacles.free(pieces, *ends).all()):
        return None
    whole = shapely.linestrings(line)
    near = min(zip(obstacles.hard, obstacles.names, strict=True), key=lambda p: shapely.distance(p[0], whole))
    return f"the path drawn by hand comes too near to {near[1]}"
