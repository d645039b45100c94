"""Compiled kernels of what one picture shows of another: draped patches, found in one go; ranges as seen."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

from rover_iface.cameras.kernels import project_one
from rover_iface.cameras.model import Array
from rover_iface.vision.patch import align_shape, correlation, plane_template

Image = npt.NDArray[np.float32]
PEAKS, PEAK_APART, PEAK_SHARE = 8, 4, 0.35
"""Places that are compared, how far apart they are, px, and how much worse than the best they may score;
those of `template`."""
LEAST_STD, MOST_UNKNOWN = 1e-4, 0.15
"""Contrast that a template needs, and the share of it that may lie outside the picture it is cut from."""
LEAST_FACING = 0.2
"""Cosine of the slant below which a plane is seen too flat."""


@njit(cache=True, nogil=True)
def find_patches_of(
    image: Image,
    p_image: Array,
    eye: Array,
    scene: Image,
    p_scene: Array,
    scene_eye: Array,
    finer: float,
    source_px: Array,
    points: Array,
    normals: Array,
    half: int,
    context: int,
    search_px: int,
    shape_sd: float,
    most_px: float,
    pixels: Array,
    scores: Array,
    spreads: Array,
) -> None:
    """Fill where one picture shows what another has at places of known planes, and their correlation.

    `image` and `scene` [rows, columns] are the picture that is draped and the one that is searched, `p_image`
    and `p_scene` [26] their cameras as `cameras.kernels` lays them out, `eye` and `scene_eye` [3], m, where
    these are, `finer` the focal length of the second over that of the first, px. Of n places: `source_px`
    [n, 2] in the first picture, `points` [n, 3], m, and unit `normals` [n, 3], frame of the cameras. `half`
    and `context`, px, are the half sides of the window that is searched for and of that over which its best
    places are compared. `pixels` [n, 2] and `scores` [n] are filled, -2 where nothing is found.
    """
    size = 2 * context + 1
    template = np.empty((size, size), np.float32)
    for n in range(len(points)):
        scores[n] = -2.0
        away, beyond = _distance(eye, points[n]), _distance(scene_eye, points[n])
        if min(
            _facing(eye, points[n], normals[n], away), _facing(scene_eye, points[n], normals[n], beyond)
        ) <= (LEAST_FACING):
            continue
        x, y, _ = project_one(p_scene, points[n, 0], points[n, 1], points[n, 2])
        if math.isnan(x):
            continue
        expected = np.array([x, y])
        scale = away / beyond * finer
        samples = 1 if scale > 0.8 else 2 if scale > 0.4 else 3
        plane_template(
            image,
            p_image,
            source_px[n],
            p_scene,
            expected,
            points[n],
            normals[n],
            points[n],
            context,
            samples,
            template,
        )
        found = _best_place(scene, template, expected, half, context, search_px)
        if math.isnan(found[0]):
            continue
        at, spread = np.array([found[0], found[1]]), np.empty((2, 2))
        score = align_shape(scene, template, at, half, shape_sd, most_px, spread)
        aligned = score >= -1.0
        if not aligned:
            at[0], at[1] = found[0], found[1]
            score = correlation(scene, template, at[0], at[1], half)
        if max(abs(at[0] - x), abs(at[1] - y)) <= search_px + 1.0:
            pixels[n, 0], pixels[n, 1] = at[0], at[1]
            scores[n] = score
            if aligned:
                spreads[n] = spread


@njit(cache=True, nogil=True)
def nearest_pixels(pixels: Array, places: Array, out: npt.NDArray[np.int64]) -> None:
    """Fill `out` [m] with which of the pixels [n, 2] is nearest to each place [m, 2], px, by the sum of both
    distances; the first where several are.
    """
    for m in range(len(places)):
        best = math.inf
        for n in range(len(pixels)):
            away = abs(pixels[n, 0] - places[m, 0]) + abs(pixels[n, 1] - places[m, 1])
            if away < best:
                best, out[m] = away, n


@njit(cache=True, nogil=True)
def nearest_ranges(
    points: Array, moved: Array, p: Array, eye: Array, middle: Array, half: int, ranges: Image
) -> None:
    """Fill how far the nearest of the points [n, 3] is from an eye [3], m, at each pixel round `middle` [2].

    `moved` [3], m, is added to the points; `p` [26] is the camera as `cameras.kernels` lays it out. `ranges`
    [2 half + 1, 2 half + 1] keeps its NaN where no point falls.
    """
    side = 2 * half + 1
    point = np.empty(3)
    for n in range(len(points)):
        for axis in range(3):
            point[axis] = points[n, axis] + moved[axis]
        x, y, _ = project_one(p, point[0], point[1], point[2])
        if math.isnan(x) or math.isnan(y):
            continue
        i, j = np.rint(x - middle[0]) + half, np.rint(y - middle[1]) + half
        if 0 <= i < side and 0 <= j < side:
            away = np.float32(_distance(eye, point))
            if not away >= ranges[int(j), int(i)]:
                ranges[int(j), int(i)] = away


@njit(cache=True, nogil=True)
def _distance(eye: Array, point: Array) -> float:
    return math.sqrt((eye[0] - point[0]) ** 2 + (eye[1] - point[1]) ** 2 + (eye[2] - point[2]) ** 2)


@njit(cache=True, nogil=True)
def _facing(eye: Array, point: Array, normal: Array, away: float) -> float:
    """Return the cosine between a plane's normal and the line to an eye."""
    along = 0.0
    for axis in range(3):
        along += normal[axis] * (eye[axis] - point[axis])
    return along / away


