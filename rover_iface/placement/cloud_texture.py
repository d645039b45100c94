"""By how much a registered cloud lies beside its place, by the brightness of the surface.

Where a rock is smooth its shape fits itself in more than one place: closest points leave a cloud a centimetre
beside, with a residual like any other. Both pairs show the same grain, bands and shadows. Drawn from straight
above, on the plane of the surface, the two clouds are pictures without parallax, and the shift at which they
correlate best tells how far one lies beside the other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_iface.frames import across
from rover_iface.placement.cloud import Array, SurfaceCloud

Bools = npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class TextureOptions:
    """How the shift is sought, and when it is believed; set on 20 rocks, 44300 to 44316 and 45000 to 45003.

    Attributes
    ----------
    half_m, cell_m
        Half the width of the pictures and the width of a cell: half a pixel of the hazcams.
    grain_m
        Brightness that varies over more than this is left out: shades, which the pairs see otherwise.
    reach_m
        Largest shift: closest points came out up to 9 mm beside in one of 50 rocks.
    round_m
        So near the place the plane is fitted.
    near_m
        A cell is shown by points within this of it: twice the spacing of the hazcams'.
    least_cells, least_correlation, least_drop
        A shift is believed where so many cells are shown by both, they correlate so well, and by so much less
        two cells beside. The 15 rocks so tied ended 0.8 mm off at most, one of them 8.7 before; of the shifts
        that were not believed two were 5 to 8 mm off.
    """

    half_m: float = 0.08
    cell_m: float = 0.002
    grain_m: float = 0.010
    reach_m: float = 0.016
    round_m: float = 0.05
    near_m: float = 0.006
    least_cells: int = 600
    least_correlation: float = 0.6
    least_drop: float = 0.09


@dataclass(frozen=True, eq=False)
class Tie:
    """A point of the second cloud, by its number, where it belongs (3,), m, and two unit vectors (2, 3)
    across the surface along which that is known.
    """

    number: int
    place: Array
    along: Array


def tie(second: SurfaceCloud, first: SurfaceCloud, options: TextureOptions | None = None) -> Tie | None:
    """Return where the middle of a second cloud, registered to a first, belongs by the brightness of both;
    None where that is not to be believed. Both in one frame, m.
    """
    options = options or TextureOptions()
    if second.eye is None or second.intensity is None or first.intensity is None:
        return None
    ways = second.points - second.eye
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    number = int(np.argmax(ways @ ways.mean(axis=0)))
    middle = second.points[number]
    around = first.points[np.linalg.norm(first.points - middle, axis=1) < options.round_m]
    if len(around) < 30:
        return None
    normal = np.linalg.eigh(np.cov(around.T))[1][:, 0]
    along = np.array(across(normal))
    one, two = (_picture(cloud, middle, normal, along, options) for cloud in (first, second))
    found = None if one is None or two is None else _shift(one, two, options)
    return None if found is None else Tie(number, middle + found @ along, along)


def _picture(
    cloud: SurfaceCloud, middle: Array, normal: Array, along: Array, options: TextureOptions
) -> tuple[Array, Bools] | None:
    """Return the brightness (n, n) of a cloud on the plane through `middle` (3,), its slow part taken off,
    and which cells are shown; None where there is hardly any.
    """
    import cv2
    from scipy.spatial import cKDTree

    assert cloud.intensity is not None
    off = cloud.points - middle
    near = (np.abs(off @ along.T) < 1.2 * options.half_m).all(axis=1) & (
        np.abs(off @ normal) < options.half_m
    )
    if near.sum() < options.least_cells // 4:
        return None
    line = np.arange(-options.half_m, options.half_m + 1e-9, options.cell_m)
    cells = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    away, nearest = cKDTree(off[near] @ along.T).query(cells, 6)
    weight = np.exp(-0.5 * (away / (0.5 * options.near_m)) ** 2) + 1e-12
    bright = (weight * cloud.intensity[near][nearest]).sum(axis=1) / weight.sum(axis=1)
    shown = (away[:, 2] < options.near_m).reshape(len(line), -1)
    image, width = bright.reshape(shown.shape), options.grain_m / options.cell_m
    share = cv2.GaussianBlur(shown.astype(np.float64), (0, 0), width)
    slow = cv2.GaussianBlur(image * shown, (0, 0), width) / (share + 1e-6)
    return np.asarray(image - slow), shown


def _shift(one: tuple[Array, Bools], two: tuple[Array, Bools], options: TextureOptions) -> Array | None:
    """Return by how much (2,), m, the second picture is to be moved along columns and rows to lie on the
    first; None where that is not to be believed.
    """
    reach = round(options.reach_m / options.cell_m)
    score = np.array(
        [
            [_correlation(one, two, dx, dy, options.least_cells) for dx in range(-reach, reach + 1)]
            for dy in range(-reach, reach + 1)
        ]
    )
    y, x = (int(v) for v in np.unravel_index(int(score.argmax()), score.shape))
    if not (2 <= y <= 2 * reach - 2 and 2 <= x <= 2 * reach - 2):
        return None
    best = score[y, x]
    beside = max(score[y + b, x + a] for a in (-2, 0, 2) for b in (-2, 0, 2) if (a, b) != (0, 0))
    if best < options.least_correlation or best - beside < options.least_drop:
        return None
    fine = _summit(score[y, x - 1 : x + 2]), _summit(score[y - 1 : y + 2, x])
    return options.cell_m * np.array([x - reach + fine[0], y - reach + fine[1]])


def _correlation(one: tuple[Array, Bools], two: tuple[Array, Bools], dx: int, dy: int, least: int) -> float:
    """Return how well the second picture, moved by whole cells, correlates with the first; -1 without any."""
    count = len(one[0])
    here = slice(max(0, dy), count + min(0, dy)), slice(max(0, dx), count + min(0, dx))
    there = slice(max(0, -dy), count + min(0, -dy)), slice(max(0, -dx), count + min(0, -dx))
    both = one[1][here] & two[1][there]
    if both.sum() < least:
        return -1.0
    a, b = one[0][here][both], two[0][there][both]
    a, b = a - a.mean(), b - b.mean()
    return float(a @ b / np.sqrt((a @ a) * (b @ b) + 1e-12))


def _summit(three: Array) -> float:
    """Return where the parabola through three values has its summit, cells from the middle one."""
    bend = three[0] - 2.0 * three[1] + three[2]
    return float(0.5 * (three[0] - three[2]) / bend) if bend < 0.0 else 0.0
