"""What the rover must keep out of: checked keep-outs, hazards found in the heights, clearance round both."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry import LinearRing, Polygon
from shapely.geometry.base import BaseGeometry

from mission import KeepOut, Pose, TerrainGrid
from planner.errors import NetworkError
from planner.path_network.hazards import hazard_polygons
from planner.path_network.sight import Outline
from planner.path_network.values import (
    START,
    FloatArray,
    IntArray,
    NetworkRequest,
)

Bodies = npt.NDArray[np.object_]
"""Geometry of shapely's, site frame, m."""

_ARC, _FEW_ARC, _FINE_ARC = 4, 3, 8
"""Segments to a quarter circle of clearance: where there are few outlines, where they are made simpler, and
of obstacles beside a gap that is hardly wide enough.
"""
_SHRINK_M = 1e-6  # a segment along an obstacle's edge is free, one through its inside is not
_HAIR_M = 1e-5  # a segment along an opening's edge is free
_SLIVER_M = 1e-4  # corners nearer than this to a straight edge only slow the search down


@dataclass(frozen=True, slots=True)
class Obstacles:
    """Polygons in site metres.

    Parameters
    ----------
    hard
        Keep-outs and hazards themselves, one polygon each.
    names
        What each of them is, for messages.
    blocked
        All of them with the clearance, united; routes stay outside or on its edge.
    hazards
        The part of `hard` that was found in the heights.
    openings
        Ground inside `blocked` that the drives to and from a place (east, north) may use.
    outline
        Of `blocked`: stops many segments quickly.
    """

    hard: tuple[Polygon, ...]
    names: tuple[str, ...]
    blocked: BaseGeometry
    hazards: tuple[Polygon, ...]
    openings: Mapping[tuple[float, float], BaseGeometry]
    outline: Outline

    def free(self, lines: Bodies, *places: FloatArray) -> npt.NDArray[np.bool_]:
        """Return which straight lines [n] (shapely, site frame, m) may be driven on the way to or from these
        places, each [n, 2], one for each line.
        """
        left = lines.copy()
        known = np.array([*self.openings], dtype=np.float64).reshape(-1, 2)
        ground = np.array([*self.openings.values()], dtype=object)
        ground = shapely.buffer(ground, _HAIR_M, quad_segs=1)
        for place in places:
            line, opening = np.nonzero((place[:, None] == known).all(axis=2))
            left[line] = shapely.difference(left[line], ground[opening])
        return clear_of(self.blocked, left)


def check_request(request: NetworkRequest) -> tuple[Polygon, ...]:
    """Return the keep-outs as polygons after checking every value of the request.

    Raises
    ------
    NetworkError
        Naming the thing that is wrong, its value and the limit.
    """
    _check_pose("start", request.start)
    bounds = map_bounds(request)
    targets: set[str] = set()
    for target in request.targets:
        if target.id in targets:
            raise NetworkError(f"target {target.id} is given twice")
        targets.add(target.id)
        _check_numbers(f"target {target.id}", target.east_m, target.north_m)
        if target.height_m is not None:
            _check_numbers(f"height of target {target.id}", target.height_m)
        if target.first_seen is not None:
            _check_numbers(f"first_seen of target {target.id}", *target.first_seen)
        _check_inside(f"target {target.id}", target.east_m, target.north_m, bounds)
    _check_inside("start", request.start.east_m, request.start.north_m, bounds)
    points: set[str] = {START}
    for point in request.observation_points:
        if point.id in points:
            raise NetworkError(
                f"observation point {point.id!r} is given twice"
                if point.id != START
                else f"an observation point may not be called {START!r}"
            )
        points.add(point.id)
        if point.target not in targets:
            raise NetworkError(
                f"observation point {point.id} belongs to target {point.target!r}, which is not given"
            )
        _check_pose(f"observation point {point.id}", point.pose)
        _check_inside(f"observation point {point.id}", point.pose.east_m, point.pose.north_m, bounds)
    polygons = tuple(_polygon(k) for k in request.keep_outs)
    things = [("start", request.start.east_m, request.start.north_m)]
    things += [(f"target {t.id}", t.east_m, t.north_m) for t in request.targets]
    spots = shapely.points([(east, north) for _, east, north in things])
    met = shapely.STRtree(polygons).query(spots, predicate="within").T
    for thing, keep_out in sorted(met.tolist(), key=lambda pair: pair[::-1]):
        name, east, north = things[thing]
        if _strictly_in(polygons[keep_out], east, north):
            raise NetworkError(
                f"{name} ({east:g}, {north:g}) lies inside keep-out {request.keep_outs[keep_out].id}"
            )
    return polygons


