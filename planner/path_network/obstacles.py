"""What the rover must keep out of: checked keep-outs, hazards found in the heights, clearance round both."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry import LinearRing, Polygon
from shapely.geometry.base import BaseGeometry

from mission import TerrainGrid
from planner.errors import NetworkError
from planner.path_network.values import (
    START,
    FloatArray,
    KeepOut,
    NetworkOptions,
    NetworkRequest,
    Pose,
    RoverParameters,
)

_ARC = 3  # segments to a quarter circle of clearance
_SLIVER_M = 1e-4  # corners nearer than this to a straight edge only slow the search down
# One chord of a GEOS arc spans up to one and a half steps, and a concave outline may lose 1 % of the
# distance; this factor keeps the chords outside the true circle all the same.
_ROUND_UP = 1.015 / math.cos(0.75 * math.pi / (2 * _ARC))


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
    """

    hard: tuple[Polygon, ...]
    names: tuple[str, ...]
    blocked: BaseGeometry
    hazards: tuple[Polygon, ...]


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
    for polygon, keep_out in zip(polygons, request.keep_outs, strict=True):
        if _strictly_in(polygon, request.start.east_m, request.start.north_m):
            raise NetworkError(
                f"start ({request.start.east_m:g}, {request.start.north_m:g}) lies inside keep-out "
                f"{keep_out.id}"
            )
        for target in request.targets:
            if _strictly_in(polygon, target.east_m, target.north_m):
                raise NetworkError(
                    f"target {target.id} ({target.east_m:g}, {target.north_m:g}) lies inside keep-out "
                    f"{keep_out.id}"
                )
    return polygons


def map_bounds(request: NetworkRequest) -> tuple[float, float, float, float] | None:
    """Return west, south, east and north of the map, or None when it has no edge."""
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
        corners = [(float(e), float(n)) for e, n in keep_out.vertices]
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


# --------------------------------------------------------------------------- hazards in the heights


