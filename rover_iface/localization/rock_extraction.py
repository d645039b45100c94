"""Rocks in the points that stereo saw from one stop.

Li et al. 2007, section II.A: peaks are local maxima of the cloud, a plane through the ground of 70 x 70 cm
(near) or 2 x 2 m (far) round a peak gives its height, the points above the plane are its surface. Here the
search runs on the raster of directions, where stereo errs along the ray alone: a rock is a patch that
stands above the ground and hangs together in disparity, and two peaks with a deep gap between are two rocks.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from rover_iface.errors import LocalizationError
from rover_iface.localization.ground_fit import Ground, fit_ground
from rover_iface.localization.ground_points import DirectionRaster, GroundPoints, direction_raster
from rover_iface.localization.rock_chance import rock_probability, weighed_by_outlines
from rover_iface.localization.rock_models import FEWEST_POINTS, RockModel, best_rock_model
from rover_iface.localization.rock_outlines import OutlineOptions, cut_at_outlines
from rover_iface.localization.seen_rock import SeenRock

Array = npt.NDArray[np.float64]
Cells = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class ExtractionOptions:
    """Parameters of the rock extraction.

    Attributes
    ----------
    farthest_m
        Beyond, the range errs by more than a rock is wide.
    least_height_m, least_cells
        A rock is at least this high over its plane and this many cells large.
    near_m, near_side_m, far_side_m
        Up to `near_m` the plane is taken from a square of `near_side_m`, beyond from one of `far_side_m`
        (published: 70 cm and 2 m).
    disparity_px
        Standard deviation of a disparity; what hangs together differs by at most 4 of them.
    ground_reach_m, rise_allowance
        How far the ground is smoothed, coarse to fine; what is a rise at one reach is looked at again, and
        how many deviations a face is given before it counts as one at each.
    widest_m, least_steepness
        Wider than this, or lower than this share of its width, is a rise of the ground and no rock.
    steepest_rise
        A face that recedes by more than this per height (37 degrees from level), beyond what stereo errs, is
        a rise as well: a rock's face stands.
    significant_height_m
        Rocks from this height on count as significant.
    least_probability
        What is less probably a rock is left away.
    outlines
        How patches are cut at the outlines of the picture, where there is one.
    """

    farthest_m: float = 26.0
    least_height_m: float = 0.12
    least_cells: int = 10
    near_m: float = 6.0
    near_side_m: float = 0.7
    far_side_m: float = 2.0
    disparity_px: float = 0.3
    ground_reach_m: tuple[float, ...] = (1.6, 1.0, 0.6)
    widest_m: float = 3.0
    least_steepness: float = 0.3
    steepest_rise: float = 1.3
    rise_allowance: tuple[float, ...] = (1.0, 0.5, 0.5)
    significant_height_m: float = 0.15
    least_probability: float = 0.05
    outlines: OutlineOptions = field(default_factory=OutlineOptions)

    def __post_init__(self) -> None:
        if self.least_cells < FEWEST_POINTS - 4 or not self.least_height_m > 0 or not self.disparity_px > 0:
            raise LocalizationError(
                f"rocks of {self.least_cells} cells, {self.least_height_m} m, {self.disparity_px} px; "
                f"at least {FEWEST_POINTS - 4} cells and positive height and disparity error are needed"
            )


def extract_rocks(
    seen: GroundPoints, options: ExtractionOptions | None = None, *, models: bool = True
) -> list[SeenRock]:
    """Return the rocks in a cloud, the nearest first; without `models` the solids are not fitted.

    What may be a rise of the ground is among them, and says so (`SeenRock.rise`).

    Raises
    ------
    LocalizationError
        If too few points lie within reach.
    """
    options = options or ExtractionOptions()
    raster = direction_raster(seen, farthest_m=options.farthest_m + 6.0)
    smooth = _smoothed(raster.inverse)
    valid = np.isfinite(smooth)
    bright = None if raster.brightness is None else np.where(valid, raster.brightness, np.nan)
    raster = replace(raster, inverse=smooth, brightness=bright)
    points = raster.points()
    rocks: list[SeenRock] = []
    rises: list[SeenRock] = []
    taken = np.zeros(smooth.size, dtype=bool)
    # a rock on a rise is lost in it until the ground is followed more closely
    for reach, allowance in zip(options.ground_reach_m, options.rise_allowance, strict=True):
        ground = fit_ground(points[valid], side=min(1.0, 0.7 * reach), reach_m=reach)
        over = np.full(smooth.shape, np.nan)
        over[valid] = points[valid][:, 2] - ground.at(points[valid][:, :2])
        patches = _patches(over, smooth * seen.range_factor, options)
        for patch, outlined in _outlined(patches, raster, options):
            if taken[patch].any():
                continue
            rock = _rock(patch, raster, points, over, ground, seen.range_factor, options, allowance, models)
            if rock is not None and outlined is not None:
                rock = rock.with_outline(outlined)
            if rock is not None and rock.rise:
                rises.append(rock)
            elif rock is not None:
                rocks.append(rock)
                taken[patch] = True
    for rock in rises:
        if not taken[rock.cells].any():
            rocks.append(rock)
            taken[rock.cells] = True
    rocks = weighed_by_outlines(rocks, options.least_probability)
    return sorted(rocks, key=lambda rock: rock.range_m)


def _outlined(
    patches: list[Cells], raster: DirectionRaster, options: ExtractionOptions
) -> list[tuple[Cells, bool | None]]:
    """Return patches cut at the outlines of the picture, or as they are if there is none."""
    if raster.brightness is None or not patches:
        return [(patch, None) for patch in patches]
    raised = np.zeros(raster.inverse.shape, dtype=bool)
    raised.ravel()[np.concatenate(patches)] = True
    return [
        part
        for patch in patches
        for part in cut_at_outlines(patch, raised, raster.brightness, options.least_cells, options.outlines)
    ]


def _smoothed(inverse: Array) -> Array:
    """Return the raster with each value the median of its 3 x 3 cells; lone cells are dropped."""
    padded = np.pad(inverse, 1, constant_values=np.nan)
    rows, columns = inverse.shape
    stack = np.stack([padded[i : i + rows, j : j + columns] for i in range(3) for j in range(3)])
    known = np.isfinite(stack).sum(axis=0)
    stack.sort(axis=0)  # NaN go last
    middle = np.take_along_axis(stack, np.maximum(known - 1, 0)[None] // 2, axis=0)[0]
    return np.where(np.isfinite(inverse) & (known >= 3), middle, np.nan)


def _patches(over: Array, disparity: Array, options: ExtractionOptions) -> list[Cells]:
    """Return flat cell indices of each patch above ground that hangs together in disparity."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    with np.errstate(invalid="ignore"):
        high = over > 0.5 * options.least_height_m + 0.0015 / np.maximum(disparity / 235.4, 1e-3)
    rows, columns = over.shape
    number = np.arange(rows * columns).reshape(rows, columns)
    jump = 4.0 * options.disparity_px
    pairs = []
    for one, two in (
        ((slice(None), slice(0, -1)), (slice(None), slice(1, None))),
        ((slice(0, -1), slice(None)), (slice(1, None), slice(None))),
    ):
        with np.errstate(invalid="ignore"):
            joined = high[one] & high[two] & (np.abs(disparity[one] - disparity[two]) < jump)
        pairs.append(np.stack((number[one][joined], number[two][joined])))
    ends = np.concatenate(pairs, axis=1)
    graph = coo_matrix((np.ones(ends.shape[1]), (ends[0], ends[1])), shape=(number.size, number.size))
    label = connected_components(graph, directed=False)[1]
    inside = np.flatnonzero(high.ravel()).astype(np.int64)
    order = inside[np.argsort(label[inside], kind="stable")]
    cuts = np.flatnonzero(np.diff(label[order])) + 1
    patches = [part for part in np.split(order, cuts) if len(part) >= options.least_cells]
    return [piece for part in patches for piece in _split(part, over, options)]