@njit(cache=True, nogil=True)
def _best_place(
    image: Image, template: Image, expected: Array, half: int, context: int, search_px: int
) -> tuple[float, float]:
    """Return the best place of a template in a search window, to a whole pixel; NaN where there is none.

    The best few places of its middle are compared over the whole of it, and by how far they are from where it
    is expected.
    """
    side = 2 * half + 1
    core = np.empty((side, side))
    norm = _centred(template, half, context, core)
    if norm < LEAST_STD * side:
        return math.nan, math.nan
    rows, columns = image.shape
    # to the even one where it lies half between two, as Python rounds
    far = search_px + half
    left, top = max(0, int(np.rint(expected[0])) - far), max(0, int(np.rint(expected[1])) - far)
    right, low = int(np.rint(expected[0])) + far + 1, int(np.rint(expected[1])) + far + 1
    wide, high = min(columns, right) - left - side + 1, min(rows, low) - top - side + 1
    if wide < 1 or high < 1:
        return math.nan, math.nan
    score = np.empty((high, wide))
    _alike(image, core, norm, left, top, score)
    best, best_x, best_y, first = -math.inf, math.nan, math.nan, 0.0
    for number in range(PEAKS):
        place = int(np.argmax(score))
        y, x = place // wide, place % wide
        value = score[y, x]
        if not value > -0.99 or (number > 0 and value < first - PEAK_SHARE):
            break
        if number == 0:
            first = value
        for j in range(max(0, y - PEAK_APART), min(high, y + PEAK_APART + 1)):
            for i in range(max(0, x - PEAK_APART), min(wide, x + PEAK_APART + 1)):
                score[j, i] = -1.0
        u, v = float(left + x + half), float(top + y + half)
        whole = correlation(image, template, u, v, context)
        rank = 0.5 * value + 0.5 * whole if whole > -1.5 else value
        rank -= 0.05 * math.hypot(u - expected[0], v - expected[1]) / 61.0
        if rank > best:
            best, best_x, best_y = rank, u, v
    return best_x, best_y


@njit(cache=True, nogil=True)
def _centred(template: Image, half: int, context: int, core: Array) -> float:
    """Fill `core` [2 half + 1, 2 half + 1] with the middle of a template less its mean, 0 where that is
    unknown; return its norm, 0 where too much of it is.
    """
    side = 2 * half + 1
    mean, known = 0.0, 0
    for j in range(side):
        for i in range(side):
            core[j, i] = template[context - half + j, context - half + i]
            if not math.isnan(core[j, i]):
                mean += core[j, i]
                known += 1
    if side * side - known > MOST_UNKNOWN * side * side:
        return 0.0
    mean /= known
    square = 0.0
    for j in range(side):
        for i in range(side):
            core[j, i] = 0.0 if math.isnan(core[j, i]) else core[j, i] - mean
            square += core[j, i] * core[j, i]
    return math.sqrt(square)


@njit(cache=True, nogil=True, error_model="numpy")
def _alike(image: Image, core: Array, norm: float, left: int, top: int, score: Array) -> None:
    """Fill `score` [high, wide] with the normalised cross-correlation of a window with the picture.

    The window, `core` [side, side], is centred; its upper left corner is at whole pixels from (`left`, `top`)
    on.

    Places beside each other in a row are worked on together: the compiler takes several at once.
    """
    side, (high, wide) = core.shape[0], score.shape
    across = wide + side - 1
    part = np.empty((high + side - 1, across))
    for j in range(high + side - 1):
        for i in range(across):
            part[j, i] = image[top + j, left + i]
    totals, squares = np.empty(across), np.empty(across)
    for y in range(high):
        totals[:], squares[:] = 0.0, 0.0
        row = score[y]
        row[:] = 0.0
        for j in range(side):
            line = part[y + j]
            for i in range(across):
                totals[i] += line[i]
                squares[i] += line[i] * line[i]
            for i in range(side):
                weight, shifted = core[j, i], line[i : i + wide]
                for x in range(wide):
                    row[x] += weight * shifted[x]
        for x in range(wide):
            total, square = 0.0, 0.0
            for i in range(side):
                total += totals[x + i]
                square += squares[x + i]
            spread = square - total * total / (side * side)
            row[x] = row[x] / (norm * math.sqrt(spread)) if spread > 1e-9 else 0.0