def map_bounds(request: NetworkRequest) -> tuple[float, float, float, float] | None:
    """Return west, south, east and north of the map, m, or None when it has no edge."""
    if request.bounds_m is not None:
        west, south, east, north = request.bounds_m
        _check_numbers("bounds_m", west, south, east, north)
        if west >= east or south >= north:
            raise NetworkError(f"bounds_m is {request.bounds_m}; west < east and south < north are needed")
        return request.bounds_m
    if request.terrain is not None:
        _check_grid(request.terrain)
        return request.terrain.bounds_m
    return None


def _check_grid(grid: TerrainGrid) -> None:
    heights = np.asarray(grid.heights_m)
    if heights.ndim != 2 or min(heights.shape) < 3:
        raise NetworkError(f"heights_m has shape {heights.shape}; two dimensions of at least 3 are needed")
    if not grid.spacing_m > 0 or not math.isfinite(grid.spacing_m):
        raise NetworkError(f"spacing_m of the height grid is {grid.spacing_m}; it must be > 0")
    _check_numbers("origin of the height grid", grid.origin_east_m, grid.origin_north_m)
    if np.isinf(heights).any():
        raise NetworkError("heights_m holds an infinite height")
    if np.isnan(heights).all():
        raise NetworkError("heights_m holds no height at all, only NaN")


def _check_numbers(name: str, *values: float) -> None:
    for value in values:
        if not math.isfinite(value):
            raise NetworkError(f"{name} holds {value!r}; a finite number is needed")


def _check_pose(name: str, pose: Pose) -> None:
    _check_numbers(name, pose.east_m, pose.north_m, pose.heading_rad)


def _check_inside(
    name: str, east_m: float, north_m: float, bounds: tuple[float, float, float, float] | None
) -> None:
    if bounds is None:
        return
    west, south, east, north = bounds
    if not (west <= east_m <= east and south <= north_m <= north):
        raise NetworkError(
            f"{name} ({east_m:g}, {north_m:g}) is off the map, which reaches from ({west:g}, {south:g}) "
            f"to ({east:g}, {north:g})"
        )


def _polygon(keep_out: KeepOut) -> Polygon:
    try:
        corners = [(float(e), float(n)) for e, n in keep_out.polygon_m]
    except (TypeError, ValueError) as err:
        raise NetworkError(f"keep-out {keep_out.id}: a corner is not a pair of numbers") from err
    for e, n in corners:
        _check_numbers(f"keep-out {keep_out.id}", e, n)
    if len(corners) > 1 and corners[0] == corners[-1]:
        corners.pop()
    if len(set(corners)) < 3:
        raise NetworkError(f"keep-out {keep_out.id} has {len(set(corners))} corners; at least 3 are needed")
    if not LinearRing(corners).is_simple:
        raise NetworkError(f"keep-out {keep_out.id} crosses itself")
    polygon = Polygon(corners)
    if not polygon.is_valid:
        raise NetworkError(f"keep-out {keep_out.id} touches itself: {shapely.is_valid_reason(polygon)}")
    if polygon.area <= 1e-9:
        raise NetworkError(f"keep-out {keep_out.id} has no area; its corners lie on a line")
    return polygon


def _strictly_in(polygon: BaseGeometry, east_m: float, north_m: float) -> bool:
    point = shapely.Point(east_m, north_m)
    return bool(polygon.contains(point)) and float(polygon.boundary.distance(point)) > 1e-9


# --------------------------------------------------------------------------- clearance