def _split(part: Cells, over: Array, options: ExtractionOptions) -> list[Cells]:
    """Return a patch cut where its outline sinks below 60 % of the lower of two peaks."""
    columns = part % over.shape[1]
    left = int(columns.min())
    outline = np.zeros(int(columns.max()) - left + 1)
    np.maximum.at(outline, columns - left, over.ravel()[part])
    if len(outline) < 6:
        return [part]
    rolled = np.convolve(np.pad(outline, 1, mode="edge"), np.full(3, 1 / 3), mode="valid")
    best, where = 0.6, -1
    for k in range(2, len(rolled) - 2):
        share = rolled[k] / max(min(rolled[:k].max(), rolled[k + 1 :].max()), 1e-6)
        if share < best:
            best, where = share, k
    if where < 0:
        return [part]
    pieces = [part[columns - left <= where], part[columns - left > where]]
    return [
        cut for piece in pieces if len(piece) >= options.least_cells for cut in _split(piece, over, options)
    ]


def _rock(
    patch: Cells,
    raster: DirectionRaster,
    points: Array,
    over: Array,
    ground: Ground,
    range_factor: float,
    options: ExtractionOptions,
    allowance: float,
    models: bool,
) -> SeenRock | None:
    columns = over.shape[1]
    cells = points.reshape(-1, 3)[patch]
    away = np.linalg.norm(cells - raster.eye, axis=1)
    # what is not hidden behind the face stands at the near side: the ranges of one rock are one range
    distance = float(np.median(away))
    if distance > options.farthest_m:
        return None
    top = patch[np.argmax(over.ravel()[patch])]
    peak = points.reshape(-1, 3)[top]
    side = options.near_side_m if distance < options.near_m else options.far_side_m
    plane = _plane(peak, points, over, side, options) if distance < options.near_m else None
    if plane is None:
        plane = _plane(peak, points, over, options.far_side_m, options)
    if plane is None:
        here = ground.at(peak[None, :2])[0]
        plane = np.array([0.0, 0.0, 1.0]), float(here)
    normal, level = plane
    heights = cells @ normal - level
    height = float(peak @ normal - level)
    if height < options.least_height_m:
        return None
    column = patch % columns
    azimuth = raster.left + raster.step * column
    near, far = np.percentile(azimuth, (2, 98))
    width = float((far - near + raster.step) * distance)
    if not 0.05 < width < options.widest_m or height < options.least_steepness * width:
        return None
    slope, sigma_slope = _recession(cells, raster.eye, range_factor, options)
    rise = slope - allowance * sigma_slope > options.steepest_rise
    middle = 0.5 * (near + far)
    sight = np.array([math.cos(middle), math.sin(middle), 0.0])
    across = np.array([-sight[1], sight[0], 0.0])
    level_range = float(np.median(np.hypot(*(cells - raster.eye)[:, :2].T)))
    centre = raster.eye[:2] + sight[:2] * (level_range + 0.25 * width)
    foot = float((level - normal[:2] @ centre) / normal[2])
    sigma_range = distance**2 / range_factor * options.disparity_px * 0.6
    along = math.hypot(sigma_range, 0.15 * width)
    sideways = math.hypot(0.12 * width, 0.7 * raster.step * distance)
    upward = math.hypot(0.03, 0.003 * distance)
    covariance = (
        along**2 * np.outer(sight, sight)
        + sideways**2 * np.outer(across, across)
        + upward**2 * np.diag([0, 0, 1.0])
    )
    surface = cells[heights > 0.1 * height]
    signs = (
        math.log(height),
        math.log(height / width),
        math.log(distance),
        float(np.clip((slope - options.steepest_rise) / max(sigma_slope, 0.05), -6.0, 6.0)),
        float(np.clip(slope, -1.0, 6.0)),
        *_steps(patch, raster.inverse * range_factor),
    )
    probability = rock_probability(signs)
    if probability < options.least_probability:
        return None
    model = None
    if models and not rise and len(surface) >= FEWEST_POINTS:
        model = _model(
            surface, normal, level, sight, width, height, distance**2 / range_factor * options.disparity_px
        )
    return SeenRock(
        peak=peak,
        position=np.array([centre[0], centre[1], foot]),
        covariance=covariance,
        height_m=height,
        width_m=width,
        range_m=distance,
        surface=surface,
        model=model,
        cells=patch,
        rise=rise,
        probability=probability,
    )


