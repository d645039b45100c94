"""Picture and timing of docs/reference/path-network.md.

    .venv/bin/python -m studies.path_network --out docs

Draws one generated world (10 targets, 9 keep-outs, a ridge too steep to drive) with its network, and times
40 targets with 30 keep-outs on a 64 m map, without and with terrain.
"""

from __future__ import annotations

import argparse
import math
import statistics
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import shapely

from mission import TerrainGrid
from planner.path_network import (
    KeepOut,
    NetworkOptions,
    NetworkRequest,
    ObservationPoint,
    PathNetwork,
    Pose,
    Target,
    build_network,
)


def world(seed: int, targets: int, keep_outs: int, size_m: float, *, terrain: bool) -> NetworkRequest:
    """Return a generated request: gentle hills, one steep ridge, keep-outs and targets at random."""
    from scipy import ndimage

    rng = np.random.default_rng(seed)
    middle = np.array([size_m / 2, size_m / 2])
    grid = None
    free = shapely.box(1, 1, size_m - 1, size_m - 1)
    if terrain:
        cells = int(size_m / 0.25)
        z = ndimage.gaussian_filter(rng.normal(size=(cells, cells)), 14)
        z *= 0.5 / z.std()
        row, column = np.mgrid[0:cells, 0:cells] * 0.25
        ridge = np.abs(column - 0.72 * size_m - 2 * np.sin(row / 4))
        z += 2.5 * np.exp(-((ridge / 1.2) ** 2)) * (row > 0.15 * size_m) * (row < 0.7 * size_m)
        grid = TerrainGrid(0.125, size_m - 0.125, 0.25, z)
    regions: list[KeepOut] = []
    solid: list[shapely.Polygon] = []
    while len(regions) < keep_outs:
        corners = int(rng.integers(4, 9))
        angle = np.sort(rng.uniform(0, 2 * math.pi, corners))
        radius = rng.uniform(0.6, 1, (corners, 1)) * rng.uniform(0.6, 2.2)
        ring = rng.uniform(2, size_m - 2, 2) + radius * np.column_stack([np.cos(angle), np.sin(angle)])
        shape = shapely.Polygon(ring)
        if shape.is_valid and shape.area > 0.4 and shape.distance(shapely.Point(*middle)) > 1.0:
            solid.append(shape)
            regions.append(KeepOut(f"K{len(regions) + 1}", ring.tolist()))
    closed = shapely.union_all(solid)
    aims: list[Target] = []
    stands: list[ObservationPoint] = []
    while len(aims) < targets:
        at = rng.uniform(2, size_m - 2, 2)
        if closed.distance(shapely.Point(*at)) < 0.8 or not free.contains(shapely.Point(*at)):
            continue
        back = middle - at
        stand = at + 0.8 * back / np.hypot(*back)
        name = f"T{len(aims) + 1}"
        aims.append(Target(name, float(at[0]), float(at[1])))
        pose = Pose(float(stand[0]), float(stand[1]), math.atan2(-back[1], -back[0]))
        stands.append(ObservationPoint(f"O{name}", name, pose))
    return NetworkRequest(
        Pose(float(middle[0]), float(middle[1])),
        tuple(aims),
        tuple(stands),
        tuple(regions),
        terrain=grid,
        bounds_m=(0.0, 0.0, size_m, size_m),
    )


def draw(request: NetworkRequest, network: PathNetwork, full: PathNetwork, path: Path) -> None:
    """Draw the shortest routes beside the consolidated network with one tracking region."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt
    from matplotlib.collections import LineCollection

    fig, both = plt.subplots(1, 2, figsize=(12, 6), layout="constrained", sharex=True, sharey=True)
    aim = network.regions[0].target
    for axes, net, title in (
        (both[0], full, f"every shortest route: {len(full.segments)} segments"),
        (both[1], network, f"consolidated (1.5 %): {len(network.segments)} segments; colour = loss of {aim}"),
    ):
        if request.terrain is not None:
            grid = request.terrain
            west, south, east, north = grid.bounds_m
            axes.imshow(grid.heights_m, extent=(west, east, south, north), cmap="gray", alpha=0.5)
        for ring in net.margins:
            axes.fill(*zip(*ring, strict=True), color="C1", alpha=0.15, lw=0)
        for ring in net.hazards:
            axes.fill(*zip(*ring, strict=True), color="C3", alpha=0.35, lw=0)
        for keep_out in request.keep_outs:
            axes.fill(*zip(*keep_out.polygon_m, strict=True), color="C1", alpha=0.8)
        lines = LineCollection([(s.a, s.b) for s in net.segments], lw=1.1, cmap="viridis")
        if net is network:
            lines.set_array(np.array([s.p_lose[aim] for s in net.segments]))
            fig.colorbar(axes.add_collection(lines), ax=axes, shrink=0.8, label=f"chance to lose {aim}")
            axes.fill(*zip(*net.regions[0].polygon, strict=True), color="C0", alpha=0.2)
        else:
            axes.add_collection(lines)
        for target in request.targets:
            axes.plot(target.east_m, target.north_m, "r*", ms=9)
            axes.annotate(
                target.id,
                (target.east_m, target.north_m),
                fontsize=8,
                xytext=(4, 4),
                textcoords="offset points",
            )
        axes.plot(request.start.east_m, request.start.north_m, "ks", ms=7)
        axes.set_title(title, fontsize=10)
        axes.set_aspect("equal")
        axes.set_xlabel("east, m")
    both[0].set_ylabel("north, m")
    fig.savefig(path, dpi=120)


def timing(*, terrain: bool) -> str:
    """Return one table row: 40 targets, 30 keep-outs, 64 m, five worlds."""
    cpu, wall, routes, segments = [], [], [], []
    for seed in range(5):
        request = world(seed, 40, 30, 64.0, terrain=terrain)
        c, w = time.process_time(), time.perf_counter()
        network = build_network(request)
        cpu.append(time.process_time() - c)
        wall.append(time.perf_counter() - w)
        routes.append(len(network.routes))
        segments.append(len(network.segments))
    return (
        f"| {'with' if terrain else 'without'} terrain | {statistics.median(cpu):.2f} ({max(cpu):.2f}) | "
        f"{statistics.median(wall):.2f} ({max(wall):.2f}) | {statistics.median(routes):.0f} | "
        f"{statistics.median(segments):.0f} |"
    )


def main() -> None:
    """Draw the picture and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("docs"))
    args = parser.parse_args()
    request = world(5, 10, 9, 30.0, terrain=True)
    network = build_network(request)
    full = build_network(replace(request, options=NetworkOptions(stretch=0.0, maximum_loss=1.0)))
    (args.out / "img").mkdir(parents=True, exist_ok=True)
    draw(request, network, full, args.out / "img" / "path-network.png")
    print("| world | CPU s, median (max) | wall s, median (max) | routes | segments |")
    print("|---|---|---|---|---|")
    print(timing(terrain=False))
    print(timing(terrain=True))


if __name__ == "__main__":
    main()