def hazard_polygons(grid: TerrainGrid, rover: RoverParameters, options: NetworkOptions) -> list[Polygon]:
    """Return outlines of ground that is too steep, has too high a step or is unknown.

    Heights are averaged to cells of at least `terrain_cell_m`; the slope of a cell is that of the plane
    through its surroundings of the rover's size, the step is what the heights in the cell's 3x3 (or finer)
    neighbourhood span beyond that slope.
    """
    from scipy import ndimage

    heights = np.asarray(grid.heights_m, dtype=np.float64)
    known = np.isfinite(heights)
    if not known.all():
        nearest = ndimage.distance_transform_edt(~known, return_distances=False, return_indices=True)
        heights = heights[tuple(nearest)]
    block = max(1, round(options.terrain_cell_m / grid.spacing_m))
    rows, columns = heights.shape[0] // block, heights.shape[1] // block
    if min(rows, columns) < 3:
        block, rows, columns = 1, *heights.shape
    cut = heights[: rows * block, : columns * block].reshape(rows, block, columns, block)
    mean = cut.mean(axis=(1, 3))
    cell = grid.spacing_m * block
    width = max(3, 2 * round(max(rover.clearance_m, cell) / cell) + 1)
    smooth = ndimage.uniform_filter(mean, width, mode="nearest")
    north, east = np.gradient(smooth, cell)
    slope = np.hypot(east, north)
    if block >= 2:
        span = cut.max(axis=(1, 3)) - cut.min(axis=(1, 3))
        reach = cell
    else:
        span = ndimage.maximum_filter(mean, 3) - ndimage.minimum_filter(mean, 3)
        reach = 2 * cell
    step = span - slope * reach * math.sqrt(2.0)
    bad = (slope > math.tan(rover.maximum_slope_rad)) | (step > rover.maximum_step_m)
    if options.unknown_is_hazard and not known.all():
        dark = ~known[: rows * block, : columns * block].reshape(rows, block, columns, block).all(axis=(1, 3))
        hole = max(1, round(rover.clearance_m / cell))
        bad |= ndimage.binary_opening(dark, np.ones((hole + 1, hole + 1), dtype=bool))
    if not bad.any():
        return []
    west = grid.origin_east_m - grid.spacing_m / 2
    top = grid.origin_north_m + grid.spacing_m / 2
    edges = np.diff(np.pad(bad.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    begin_row, begin = np.nonzero(edges == 1)
    _, end = np.nonzero(edges == -1)
    boxes = shapely.box(
        west + begin * cell, top - (begin_row + 1) * cell, west + end * cell, top - begin_row * cell
    )
    united = shapely.union_all(boxes)
    return [g for g in shapely.get_parts(united).tolist() if isinstance(g, Polygon)]


# --------------------------------------------------------------------------- clearance


def build_obstacles(request: NetworkRequest, keep_outs: tuple[Polygon, ...]) -> tuple[Obstacles, list[str]]:
    """Return all obstacles with their clearance, and notes on what had to be bent.

    A place nearer to an obstacle than the clearance stays reachable: within one clearance of the place that
    obstacle's margin shrinks to nine tenths of the place's own distance. So adding an obstacle never opens
    a way, and a route never enters an obstacle.
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
        return Obstacles((), (), Polygon(), ()), notes
    tolerance = 0.0
    places = [request.start, *(p.pose for p in request.observation_points)]
    spots = shapely.points([(p.east_m, p.north_m) for p in places])
    while True:
        blocked = _with_clearance(hard, len(keep_outs), spots, rover.clearance_m, tolerance)
        corners = int(shapely.get_num_coordinates(blocked))
        if corners <= 2 * options.maximum_corners or tolerance > 4.0:
            break
        tolerance = max(0.1, 2 * tolerance)
    if tolerance:
        notes.append(f"hazards were simplified outward by up to {tolerance:g} m")
    return Obstacles(tuple(hard), names, blocked, tuple(hazards)), notes


def _with_clearance(
    hard: tuple[Polygon, ...], exact: int, spots: np.ndarray, clearance_m: float, tolerance_m: float
) -> BaseGeometry:
    """Return the union of all obstacles with margins; those from `exact` on may be simplified outward."""
    bodies = np.array(hard, dtype=object)
    margin = clearance_m * _ROUND_UP + 2 * _SLIVER_M
    grown = shapely.buffer(bodies, margin, quad_segs=_ARC)
    if tolerance_m > 0 and exact < len(hard):
        rough = shapely.union_all(shapely.buffer(bodies[exact:], margin + tolerance_m, quad_segs=1))
        parts = shapely.get_parts(shapely.simplify(rough, tolerance_m))
        parts = np.array(
            [Polygon(p.exterior, [r for r in p.interiors if Polygon(r).area > 4.0]) for p in parts]
        )
        grown = np.concatenate([grown[:exact], parts])
        bodies = np.concatenate([bodies[:exact], [shapely.union_all(bodies[exact:])] * len(parts)])
    for i, body in enumerate(bodies):
        away = shapely.distance(body, spots)
        near = np.nonzero((away > 0) & shapely.intersects(grown[i], spots))[0]
        if not near.size:
            continue
        shape = grown[i]
        for j in near:
            reach = max(clearance_m, 1.05 * tolerance_m)
            disc = shapely.buffer(spots[j], reach, quad_segs=4)
            nearby = body.intersection(shapely.buffer(spots[j], reach + 1.5 * clearance_m, quad_segs=4))
            tight = shapely.buffer(nearby, 0.9 * min(float(away[j]), clearance_m), quad_segs=_ARC)
            shape = shape.difference(disc.difference(tight))
        grown[i] = shape
    united = shapely.union_all(grown)
    return shapely.simplify(united, _SLIVER_M)


def place_reason(obstacles: Obstacles, east_m: float, north_m: float) -> str | None:
    """Return why the rover cannot stand at a point, or None where it can."""
    for polygon, name in zip(obstacles.hard, obstacles.names, strict=True):
        if _strictly_in(polygon, east_m, north_m):
            return f"it lies inside {name}"
    return None


def outlines(geometry: BaseGeometry) -> tuple[tuple[tuple[float, float], ...], ...]:
    """Return the rings of a geometry as tuples of points: each outline, followed by its holes."""
    rings: list[tuple[tuple[float, float], ...]] = []
    for part in shapely.get_parts(geometry).tolist():
        if isinstance(part, Polygon) and not part.is_empty:
            for ring in (part.exterior, *part.interiors):
                rings.append(tuple((float(e), float(n)) for e, n in np.asarray(ring.coords)))
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
