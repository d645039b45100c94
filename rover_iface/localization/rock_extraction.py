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
from rover_iface.localization.ground_points import DirectionRaster, GroundPoints, direction_raster
from rover_iface.localization.rock_models import FEWEST_POINTS, RockModel, best_rock_model
from rover_iface.localization.rock_outlines import OutlineOptions, cut_at_outlines

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


@dataclass(frozen=True, eq=False, slots=True)
class SeenRock:
    """A rock seen from one stop, site frame of the cloud.

    Attributes
    ----------
    peak
        [3], its highest point.
    position, covariance
        [3], [3, 3]: middle of its foot, and how far that may be off.
    height_m, width_m
        Over the plane round it; across the line of sight.
    range_m
        From the eye.
    surface
        [n, 3], points above the plane.
    model
        The best of the four solids, None when there are too few points for one.
    cells
        Which cells of the direction raster show it.
    rise
        Its face recedes as that of a rise of the ground does: a rock seen from a flat side, or no rock.
    probability
        That it is a rock (`rock_probability`, `weighed_by_outlines`).
    outlined
        The picture shows where it ends (`rock_outlines`); None without a picture.
    """

    peak: Array
    position: Array
    covariance: Array
    height_m: float
    width_m: float
    range_m: float
    surface: Array
    model: RockModel | None
    cells: Cells
    rise: bool = False
    probability: float = 1.0
    outlined: bool | None = None

    @property
    def radius_m(self) -> float:
        """Return the radius of its model, or half its width."""
        return self.model.radius_m if self.model is not None else 0.5 * self.width_m

    @property
    def area_m2(self) -> float:
        """Return the surface, m2, of its model, or that of a hemispheroid of its size."""
        if self.model is not None:
            return self.model.area_m2
        return 2.0 * math.pi * 0.5 * self.width_m * max(self.height_m, 0.5 * self.width_m)

    def with_outline(self, outlined: bool) -> SeenRock:
        """Return the rock as the picture bears it out; one whose outline it shows is placed better."""
        factor = OUTLINED_SIGMA**2 if outlined else 1.0
        return replace(self, outlined=outlined, covariance=factor * self.covariance)


@dataclass(frozen=True, eq=False)
class Ground:
    """Height of the ground under a cloud, on a raster of 1 m posts [rows, columns], row 0 south."""

    heights: Array
    west: float
    south: float
    side: float

    def at(self, xy: Array) -> Array:
        """Return ground heights [...], m, at points [..., 2], m, bilinear, the border's beyond it."""
        from scipy.ndimage import map_coordinates

        where = (
            np.moveaxis(xy, -1, 0)[::-1] - np.array([self.south, self.west]).reshape(2, *[1] * (xy.ndim - 1))
        ) / self.side
        return np.asarray(map_coordinates(self.heights, where, order=1, mode="nearest"))


@dataclass(frozen=True, slots=True)
class GroundOptions:
    """Parameters of the ground under a cloud.

    None is published: Li et al. fit one plane a peak. They were chosen by hand for the generated terrains of
    `studies.localization`, for the reasons given.

    Attributes
    ----------
    low_share
        Each cell stands with the point of this share from below: the lowest ones are errors of stereo.
    full_count
        Points from which on a cell weighs fully: a few may all be noise.
    passes
        How often what lies over the plane is weighed anew: a rock pulls up the plane that it is judged by.
    stiffness_m2
        Added to the variance of places round a post: points in a line or spot tell no slope across it.
    over_m, fade_m
        What lies over the plane by `over_m` is ground all the same: ripples, errors of stereo. Beyond, its
        weight falls off as a Gaussian of `fade_m`, half the height of the lowest rock that is looked for.
    reach_sigmas
        Where the weight of a cell ends, in reaches; at five it is 4e-6.
    least_weight
        Posts that cells of less than this tell have the median height.
    """

    low_share: float = 0.3
    full_count: int = 10
    passes: int = 4
    stiffness_m2: float = 0.05
    over_m: float = 0.04
    fade_m: float = 0.06
    reach_sigmas: float = 5.0
    least_weight: float = 1e-9

    def __post_init__(self) -> None:
        if not (0 <= self.low_share <= 1 and self.full_count >= 1 and self.passes >= 1):
            raise LocalizationError(
                f"ground by the share {self.low_share} of {self.full_count} points in {self.passes} passes; "
                "0 to 1, and at least 1 each are needed"
            )
        if not (self.stiffness_m2 > 0 and self.fade_m > 0 and self.over_m >= 0):
            raise LocalizationError(
                f"ground with stiffness {self.stiffness_m2} m2, {self.over_m} m over it and a fall-off of "
                f"{self.fade_m} m; the first and the last must be positive"
            )