def build_obstacles(request: NetworkRequest, keep_outs: tuple[Polygon, ...]) -> tuple[Obstacles, list[str]]:
    """Return all obstacles with their clearance, and notes on what had to be bent.

    A place nearer to an obstacle than the clearance stays reachable: its own drives may use an opening in
    the margin (`_opening`), no others. So adding an obstacle never opens a way, a route never enters an
    obstacle, and keeps the clearance but for its own ends.
    """
    rover, options = request.rover, request.options
    notes: list[str] = []
    hazards: list[Polygon] = []
    if request.terrain is not None:
        _check_grid(request.terrain)
        hazards = hazard_polygons(request.terrain, rover, options)
        start = shapely.Point(request.start.east_m, request.start.north_m)
        standing = start.buffer(max(rover.clearance_m, options.terrain_cell_m) * 1.5, quad_segs=4)
        cleared: list[Polygon] = []
        for polygon in hazards:
            if polygon.contains(start):
                notes.append(
                    "the ground under the start pose counts as hazard by its heights; it is taken as safe"
                )
                rest = polygon.difference(standing)
                cleared += [g for g in shapely.get_parts(rest).tolist() if isinstance(g, Polygon)]
            else:
                cleared.append(polygon)
        hazards = cleared
    hard = (*keep_outs, *hazards)
    names = (
        *(f"keep-out {k.id}" for k in request.keep_outs),
        *("a hazard in the terrain" for _ in hazards),
    )
    if not hard:
        return Obstacles((), (), Polygon(), (), {}, Outline(Polygon())), notes
    bodies = np.array(hard, dtype=object)
    most = options.maximum_corners
    blocked: BaseGeometry = Polygon()
    few = int(shapely.get_num_coordinates(bodies).sum()) <= most  # clearance hardly leaves out a corner
    if few:
        blocked = _with_clearance(bodies, rover.clearance_m, 0.0, _ARC)
    if not few or shapely.get_num_coordinates(blocked) > most:
        blocked = _with_clearance(bodies, rover.clearance_m, options.outward_m, _FEW_ARC)
    tree = shapely.STRtree(hard)
    places = [request.start, *(p.pose for p in request.observation_points)]
    openings = {}
    for pose in places:
        opening = _opening(hard, tree, blocked, pose, rover.clearance_m)
        if opening is not None:
            openings[pose.east_m, pose.north_m] = opening
    found = Obstacles(tuple(hard), names, blocked, tuple(hazards), openings, outline_of(blocked))
    return found, notes


def _with_clearance(bodies: Bodies, clearance_m: float, outward_m: float, arc: int) -> BaseGeometry:
    """Return the union of all obstacles [n] with the clearance, its outline made simpler outward only.

    Grown by the clearance and twice `outward_m`, then simplified by that (Douglas and Peucker): what it cuts
    off lies within `outward_m` of the outline, at the vertex where a ring begins within twice that. So no
    ground within the clearance is ever opened. Obstacles beside a gap that this would close though it is
    twice the clearance wide have fine outlines of just the clearance.
    """
    grown = _grown(bodies, clearance_m + 2 * outward_m, arc)
    beside = _beside_gaps(bodies, grown, clearance_m)
    if outward_m > 0.0:
        grown = shapely.simplify(grown, outward_m)
    grown[beside] = _grown(bodies[beside], clearance_m, _FINE_ARC)
    # Most obstacles meet none or few: united group by group, 2,000 take a tenth of the time.
    return shapely.simplify(shapely.disjoint_subset_union_all(grown), _SLIVER_M)


def _grown(bodies: Bodies, away_m: float, arc: int) -> Bodies:
    """Return obstacles [n] with all ground nearer than a distance, and a hair.

    GEOS draws arcs with chords, of up to one and a half of the steps asked for, and may leave out a little
    of a concave outline. So how near an outline comes is measured, and it is drawn farther out by that.
    """
    away_m += 2 * _SLIVER_M
    margin = np.full(len(bodies), away_m / math.cos(math.pi / (4 * arc)))
    grown = np.asarray(shapely.buffer(bodies, margin, quad_segs=arc))
    while True:
        nearest = shapely.distance(bodies, shapely.boundary(grown))
        near = np.flatnonzero(nearest < away_m)
        if not len(near):
            return grown
        margin[near] *= away_m / np.maximum(nearest[near], away_m / 2) + 1e-6
        grown[near] = shapely.buffer(bodies[near], margin[near], quad_segs=arc)


