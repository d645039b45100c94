"""The path network against fine grids: drives that keep clear, that are all there, and that are short.

    python -m studies.path_network_lines [--samples 1000000] [--seed S] [--ground FOLDER ...]

Ten generated maps, 60 m to 1 km across, of rocks on height grids and of keep-outs, with 16 to 100 observation
points, and the real grounds of the folders (`../shared/data/terrain/msl_onsight/*` where that is there).
For each map:

- samples drawn along all drives lie in no hazard, and outside the last 1.2 m at either end none is nearer
  to one than the clearance of 0.6 m;
- two places have no drive where a grid of 0.25 m whose cells keep 0.35 m clear does not connect them, and
  have one where cells that keep 0.85 m clear do;
- on 20 pairs the drive is compared with the shortest way over the cells that keep 0.6 m clear, each with 32
  neighbours (Dijkstra with the straight distance as heuristic);
- the processor time of `build_network`.

Nothing was tuned on these maps.
"""

from __future__ import annotations

import argparse
import heapq
import math
import secrets
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numba
import numpy as np
import numpy.typing as npt
import shapely
from scipy import ndimage

from ground.day.prepare import network_heights
from mission import TerrainGrid
from planner.path_network import (
    KeepOut,
    NetworkRequest,
    ObservationPoint,
    PathNetwork,
    Pose,
    RoverParameters,
    Target,
    build_network,
)
from planner.path_network.hazards import hazard_polygons
from rover_iface.terrain.load import load_terrain

REAL = Path(__file__).parents[2] / "shared" / "data" / "terrain" / "msl_onsight"
APPROACH_M, CELL_M = 1.2, 0.25
TIGHT_M, WIDE_M = 0.35, 0.85
PAIRS = 20
LONGER, LIMIT_S = 0.03, 10.0
GENERATED = (
    ("rocks", 60.0, 80, 16),
    ("rocks", 110.0, 250, 24),
    ("rocks", 160.0, 600, 40),
    ("rocks", 250.0, 1_200, 60),
    ("rocks", 400.0, 1_455, 50),
    ("rocks", 1_000.0, 1_350, 100),
    ("keep-outs", 100.0, 60, 24),
    ("keep-outs", 400.0, 700, 50),
    ("keep-outs", 1_000.0, 1_000, 100),
    ("keep-outs", 1_000.0, 2_000, 100),
)
"""Kind, metres across, how many, observation points. 1,350 rocks make about 2,000 hazards: steps round them
are some of their own.
"""
REAL_POINTS = 30
NEIGHBOURS = np.array(
    [
        (a, b)
        for a in range(-3, 4)
        for b in range(-3, 4)
        if math.gcd(a, b) == 1 and (abs(a), abs(b)) not in {(3, 3)}
    ]
)
"""The 32 moves of a cell (4 straight, 4 diagonal, 8 like a knight's, 16 longer ones)."""

Labels = npt.NDArray[np.int64]
Free = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Map:
    """A request with its hazards as bodies, and its borders (west, south, east, north), m."""

    name: str
    request: NetworkRequest
    bodies: list[shapely.Polygon]
    bounds_m: tuple[float, float, float, float]

    def free(self, clearance_m: float) -> Free:
        """Return the cells [rows from the south, columns] whose middle is so far from every hazard."""
        from rasterio.features import rasterize
        from rasterio.transform import Affine

        west, south, east, north = self.bounds_m
        shape = (round((north - south) / CELL_M), round((east - west) / CELL_M))
        grown = shapely.buffer(np.array(self.bodies, dtype=object), clearance_m, quad_segs=32)
        to_map = Affine(CELL_M, 0.0, west, 0.0, CELL_M, south)
        found: Free = rasterize(grown, shape, fill=0, default_value=1, transform=to_map) == 0
        return found

    def cell(self, pose: Pose) -> tuple[int, int]:
        """Return the row and column of a pose."""
        west, south, *_ = self.bounds_m
        return int((pose.north_m - south) / CELL_M), int((pose.east_m - west) / CELL_M)

    def middle(self, cell: tuple[int, int]) -> tuple[float, float]:
        """Return the easting and northing of the middle of a cell."""
        west, south, *_ = self.bounds_m
        return west + (cell[1] + 0.5) * CELL_M, south + (cell[0] + 0.5) * CELL_M


def with_places(
    rng: np.random.Generator,
    name: str,
    request: NetworkRequest,
    bounds_m: tuple[float, float, float, float],
    points: int,
) -> Map:
    """Return the map with a start and observation points, every other one close to a hazard."""
    bodies = [shapely.Polygon(k.polygon_m) for k in request.keep_outs]
    if request.terrain is not None:
        bodies += hazard_polygons(request.terrain, request.rover, request.options)
    tree = shapely.STRtree(bodies)
    west, south, east, north = bounds_m

    def stand(least_m: float) -> tuple[float, float]:
        while True:
            at = rng.uniform((west + 3.0, south + 3.0), (east - 3.0, north - 3.0))
            if not len(tree.query(shapely.Point(*at), predicate="dwithin", distance=least_m)):
                return float(at[0]), float(at[1])

    places = [stand(0.25 if k % 2 else 0.7) for k in range(points)]
    asked = replace(
        request,
        start=Pose(*stand(0.7)),
        targets=tuple(Target(f"T{k}", *at, tracked=False) for k, at in enumerate(places)),
        observation_points=tuple(
            ObservationPoint(f"O{k}", f"T{k}", Pose(*at)) for k, at in enumerate(places)
        ),
    )
    return Map(name, asked, bodies, bounds_m)


