"""Join the steps: obstacles, visibility, consolidation, tracking, costs."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from mission import Pose, TerrainGrid
from planner.path_network.consolidation import greedy_spanner
from planner.path_network.day_factor import kinds_of_days
from planner.path_network.drive_rules import check_rules, draw_ways
from planner.path_network.obstacles import build_obstacles, check_request, map_bounds, outlines, place_reason
from planner.path_network.shortest_routes import ShortestRoutes
from planner.path_network.tracking import filled, loss_exposure, sample, tracking_regions
from planner.path_network.values import (
    START,
    FloatArray,
    IntArray,
    MissingRoute,
    NetworkRequest,
    PathNetwork,
    Route,
    Segment,
    UnreachablePoint,
)
from planner.path_network.visibility_graph import build_visibility_graph

_CLIMB_STEP_M = 0.5
"""Spacing at which climbs along a segment are summed. By hand: two posts of a 0.25 m grid."""


def build_network(request: NetworkRequest) -> PathNetwork:
    """Return the path network of a request.

    Raises
    ------
    NetworkError
        If a value of the request is wrong; the message names it, its value and the limit. Observation
        points that cannot be reached are not errors: they are in `PathNetwork.unreachable`.
    """
    keep_outs = check_request(request)
    check_rules(request)
    obstacles, notes = build_obstacles(request, keep_outs)
    places: dict[str, Pose] = {START: request.start} | {p.id: p.pose for p in request.observation_points}
    target_of = {p.id: p.target for p in request.observation_points}
    no_stand = {
        name: reason
        for name, pose in places.items()
        if name != START and (reason := place_reason(obstacles, pose.east_m, pose.north_m)) is not None
    }
    standing = [name for name in places if name not in no_stand]
    number = {name: i for i, name in enumerate(standing)}
    spots = np.array([(places[s].east_m, places[s].north_m) for s in standing])

    graph = build_visibility_graph(spots, obstacles, map_bounds(request), request.options.all_pairs)
    stops = np.arange(len(standing), dtype=np.int64)
    # A hair for each segment makes the way with the fewest bends win among equals.
    shortest_ways = ShortestRoutes(graph.owner, graph.edges, graph.length_m + 1e-9, stops)
    distance = shortest_ways.distance
    used = _used_edges(graph.edges, shortest_ways, len(standing))
    kept = used & ~graph.shared()
    shared = np.flatnonzero(used & graph.shared())
    kept[shared] = greedy_spanner(
        graph.xy, graph.edges[shared], graph.length_m[shared], request.options.stretch
    )
    edges, length_m = graph.edges[kept], graph.length_m[kept]
    ways = ShortestRoutes(graph.owner, edges, length_m + 1e-9, stops)
    connected = np.isfinite(distance)

    drawn = draw_ways(request, (graph.xy, edges, length_m), number, target_of, obstacles)
    links = _links(request, drawn.xy, drawn.edges, drawn.length_m)
    tracked = [t.id for t in request.targets if t.tracked]
    column = {name: k for k, name in enumerate(tracked)}
    routes: list[Route] = []
    missing: list[MissingRoute] = []
    shortest: dict[tuple[str, str], float] = {}
    for destination in places:
        for origin in places:
            if origin == destination:
                continue
            reason = no_stand.get(destination) or no_stand.get(origin)
            if reason is not None:
                who = destination if destination in no_stand else origin
                missing.append(MissingRoute(origin, destination, f"{who}: {reason}"))
                continue
            if (refusal := drawn.refused.get((origin, destination))) is not None:
                missing.append(MissingRoute(origin, destination, refusal))
                continue
            a, b = number[origin], number[destination]
            by_hand = drawn.ways.get((origin, destination))
            if by_hand is None and not connected[a, b]:
                missing.append(MissingRoute(origin, destination, "obstacles close every path between them"))
                continue
            own = column.get(target_of.get(destination, ""))
            nodes = by_hand or ways.route(a, b)
            route = _route(request, links, drawn.xy, nodes, places[origin], places[destination], tracked)
            if by_hand is None and own is not None and route[1][own] > request.options.maximum_loss:
                nodes = _safest(links, graph.owner, len(edges), (a, b), own)
                route = _route(request, links, drawn.xy, nodes, places[origin], places[destination], tracked)
            if own is not None and route[1][own] > request.options.maximum_loss:
                missing.append(
                    MissingRoute(
                        origin,
                        destination,
                        f"every path loses the track of {target_of[destination]} with a chance of at least "
                        f"{route[1][own]:.2f} (limit {request.options.maximum_loss:g})",
                    )
                )
                continue
            costs, loss, path = route
            if own is not None:
                loss[own] = 1.0 - (1.0 - loss[own]) * math.exp(-request.calibration.arrival_rate)
            shortest[origin, destination] = float(graph_length(distance[a, b]))
            routes.append(
                Route(
                    origin,
                    destination,
                    tuple((float(e), float(n)) for e, n in drawn.xy[nodes]),
                    **costs,
                    p_lose=dict(zip(tracked, loss.tolist(), strict=True)),
                    segments=tuple(path),
                    p_fail=-math.expm1(-request.calibration.fail_per_m * costs["length_m"]),
                )
            )
    order = {name: i for i, name in enumerate(places)}
    routes.sort(key=lambda r: (order[r.origin], order[r.destination]))
    missing.sort(key=lambda r: (order[r.origin], order[r.destination]))
    segments, renumbered = _segments(routes, links, drawn.xy, tracked)
    reached = {r.destination for r in routes if r.origin == START}
    why = {m.destination: m.reason for m in missing if m.origin == START}
    unreachable = tuple(
        UnreachablePoint(p.id, p.target, no_stand.get(p.id) or why[p.id])
        for p in request.observation_points
        if p.id not in reached
    )
    return PathNetwork(
        places=places,
        routes=renumbered,
        missing=tuple(missing),
        unreachable=unreachable,
        segments=segments,
        regions=tracking_regions(request),
        hazards=tuple(ring for h in obstacles.hazards for ring in outlines(h)),
        margins=outlines(obstacles.blocked),
        shortest_m=shortest,
        track_overhead_s=request.track_overhead_s,
        hotel_w=request.rover.hotel_w,
        notes=tuple(notes),
        target_of=target_of,
        sol_kinds=kinds_of_days(request.calibration.day_time_sd, request.calibration.day_energy_sd),
    )


def graph_length(distance_m: float) -> float:
    """Return a Dijkstra distance without the hairs added per segment, to a micrometre."""
    return round(distance_m, 6)


@dataclass(frozen=True, slots=True)
class _Links:
    """Segments that routes are made of, with what each does to time, climb and tracks."""

    edges: IntArray
    length_m: FloatArray
    rise_m: FloatArray  # (edges, 2): driving from the lower to the higher node, and back
    hazard: FloatArray  # (edges, tracked): minus the log of the chance to keep the track
    index: dict[tuple[int, int], int]


def _links(request: NetworkRequest, xy: FloatArray, edges: IntArray, length_m: FloatArray) -> _Links:
    a, b = xy[edges[:, 0]], xy[edges[:, 1]]
    exposure = loss_exposure(request, a, b, request.terrain)
    model = request.calibration
    rates = np.array([model.inside_per_m, model.outside_per_m, model.occluded_per_m])
    rise = np.zeros((len(edges), 2))
    if request.terrain is not None:
        rise = _rises(request.terrain, a, b, length_m)
    index = {(int(u), int(v)): i for i, (u, v) in enumerate(edges)}
    return _Links(edges, length_m, rise, exposure @ rates, index)


def _rises(terrain: TerrainGrid, a: FloatArray, b: FloatArray, length_m: FloatArray) -> FloatArray:
    grid = filled(terrain)
    parts = np.maximum(1, np.ceil(length_m / _CLIMB_STEP_M).astype(int))
    begin = np.concatenate([[0], np.cumsum(parts + 1)])
    owner = np.repeat(np.arange(len(parts)), parts + 1)
    share = (np.arange(begin[-1]) - begin[owner]) / parts[owner]
    heights = sample(terrain, grid, a[owner] + share[:, None] * (b - a)[owner])
    step = np.diff(heights)
    step[begin[1:-1] - 1] = 0.0  # between the end of one segment and the begin of the next
    of = owner[:-1]
    up = np.bincount(of, np.maximum(step, 0.0), minlength=len(parts))
    down = np.bincount(of, np.maximum(-step, 0.0), minlength=len(parts))
    return np.stack([up, down], axis=1)


def _used_edges(edges: IntArray, routes: ShortestRoutes, places: int) -> npt.NDArray[np.bool_]:
    """Return which edges some shortest route between two places takes."""
    nodes = int(edges.max(initial=0)) + 1
    pairs: set[int] = set()
    for source in range(places):
        for destination in range(source + 1, places):
            if np.isfinite(routes.distance[source, destination]):
                passed = routes.route(source, destination)
                pairs.update(min(u, v) * nodes + max(u, v) for u, v in pairwise(passed))
    return np.isin(edges[:, 0] * nodes + edges[:, 1], list(pairs))


def _route(
    request: NetworkRequest,
    links: _Links,
    xy: FloatArray,
    nodes: list[int],
    origin: Pose,
    destination: Pose,
    tracked: list[str],
) -> tuple[dict[str, float], FloatArray, list[int]]:
    rover, model = request.rover, request.calibration
    path = [links.index[min(u, v), max(u, v)] for u, v in pairwise(nodes)]
    length = float(links.length_m[path].sum())
    climb = sum(
        float(links.rise_m[e, 0 if u < v else 1]) for e, (u, v) in zip(path, pairwise(nodes), strict=True)
    )
    turn, heading = 0.0, origin.heading_rad
    for u, v in pairwise(nodes):
        east, north = xy[v] - xy[u]
        if math.hypot(east, north) < 1e-6:
            continue
        onward = math.atan2(north, east)
        turn += abs(_wrap(onward - heading))
        heading = onward
    turn += abs(_wrap(destination.heading_rad - heading))
    uphill = climb / length if length > 1e-9 else 0.0
    mean_s = (
        model.fixed_s
        + model.drive_factor * length / rover.speed_m_s * (1.0 + model.slope_gain * uphill)
        + model.turn_factor * turn / rover.turn_rate_rad_s
    )
    mean_j = model.fixed_j + model.energy_factor * rover.drive_power_w * mean_s
    mean_j += rover.mass_kg * rover.gravity_m_s2 * climb / rover.climb_efficiency
    costs = {
        "length_m": length,
        "turn_rad": turn,
        "climb_m": climb,
        "duration_mean_s": mean_s,
        "duration_sd_s": model.duration_cv * mean_s,
        "energy_mean_j": mean_j,
        "energy_sd_j": model.energy_cv * mean_j,
    }
    loss = -np.expm1(-links.hazard[path].sum(axis=0)) if path else np.zeros(len(tracked))
    return costs, loss, path


def _wrap(angle: float) -> float:
    return (angle + math.pi) % (2 * math.pi) - math.pi


def _safest(links: _Links, owner: IntArray, count: int, ends: tuple[int, int], own: int) -> list[int]:
    """Return the route on the network's own segments that keeps one track best; length decides near ties.

    The segments behind the first `count` were drawn by hand, for one drive each.
    """
    weight = links.hazard[:count, own] + 1e-3 * links.length_m[:count] + 1e-9
    places = np.array(ends, dtype=np.int64)
    return ShortestRoutes(owner, links.edges[:count], weight, places).route(*ends)


def _segments(
    routes: list[Route], links: _Links, xy: FloatArray, tracked: list[str]
) -> tuple[tuple[Segment, ...], tuple[Route, ...]]:
    """Return the segments that remain in use, and the routes with their indices."""
    count = Counter(e for r in routes for e in r.segments)
    order = sorted(count)
    new = {e: i for i, e in enumerate(order)}
    loss = -np.expm1(-links.hazard)
    segments = tuple(
        Segment(
            (float(xy[u, 0]), float(xy[u, 1])),
            (float(xy[v, 0]), float(xy[v, 1])),
            float(links.length_m[e]),
            dict(zip(tracked, loss[e].tolist(), strict=True)),
            count[e],
        )
        for e in order
        for u, v in [links.edges[e]]
    )
    moved = tuple(_renumbered(r, tuple(new[e] for e in r.segments)) for r in routes)
    return segments, moved


def _renumbered(route: Route, segments: tuple[int, ...]) -> Route:
    return replace(route, segments=segments)
