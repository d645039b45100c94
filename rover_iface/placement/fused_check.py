"""The surface under the tool as the finest cloud that shows it has it.

The mast's narrow pair ranges a rock to within a millimetre, but so near it has holes: a face that one of its
eyes does not see, a place in the shade. There the wide pair's points stand in, and where that has none the
hazcams'. So the relief is that of the narrow cloud where it has any, and what no cloud shows is a hole.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_iface.frames import across
from rover_iface.placement import patch_kernels as kernels
from rover_iface.placement.cloud import Array, SurfaceCloud
from rover_iface.placement.patch_check import COVER_CELL_M, COVERED_M, PatchCheck
from rover_iface.placement.plane_spread import plane_of, plane_spread


@dataclass(frozen=True, slots=True)
class FusedOptions:
    """How clouds are fused, and what the surface must keep; set on rocks 16000 to 16112.

    Attributes
    ----------
    margin_m
        Added to the tool's radius: the clouds are registered to 5 mm in 99 of 100 looks, and the arm errs by
        2. On rock 16016 an edge lay 2 mm outside of a margin of 4 mm, and under the tool.
    relief_margin_m
        The same for the relief: what lies farther out is asked for as a hole or a rim.
    rim_margin_m, most_rim_depth_m
        So far round the tool the surface must not fall deeper than is borne less what the arm errs: on the
        rocks 16040 and 16060 it fell by 34 to 37 mm under the rim of the tool where 15 to 17 were told.
    wide_margin_m
        So far round the tool the relief of a place beside the designated point counts: what dense stereo's
        block and the step beside it hide (5 mm), the registration and the arm. Of 134 places that kept 85 %
        of the limits to 4 mm round it 5 were unsafe, to 10 mm none of 101 (16 rocks, 16001 to 16060).
    stand_in_m
        A point of the second cloud, and of the third, counts where finer ones leave this much free.
    most_protrusion_m, most_depth_m
        What the first and the second may be, with what a plane that leans otherwise hides (`relief_sigma_m`).
        Wider than for the other clouds, which err more: 20 and 30 mm are borne. With 20 and 28 mm here 2 of
        358 accepts were unsafe, with 19 and 26 none of 343; with 18.5 and 25 one of 119 (16066).
    most_hole_m
        Diameter of the largest hole: of 18 places with one of 12.5 to 16 mm none was unsafe, of 9 with one to
        18 mm 3 (16014 to 16066).
    ending_margin_m, most_ending_m
        Diameter of the largest hole to so far round the tool. Stereo draws a surface by up to a centimetre
        over the edge behind which it sees nothing: on rock 44032 the narrow pair and the navcams had it under
        the whole tool, 5 cm beside the designated point, and the rim hung over the edge. The hole beyond was
        21 mm wide; at 11 other accepted places of 44001 to 44022 it was 12 at most. So beside the designated
        point `most_hole_m` is the limit. Within 24 mm of the points of 18 rocks (48225 to 48315) 11 of 309
        places, on four of them, had 20 to 30 mm and kept all other limits; with the arm 2 mm off in any
        direction none of the 11 was unsafe.
    bridged_m, bridged_relief_m, bridged_gap_rad
        A hole up to so wide does not count if what lies round it on all sides, no gap wider than the last,
        differs by no more than the second.
    least_narrow_share
        Share of the disc that the narrow cloud shows itself: below, the surface is not known.
    least_rock_share
        Share of the points that belong to the rock, as for the other clouds (`SafetyLimits`): with 0.97, what
        is borne in truth, a tool missed the rock 42039, whose share was told as 0.983.
    least_points
        Points under the tool below which nothing is said.
    """

    margin_m: float = 0.007
    relief_margin_m: float = 0.004
    rim_margin_m: float = 0.008
    most_rim_depth_m: float = 0.028
    wide_margin_m: float = 0.010
    stand_in_m: tuple[float, ...] = (0.0035, 0.005)
    most_protrusion_m: float = 0.0175
    most_depth_m: float = 0.025
    most_hole_m: float = 0.015
    ending_margin_m: float = 0.015
    most_ending_m: float = 0.030
    bridged_m: float = 0.022
    bridged_relief_m: float = 0.012
    bridged_gap_rad: float = 2.4
    least_narrow_share: float = 0.5
    least_rock_share: float = 0.985
    least_points: int = 30


@dataclass(frozen=True, eq=False)
class FusedSurface:
    """The surface under the tool: point and outward unit normal (3,), lengths in m.

    Attributes
    ----------
    protrusion_m, depth_m, rms_m
        Highest and lowest part over and below the fitted plane, root mean square deviation.
    rim_depth_m, wide_protrusion_m, wide_depth_m
        The same to `FusedOptions.rim_margin_m` and `wide_margin_m` round the tool.
    hole_m, ending_m
        Diameter of the largest hole that is not bridged, under the tool and to `FusedOptions.ending_margin_m`
        round it.
    narrow_share, rock_share
        Share of the disc that the narrow cloud shows; of the points, those on the rock.
    normal_sigma_rad, relief_sigma_m
        How far the normal may be off, one deviation (`plane_spread`), and by how much heights under the tool
        change with it.
    """

    point: Array
    normal: Array
    protrusion_m: float
    depth_m: float
    rms_m: float
    rim_depth_m: float
    wide_protrusion_m: float
    wide_depth_m: float
    hole_m: float
    ending_m: float
    narrow_share: float
    rock_share: float
    normal_sigma_rad: float
    relief_sigma_m: float


SHOWN_M = 0.003
"""A place of the disc within this of a point of the narrow cloud is shown by it; they lie 2 mm apart."""

CELL_M = 0.0025
RING_M = 0.004
"""Holes are looked for in cells this wide, and bridged by what lies within this of their rim."""

SMALLEST_HOLE_M = 0.009

BEYOND_M = 0.015
"""Points so far beyond the tool tell if a hole at its rim ends there or the surface does (rock 16040)."""

RELIEF_CELL_M = 0.0035
"""Relief is that of the medians of cells this wide: a wrong match is lost in one, a spike as wide is not. The
true protrusion is at most 3.6 mm more than the highest cell in 98 of 100 places, 5.5 mm more than a height
that 2 in 100 points are above (904 places of 113 rocks, 16000 to 16112)."""

SUPPORT_M, LEAST_CELLS = 0.05, 30
"""What is this far below the middle of the surface bears no tool; cells that a plane is fitted to."""


def fuse(checks: Sequence[PatchCheck], at: Array, options: FusedOptions) -> FusedSurface | None:
    """Return the surface under a tool at a point (3,) near the surface, m, frame of the clouds; None where
    there are hardly any points.

    `checks` hold the clouds of one rock, the finest first, which has an eye.
    """
    eye = checks[0].cloud.eye
    assert eye is not None
    normal = np.asarray((eye - at) / np.linalg.norm(eye - at))
    radius, reach = checks[0].radius_m, checks[0].radius_m + options.margin_m
    middle, cells = at, None
    # the plane decides which points lie under the tool, and they decide the plane
    for turn in range(3):
        points, source, mine = _under(checks, middle, normal, reach, options)
        if len(points) < options.least_points:
            return None
        if turn == 0:
            off = np.linalg.norm(points - middle, axis=1)
            inner = np.ascontiguousarray(points[off < reach] if (off < reach).sum() > 8 else points)
            centre, normal = kernels.fit_plane(inner, np.ones(len(inner)), normal)
            middle = at - ((at - centre) @ normal) * normal
            continue
        cells = _cells(points, source, middle, normal)
        slope, core = plane_of(cells, radius, SUPPORT_M)
        if len(core) < LEAST_CELLS:
            return None
        first, second = across(normal)
        middle = middle + slope[2] * normal
        normal = normal - slope[0] * first - slope[1] * second
        normal /= np.linalg.norm(normal)
        middle = at - ((at - middle) @ normal) * normal
    cells = _cells(points, source, middle, normal)
    off = points - middle
    rise = off @ normal
    aside = np.linalg.norm(off - np.outer(rise, normal), axis=1)
    under = aside < reach
    if under.sum() < options.least_points or not (np.hypot(*cells[:, :2].T) < radius).any():
        return None
    height, depth = _relief(cells, aside, rise, radius + options.relief_margin_m)
    rim_depth = _relief(cells, aside, rise, radius + options.rim_margin_m)[1]
    wide_height, wide_depth = _relief(cells, aside, rise, radius + options.wide_margin_m)
    rough = cells[np.hypot(*cells[:, :2].T) < radius + options.relief_margin_m, 2]
    kept = np.ascontiguousarray(points[under])
    fine = np.ascontiguousarray(kept[source[under] == 0])
    share = kernels.disc_gaps(fine, middle, normal, reach, SHOWN_M)[0] if len(fine) else 0.0
    sigma_rad = plane_spread(cells, radius, RELIEF_CELL_M, SUPPORT_M)
    return FusedSurface(
        middle,
        normal,
        height,
        depth,
        float(np.sqrt((rough**2).mean())),
        rim_depth,
        wide_height,
        wide_depth,
        _hole(points, middle, normal, reach, options),
        _hole(points, middle, normal, radius + options.ending_margin_m, options),
        float(share),
        float(mine[under].mean()),
        sigma_rad,
        # a plane through a disc moves at its rim, on the side to which it leans, by this on the mean
        radius / math.sqrt(2.0) * math.tan(sigma_rad),
    )


def _relief(cells: Array, aside: Array, rise: Array, within_m: float) -> tuple[float, float]:
    """Return how far the surface stands over the plane under the tool, and falls below it, m, within a
    distance of the tool's axis.

    That is by the cells (n, 3) (`_cells`); of the points, `aside` (k,) of the axis and `rise` (k,) over the
    plane, what is below all but one in 200 counts, too: a slit may be narrower than a cell.
    """
    height = cells[np.hypot(cells[:, 0], cells[:, 1]) < within_m, 2]
    lowest = min(float(height.min()), float(np.quantile(rise[aside < within_m], 0.005)))
    return float(height.max()), -lowest


def _cells(points: Array, source: npt.NDArray[np.int64], middle: Array, normal: Array) -> Array:
    """Return for each cell across the tool's axis place and median height of its points, (n, 3), m.

    A lone point of the narrow cloud in its cell may be a wrong match; the other clouds have no more.
    """
    first, second = across(normal)
    off = points - middle
    flat = np.column_stack((off @ first, off @ second))
    whole = np.floor(flat / RELIEF_CELL_M).astype(np.int64)
    order = np.lexsort((off @ normal, whole[:, 1], whole[:, 0]))
    whole, height, coarse = whole[order], (off @ normal)[order], source[order] > 0
    new = np.append(True, (np.diff(whole, axis=0) != 0).any(axis=1))
    begin = np.flatnonzero(new)
    count = np.diff(np.append(begin, len(whole)))
    kept = (count > 1) | coarse[begin]
    begin, count = begin[kept], count[kept]
    middles = 0.5 * (height[begin + (count - 1) // 2] + height[begin + count // 2])
    return np.column_stack(((whole[begin] + 0.5) * RELIEF_CELL_M, middles))


def _under(
    checks: Sequence[PatchCheck], middle: Array, normal: Array, reach: float, options: FusedOptions
) -> tuple[Array, npt.NDArray[np.int64], npt.NDArray[np.bool_]]:
    """Return the trusted points (n, 3) somewhat round a tool at `middle` (3,), the number of the cloud that
    each is of, and whether it is on the rock.
    """
    from scipy.spatial import cKDTree

    first, second = across(normal)
    points, flat = np.empty((0, 3)), np.empty((0, 2))
    source, mine = np.empty(0, np.int64), np.empty(0, np.bool_)
    for number, check in enumerate(checks):
        index = kernels.in_ball(check.cloud.points, np.asarray(middle, dtype=np.float64), 3.0 * reach)
        own, trusted = check.cloud.points[index], check.trusted[index]
        # what lies behind the surface that the tool meets does not count
        met = trusted & ~kernels.covered(own, trusted, middle, normal, COVER_CELL_M, COVERED_M)
        own, index = own[met], index[met]
        off = own - middle
        place = np.column_stack((off @ first, off @ second))
        near = (np.hypot(place[:, 0], place[:, 1]) < reach + BEYOND_M) & (
            off @ normal < check.limits.tool_length_m
        )
        own, index, place = own[near], index[near], place[near]
        if number and len(flat) and len(own):
            free = cKDTree(flat).query(place)[0] > options.stand_in_m[number - 1]
            own, index, place = own[free], index[free], place[free]
        points, flat = np.vstack((points, own)), np.vstack((flat, place))
        source = np.append(source, np.full(len(own), number))
        mine = np.append(mine, check.labels[index] == check.label)
    return points, source, mine


def _hole(points: Array, middle: Array, normal: Array, reach: float, options: FusedOptions) -> float:
    """Return the diameter, m, of the largest hole between points (n, 3) under a disc that is not bridged."""
    from scipy.spatial import cKDTree

    first, second = across(normal)
    off = points - middle
    flat, height = np.column_stack((off @ first, off @ second)), off @ normal
    line = np.arange(-reach, reach + 1e-6, CELL_M)
    cells = np.column_stack([v.ravel() for v in np.meshgrid(line, line)])
    cells = cells[np.hypot(cells[:, 0], cells[:, 1]) <= reach]
    tree = cKDTree(flat)
    away = tree.query(cells)[0]
    bridged = np.zeros(len(cells), np.bool_)
    # the widest first: what lies in a bridged hole belongs to it
    for k in np.argsort(-away):
        if 2.0 * away[k] <= SMALLEST_HOLE_M:
            break
        if bridged[k]:
            continue
        rim = np.asarray(tree.query_ball_point(cells[k], away[k] + RING_M))
        if not _bridged(2.0 * float(away[k]), flat[rim] - cells[k], height[rim], options):
            return 2.0 * float(away[k])
        bridged |= np.linalg.norm(cells - cells[k], axis=1) < away[k]
    return 0.0


def _bridged(width_m: float, rim: Array, height: Array, options: FusedOptions) -> bool:
    """Return whether a hole is small and the same surface lies round it: points (n, 2) from its middle, and
    their heights (n,), m.
    """
    if width_m > options.bridged_m:
        return False
    low, high = np.quantile(height, (0.03, 0.97))
    turn = np.sort(np.arctan2(rim[:, 1], rim[:, 0]))
    gap = float(np.diff(np.append(turn, turn[0] + math.tau)).max())
    return bool(high - low <= options.bridged_relief_m and gap <= options.bridged_gap_rad)


def carried_labels(cloud: SurfaceCloud, check: PatchCheck, within_m: float) -> npt.NDArray[np.int64]:
    """Return (n,) the label of a check's rock for the points of another cloud that lie within a distance of
    its points, -1 elsewhere.
    """
    away, nearest = check.cloud.tree.query(cloud.points, distance_upper_bound=within_m)
    same = np.append(check.labels, -1)[nearest]
    return np.where(np.isfinite(away) & (same == check.label), check.label, -1)