STEP_CELLS = 3
OPEN_PX = 3.0
"""How far outside a patch the ground is looked at (stereo's window blurs what is nearer), and what counts for
nothing seen there."""


def _steps(patch: Cells, disparity: Array) -> tuple[float, float]:
    """Return the median fall of disparity above a patch and beside it, px, each from -1 to `OPEN_PX`."""
    rows, columns = disparity.shape
    row, column = patch // columns, patch % columns
    falls: list[list[float]] = [[], []]
    for side, along, across, sign, least, most in (
        (0, column, row, -1, 0, rows),
        (1, row, column, -1, 0, columns),
        (1, row, column, 1, 0, columns),
    ):
        order = np.lexsort((-sign * across, along))
        _, first = np.unique(along[order], return_index=True)
        edge = patch[order[first]]
        outside = across[order[first]] + sign * STEP_CELLS
        inside = (outside >= least) & (outside < most)
        step = sign * STEP_CELLS * (columns if side == 0 else 1)
        fall = disparity.ravel()[edge[inside]] - disparity.ravel()[edge[inside] + step]
        falls[side] += np.where(np.isfinite(fall), fall, OPEN_PX).tolist()
    above, beside = (float(np.clip(np.median(f), -1.0, OPEN_PX)) if f else 0.0 for f in falls)
    return above, beside