def rocks(rng: np.random.Generator, size_m: float, count: int, spacing_m: float = 0.25) -> NetworkRequest:
    """Return a request on level ground with rocks of 0.3 to 1.5 m radius."""
    cells = int(size_m / spacing_m)
    heights = np.zeros((cells, cells))
    reach = int(1.5 / spacing_m) + 1
    for _ in range(count):
        east, north, radius = *rng.uniform(3.0, size_m - 3.0, 2), rng.uniform(0.3, 1.5)
        row, column = int(north / spacing_m), int(east / spacing_m)
        part = np.s_[max(0, row - reach) : row + reach + 1, max(0, column - reach) : column + reach + 1]
        n, e = (np.mgrid[part] + 0.5) * spacing_m
        heights[part][np.hypot(n - north, e - east) < radius] = rng.uniform(0.4, 1.0)
    grid = TerrainGrid(spacing_m / 2, size_m - spacing_m / 2, spacing_m, heights[::-1].copy())
    return NetworkRequest(Pose(0.0, 0.0), (), (), terrain=grid)


def keep_outs(rng: np.random.Generator, size_m: float, count: int) -> NetworkRequest:
    """Return a request with polygons of 3 to 8 corners, 0.4 to 5 m across, some of them overlapping."""
    found: list[KeepOut] = []
    while len(found) < count:
        angle = np.sort(rng.uniform(0, 2 * math.pi, int(rng.integers(3, 9))))
        radius = rng.uniform(0.6, 1.0, (len(angle), 1)) * rng.uniform(0.4, 2.5)
        ring = rng.uniform(3.0, size_m - 3.0, 2) + radius * np.column_stack([np.cos(angle), np.sin(angle)])
        shape = shapely.Polygon(ring)
        if shape.is_valid and shape.area > 0.1:
            found.append(KeepOut(f"K{len(found)}", ring.tolist()))
    return NetworkRequest(Pose(0.0, 0.0), (), (), tuple(found), bounds_m=(0.0, 0.0, size_m, size_m))


def maps(rng: np.random.Generator, grounds: list[Path]) -> Iterator[Map]:
    """Return the maps, one after the other."""
    for kind, size_m, count, points in GENERATED:
        request = rocks(rng, size_m, count) if kind == "rocks" else keep_outs(rng, size_m, count)
        name = f"{count} {kind}, {size_m:g} m"
        yield with_places(rng, name, request, (0.0, 0.0, size_m, size_m), points)
    for folder in grounds:
        terrain = load_terrain(folder)
        west, south, east, north = terrain.bounds
        grid = network_heights(terrain, [(west, south), (east, north)])
        request = NetworkRequest(Pose(0.0, 0.0), (), (), terrain=grid)
        yield with_places(rng, folder.name, request, grid.bounds_m, REAL_POINTS)


def nearest(network: PathNetwork, bodies: list[shapely.Polygon], count: int, rng: np.random.Generator) -> str:
    """Return what of so many samples of all drives lies in a hazard or too near to one; empty = none."""
    lines = np.array([shapely.LineString(r.points) for r in network.routes], dtype=object)
    length = shapely.length(lines)
    which = rng.choice(len(lines), count, p=length / length.sum())
    along = rng.uniform(0.0, length[which])
    points = shapely.line_interpolate_point(lines[which], along)
    tree = shapely.STRtree(bodies)
    inside, _ = tree.query(points, predicate="within")
    near, body = tree.query(points, predicate="dwithin", distance=1.0)
    far = (along[near] > APPROACH_M) & (along[near] < length[which[near]] - APPROACH_M)
    gaps = shapely.distance(points[near[far]], np.array(bodies, dtype=object)[body[far]])
    least = float(gaps.min()) if len(gaps) else math.inf
    bad = int((gaps < RoverParameters().clearance_m - 1e-6).sum())
    print(f"  {count} samples of {len(lines)} drives: {len(inside)} in a hazard, the nearest {least:.4f} m")
    return f"{len(inside)} samples in a hazard, {bad} nearer than the clearance" if len(inside) or bad else ""


def connected(ground: Map, clearance_m: float) -> Labels:
    """Return the number of the open area that each place lies in; 0 where it is in none."""
    label, _ = ndimage.label(ground.free(clearance_m), np.ones((3, 3)))
    poses = [ground.request.start, *(p.pose for p in ground.request.observation_points)]
    return np.array([label[ground.cell(pose)] for pose in poses])