def _beside_gaps(bodies: Bodies, grown: Bodies, clearance_m: float) -> IntArray:
    """Return which obstacles [n] are beside a gap of twice the clearance that they close when grown."""
    tree = shapely.STRtree(grown)
    first, second = tree.query(grown, predicate="intersects")
    pairs = first < second
    first, second = first[pairs], second[pairs]
    apart = shapely.distance(bodies[first], bodies[second]) >= 2 * clearance_m
    mouths = shapely.get_num_interior_rings(grown) > shapely.get_num_interior_rings(bodies)
    return np.unique(np.concatenate([first[apart], second[apart], np.flatnonzero(mouths)]))


def _opening(
    hard: tuple[Polygon, ...], tree: shapely.STRtree, blocked: BaseGeometry, pose: Pose, clearance_m: float
) -> BaseGeometry | None:
    """Return the ground round a place inside a margin that drives to and from it may use; None without need.

    Within one clearance of the place the margin shrinks to nine tenths of the place's own distance.
    """
    spot = shapely.Point(pose.east_m, pose.north_m)
    if clearance_m <= 0.0 or not blocked.contains(spot):
        return None
    bodies = [hard[i] for i in tree.query(spot, predicate="dwithin", distance=2.5 * clearance_m)]
    disc = spot.buffer(clearance_m, quad_segs=4)
    for body in bodies:
        away = float(body.distance(spot))
        disc = disc.difference(body.buffer(0.9 * min(away, clearance_m), quad_segs=_ARC))
    return disc


def clear_of(blocked: BaseGeometry, lines: Any) -> npt.NDArray[np.bool_]:
    """Return which straight lines (an array of shapely's) stay outside `blocked` or on its edge."""
    lines = np.asarray(lines)
    parts = shapely.get_parts(_shrunk(blocked))
    hit = np.zeros(len(lines), dtype=bool)
    shapely.prepare(parts)
    tree = shapely.STRtree(lines)
    # Large parts first: most lines fall to them and need no further test.
    for part in sorted(parts.tolist(), key=lambda g: -g.area):
        found = tree.query(part)
        found = found[~hit[found]]
        if found.size:
            hit[found] = shapely.intersects(part, lines[found])
    return ~hit


def outline_of(blocked: BaseGeometry) -> Outline:
    """Return what stops segments through the inside of blocked ground, but none along its edge."""
    return Outline(_shrunk(blocked))


def _shrunk(blocked: BaseGeometry) -> BaseGeometry:
    """Return the inside of blocked ground: a segment along its edge does not meet it."""
    return shapely.buffer(blocked, -_SHRINK_M, join_style="mitre")


def place_reason(obstacles: Obstacles, east_m: float, north_m: float) -> str | None:
    """Return why the rover cannot stand at a point, or None where it can."""
    inside = np.flatnonzero(shapely.contains_xy(np.array(obstacles.hard, dtype=object), east_m, north_m))
    for k in inside.tolist():
        if _strictly_in(obstacles.hard[k], east_m, north_m):
            return f"it lies inside {obstacles.names[k]}"
    return None


def outlines(geometry: BaseGeometry) -> tuple[tuple[tuple[float, float], ...], ...]:
    """Return the rings of a geometry as tuples of points, m: each outline, followed by its holes."""
    rings: list[tuple[tuple[float, float], ...]] = []
    for part in shapely.get_parts(geometry).tolist():
        if isinstance(part, Polygon) and not part.is_empty:
            rings += (
                tuple((float(e), float(n)) for e, n in np.asarray(ring.coords))
                for ring in (part.exterior, *part.interiors)
            )
    return tuple(rings)


def ring_corners(geometry: BaseGeometry) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return corners with the corner before and after each, shapes (m, 2), obstacle on the left hand."""
    here: list[FloatArray] = []
    before: list[FloatArray] = []
    after: list[FloatArray] = []
    for part in shapely.get_parts(geometry).tolist():
        if not isinstance(part, Polygon) or part.is_empty:
            continue
        part = shapely.orient_polygons(part)
        for ring in (part.exterior, *part.interiors):
            xy = np.asarray(ring.coords, dtype=np.float64)[:-1]
            here.append(xy)
            before.append(np.roll(xy, 1, axis=0))
            after.append(np.roll(xy, -1, axis=0))
    if not here:
        none = np.empty((0, 2))
        return none, none, none
    return np.concatenate(here), np.concatenate(before), np.concatenate(after)