def _recession(
    cells: Array, eye: Array, range_factor: float, options: ExtractionOptions
) -> tuple[float, float]:
    """Return how much a face recedes, range over height, and how well that is known."""
    away = np.hypot(*(cells - eye)[:, :2].T)
    z = cells[:, 2] - cells[:, 2].mean()
    spread = float(z @ z)
    slope = float(z @ (away - away.mean())) / (spread + 1e-4)
    sigma = float(np.median(away)) ** 2 / range_factor * options.disparity_px
    # neighbouring cells err together: six count as one
    return slope, sigma / math.sqrt(spread / 6.0 + 1e-9)


def _plane(
    peak: Array, points: Array, over: Array, side: float, options: ExtractionOptions
) -> tuple[Array, float] | None:
    """Return normal and level (normal . p = level) of the ground in a square round a peak, or None."""
    flat, height = points.reshape(-1, 3), over.ravel()
    with np.errstate(invalid="ignore"):
        near = np.flatnonzero(
            (np.abs(flat[:, 0] - peak[0]) < side / 2)
            & (np.abs(flat[:, 1] - peak[1]) < side / 2)
            & (height < 0.5 * options.least_height_m)
        )
    if len(near) < 8:
        return None
    chosen = flat[near]
    base = np.column_stack((chosen[:, :2] - peak[:2], np.ones(len(near))))
    # slopes are held towards level: the ground of a far rock is seen on one side only
    ridge = np.diag([0.02, 0.02, 0.0]) * len(near)
    x = np.zeros(3)
    weight = np.ones(len(near))
    for _ in range(3):
        x = np.linalg.solve(
            (base * weight[:, None]).T @ base + ridge, (base * weight[:, None]).T @ chosen[:, 2]
        )
        rest = chosen[:, 2] - base @ x
        scale = 1.5 * float(np.median(np.abs(rest))) + 1e-3
        weight = 1.0 / (1.0 + (rest / (2 * scale)) ** 2)
    normal = np.array([-x[0], -x[1], 1.0])
    normal /= np.linalg.norm(normal)
    level = float(normal @ np.array([peak[0], peak[1], x[2]]))
    return normal, level


def _model(
    surface: Array,
    normal: Array,
    level: float,
    sight: Array,
    width: float,
    height: float,
    sigma_range: float,
) -> RockModel | None:
    """Return the best solid through surface points, in a frame whose x runs along the line of sight."""
    if len(surface) > 60:
        surface = surface[np.linspace(0, len(surface) - 1, 60).astype(np.int64)]
    x = sight - (sight @ normal) * normal
    x /= np.linalg.norm(x)
    axes = np.stack((x, np.cross(normal, x), normal))
    local = (surface - surface.mean(axis=0)) @ axes.T
    local[:, 2] = surface @ normal - level
    local[:, 0], axis = settled_depth(local, 0.5 * width, sigma_range)
    # symmetric about its peak (Li et al. 2007, II.B): the far side is the near one mirrored
    mirrored = local * (-1.0, 1.0, 1.0) + (2.0 * axis, 0.0, 0.0)
    try:
        return best_rock_model(
            np.concatenate((local, mirrored)),
            radius_m=(0.3 * width, 0.6 * width),
            height_m=(0.9 * height, 1.15 * height),
        )
    except LocalizationError:
        return None


def settled_depth(local: Array, radius_m: float, sigma_m: float) -> tuple[Array, float]:
    """Return depths [n] along the sight freed of what stereo errs, and that of the rock's axis.

    `local` are points (depth, across, up) [n, 3], metres.

    Stereo's error of depth is often larger than the rock. Depth is taken as that of a half round of the
    rock's width, plus a tilt found by least squares, plus what is left as far as it is larger than `sigma_m`
    would make it (Wiener's factor): near, the points count, far, the outline.
    """
    depth, across, up = local.T
    height = max(float(up.max()), 1e-3)
    middle = 0.5 * (float(across.max()) + float(across.min()))
    inside = 1.0 - ((across - middle) / radius_m) ** 2 - (up / height) ** 2
    round_ = -radius_m * np.sqrt(np.clip(inside, 0.0, None))
    rest = depth - round_
    base = np.column_stack((np.ones(len(depth)), up - up.mean(), across - middle))
    # neighbouring cells err together (six count as one); a face leans by up to 1, turns by up to 0.5
    noise = 6.0 * sigma_m**2
    ridge = np.diag([0.0, noise, noise / 0.25])
    tilt = np.linalg.solve(base.T @ base + ridge, base.T @ rest)
    left = rest - base @ tilt
    true = (0.15 * radius_m) ** 2
    return np.asarray(round_ + base @ tilt + true / (true + sigma_m**2) * left), float(tilt[0])