def fit_ground(
    points: Array, *, side: float = 1.0, reach_m: float = 1.5, options: GroundOptions | None = None
) -> Ground:
    """Return the ground under points [n, 3], m, z up: planes through low points, weighted by distance, rocks
    left out.

    Each cell of `side` metres stands with its lower points; a Gaussian of `reach_m` weighs the cells round a
    post, and cells above the plane lose weight.
    """
    options = options or GroundOptions()
    # two cells of border: the planes there lean on those inside
    low = points[:, :2].min(axis=0) - 2 * side
    at = np.floor((points[:, :2] - low) / side).astype(np.int64)
    columns, rows = (int(v) + 4 for v in at.max(axis=0))
    cell = at[:, 1] * columns + at[:, 0]
    order = np.lexsort((points[:, 2], cell))
    cells, first, count = np.unique(cell[order], return_index=True, return_counts=True)
    lows = points[order[first + (options.low_share * (count - 1)).astype(np.int64)]]
    weight = np.minimum(count, options.full_count) / float(options.full_count)
    x, y, z = (lows - (low[0], low[1], 0.0)).T
    trust = np.ones(len(cells))
    for _ in range(options.passes):
        fields = np.zeros((9, rows * columns))
        for total, moment in zip(fields, (1.0, x, y, z, x * x, x * y, y * y, x * z, y * z), strict=True):
            total[cells] = weight * trust * moment
        height = _planes(fields.reshape(-1, rows, columns), side, reach_m, float(np.median(z)), options)
        ground = Ground(height, float(low[0]), float(low[1]), side)
        over = lows[:, 2] - ground.at(lows[:, :2]) - options.over_m
        trust = np.where(over > 0.0, np.exp(-((over / options.fade_m) ** 2)), 1.0)
    return ground


def _planes(fields: Array, side: float, reach_m: float, else_m: float, options: GroundOptions) -> Array:
    """Return heights [rows, columns] of the local planes: Gaussian sums round each post, normal equations.

    `fields` [9, rows, columns] are weighted sums over the cells of 1, x, y, z, xx, xy, yy, xz, yz.
    """
    from scipy.ndimage import gaussian_filter

    sums = [
        gaussian_filter(field, reach_m / side, mode="constant", truncate=options.reach_sigmas)
        for field in fields
    ]
    total = np.maximum(sums[0], 1e-12)
    mx, my, mz, mxx, mxy, myy, mxz, myz = (moment / total for moment in sums[1:])
    xx = mxx - mx * mx + options.stiffness_m2
    yy = myy - my * my + options.stiffness_m2
    xy = mxy - mx * my
    xz, yz = mxz - mx * mz, myz - my * mz
    det = xx * yy - xy * xy
    a, b = (xz * yy - yz * xy) / det, (yz * xx - xz * xy) / det
    posts_y, posts_x = np.mgrid[0 : fields.shape[1], 0 : fields.shape[2]] * side
    height = mz + a * (posts_x - mx) + b * (posts_y - my)
    return np.where(sums[0] > options.least_weight, height, else_m)


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


ROCK_SIGNS = (7.824, 2.434, 2.017, -1.928, -0.102, -0.179, 0.293, 2.956)
"""Logistic weights: a constant, then the signs of `rock_probability`."""


def rock_probability(signs: tuple[float, ...]) -> float:
    """Return the odds, as a probability, that a patch above the ground is a rock and no rise of it.

    `signs` are the logarithms of height, height over width and range (metres), how many deviations its face
    recedes beyond the limit, how much it recedes, and how far disparity falls (px) above its top and beside
    it: a rise goes over into the ground, a rock ends.
    """
    constant, *weights = ROCK_SIGNS
    level = constant + sum(weight * sign for weight, sign in zip(weights, signs, strict=True))
    return 1.0 / (1.0 + math.exp(-max(-30.0, min(30.0, level))))


OUTLINE_LAW = {True: (2.33, 0.11), False: (-3.16, 0.27)}
"""By whether the picture shows an outline: constant and slope of log odds over those of `rock_probability`.

Fitted on the 16 rendered stops of terrains 393882176 to 393882183, 1,103 patches: of those with an outline
93 % were rocks, of those without 8 %.
"""

OUTLINED_ENOUGH = 6
"""Outlined patches, more probably rocks than not, by which a stop's pictures show that rocks have outlines
there: as many as a leg asks of rocks (`FaultLimits.least_rocks`). With fewer a patch without one may still be
a rock, on ground as bright as the rocks are."""

OUTLINED_SIGMA = 0.65
"""What a place errs by where the picture says where the rock ends, of what it errs by without: 0.58 to 0.60
along and across the sight, measured on the same legs."""


def weighed_by_outlines(rocks: list[SeenRock], least_probability: float) -> list[SeenRock]:
    """Return rocks with the probabilities that they have given the outlines of the picture; those that are
    less than `least_probability` are left away.

    Without enough outlines in the pictures the rocks come back as they are.
    """
    if sum(bool(rock.outlined) and rock.probability > 0.5 for rock in rocks) < OUTLINED_ENOUGH:
        return rocks
    weighed = []
    for rock in rocks:
        constant, slope = OUTLINE_LAW[bool(rock.outlined)]
        odds = rock.probability / max(1.0 - rock.probability, 1e-9)
        probability = 1.0 / (1.0 + math.exp(-constant) * odds**-slope)
        if probability >= least_probability:
            weighed.append(replace(rock, probability=probability))
    return weighed


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