def all_there(ground: Map, network: PathNetwork) -> list[str]:
    """Return the pairs that have a drive where the grid has none, or none where it has one."""
    tight, wide = connected(ground, TIGHT_M), connected(ground, WIDE_M)
    names = list(network.places)
    bad, driven = [], 0
    for i, a in enumerate(names):
        for j in range(i):
            there = network.route(a, names[j]) is not None
            driven += there
            if there and tight[i] and tight[j] and tight[i] != tight[j]:
                bad.append(f"{a} - {names[j]} is driven where no way is {TIGHT_M} m clear")
            if not there and wide[i] and wide[i] == wide[j]:
                bad.append(f"{a} - {names[j]} is not driven where a way is {WIDE_M} m clear")
    print(f"  {driven} of {len(names) * (len(names) - 1) // 2} pairs are driven")
    return bad


@numba.njit(cache=True)
def _shortest(  # pragma: no cover - compiled
    free: npt.NDArray[np.bool_],  # (rows, columns)
    moves: npt.NDArray[np.int64],  # (32, 2)
    start: tuple[int, int],
    end: tuple[int, int],
) -> float:
    """Return the length in cells of the shortest way over free cells; infinity where there is none."""
    rows, columns = free.shape
    length = np.full((rows, columns), np.inf)
    length[start] = 0.0
    away = math.hypot(end[0] - start[0], end[1] - start[1])
    heap = [(away, start[0], start[1])]
    while heap:
        told, row, column = heapq.heappop(heap)
        here = length[row, column]
        if row == end[0] and column == end[1]:
            return here
        if told > here + math.hypot(end[0] - row, end[1] - column) + 1e-9:
            continue
        for k in range(len(moves)):
            dr, dc = moves[k]
            r, c = row + dr, column + dc
            if r < 0 or c < 0 or r >= rows or c >= columns or not free[r, c]:
                continue
            clear = True
            for step in range(1, 8):  # the line passes so many eighths; no cell of it may be closed
                at = step / 8.0
                if not free[math.floor(row + 0.5 + at * dr), math.floor(column + 0.5 + at * dc)]:
                    clear = False
                    break
            if not clear:
                continue
            new = here + math.hypot(dr, dc)
            if new < length[r, c] - 1e-9:
                length[r, c] = new
                heapq.heappush(heap, (new + math.hypot(end[0] - r, end[1] - c), r, c))
    return np.inf


def lengths(ground: Map, network: PathNetwork, rng: np.random.Generator) -> list[float]:
    """Return drives' lengths over those of the grid, for pairs whose places stand clear of hazards."""
    free = ground.free(RoverParameters().clearance_m)
    poses = {"start": ground.request.start} | {p.id: p.pose for p in ground.request.observation_points}
    clear = {name for name, pose in poses.items() if free[ground.cell(pose)]}
    driven = [r for r in network.routes if r.origin in clear and r.destination in clear]
    found = []
    for k in rng.permutation(len(driven))[: 2 * PAIRS]:
        route = driven[k]
        ends = ground.cell(poses[route.origin]), ground.cell(poses[route.destination])
        cells = _shortest(free, NEIGHBOURS, *ends)
        # The grid's way is between the middles of cells, up to 0.18 m from the places.
        off = sum(
            math.dist(ground.middle(cell), (pose.east_m, pose.north_m))
            for cell, pose in zip(ends, (poses[route.origin], poses[route.destination]), strict=True)
        )
        if math.isfinite(cells):
            found.append(route.length_m / (CELL_M * cells + off))
        if len(found) == PAIRS:
            break
    return found


def main() -> None:
    """Print a line for each map; end with 1 where something does not hold."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=secrets.randbelow(2**31))
    parser.add_argument(
        "--ground", type=Path, nargs="*", default=sorted(p for p in REAL.glob("*") if p.is_dir())
    )
    asked = parser.parse_args()
    print(f"seed {asked.seed}", flush=True)
    rng = np.random.default_rng(asked.seed)
    each = math.ceil(asked.samples / (len(GENERATED) + len(asked.ground)))
    bad: list[str] = []
    build_network(with_places(rng, "", rocks(rng, 40.0, 9), (0.0, 0.0, 40.0, 40.0), 4).request)  # compiles
    for ground in maps(rng, asked.ground):
        began = time.process_time()
        network = build_network(ground.request)
        took = time.process_time() - began
        print(f"{ground.name}: {len(ground.bodies)} hazards, {took:.1f} s of processor time", flush=True)
        said = nearest(network, ground.bodies, each, rng)
        wrong = all_there(ground, network)
        ratios = lengths(ground, network, rng)
        if ratios:
            print(
                f"  {len(ratios)} drives {min(ratios):.4f} to {max(ratios):.4f} times the grid's", flush=True
            )
        found = [said] if said else []
        found += wrong[:5]
        found += [f"a drive is {r:.4f} times the grid's" for r in ratios if r > 1.0 + LONGER]
        if took > LIMIT_S:
            found.append(f"took {took:.1f} s")
        bad += [f"{ground.name}: {what}" for what in found]
    print("\n".join(bad) or "all holds")
    raise SystemExit(1 if bad else 0)


if __name__ == "__main__":
    main()
