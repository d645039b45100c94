"""Where a stop lies on a map, from metres and degrees away.

The stop's stereo gives cells of ground with height and brightness; every pose of the prior's reach is scored
against the map by both, the best is fitted, and the weight of all others is the probability that it is false.
It is then tested: the half of the stop that did not find it has to find it too, each kind of evidence may not
speak against it, and chance may not reach as far. No pose leaves a stop that any rule refuses.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np
import numpy.typing as npt

from rover_iface.errors import LocalizationError
from rover_iface.frames import Transform
from rover_iface.localization.pose_fit import FitOptions, Layer, PoseFit, fit_pose
from rover_iface.localization.pose_search import (
    BOTH,
    FIRST,
    SECOND,
    PoseGrid,
    SearchReach,
    bounded,
    fine_structure,
    search,
)
from rover_iface.localization.relief_map import ReliefMap
from rover_iface.localization.stop_relief import StopCells, StopView, stop_cells

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class RelocalisationPrior:
    """How far the stop may lie from where the rover believed it, each way: deviations of shift and turn.

    The search goes to 2.5 deviations along each axis and of the turn; a stop beyond it is refused, not found.
    """

    sigma_m: float = 5.0
    sigma_turn_rad: float = math.radians(5.0)

    def __post_init__(self) -> None:
        # the search grows with the square of the shift: 20 m is 16 times the work of 5 m
        if not 0.2 <= self.sigma_m <= 20.0:
            raise LocalizationError(
                f"sigma of the believed place is {self.sigma_m} m; 0.2 to 20 m are possible"
            )
        if not 0.0 < self.sigma_turn_rad <= math.radians(72.0):
            raise LocalizationError(
                f"sigma of the believed heading is {math.degrees(self.sigma_turn_rad):.3g} degrees; it must "
                "be positive and at most 72"
            )

    @property
    def reach(self) -> SearchReach:
        """Return the poses that are searched."""
        return SearchReach(2.5 * self.sigma_m, 2.5 * self.sigma_turn_rad)


class RelocalisationFault(StrEnum):
    """Why a stop is refused."""

    OFF_THE_MAP = "too little of the reach is on the map"
    NOTHING_ALIKE = "nothing on the map is more alike than chance"
    AMBIGUOUS = "another pose fits nearly as well"
    HALVES_DISAGREE = "the two halves of the stop find different places"
    KINDS_DISAGREE = "heights and brightness find different places"
    AT_THE_RIM = "the best pose lies at the rim of the reach"
    NOT_HELD = "the fit does not hold"
    WEAK_GEOMETRY = "geometry too weak"


@dataclass(frozen=True, slots=True)
class RelocalisationOptions:
    """How a stop is searched and judged.

    Attributes
    ----------
    farthest_m
        Ground beyond is left away: at 25 m a navcam's range errs by 1 m.
    search_cell_m, fit_cell_m
        Cells of the search, and of the fit.
    height_over_m, brightness_over_m
        What varies slower is taken out. Heights of 2 m are those that a DEM of 1 m posts still has and whose
        longer waves it has wrong; brightness of 1 m is patches and rocks. Set on generated grounds 5 and 6
        and on landing_site and pahrump_hills.
    map_height_sigma_m
        Error of the map's heights, against which that of a cell weighs.
    least_share
        Share of the cells, of each half, that must fall on known map at a pose.
    least_reach
        Share of the reach that must be so.
    least_evidence
        Nats by which the pose must stand over chance in each half, beyond the logarithm of the number of
        poses tried: the best of so many wrong ones comes as high by itself.
    largest_false_probability
        Weight of all other poses.
    same_m, same_rad
        Poses are one within this: two cells, and what moves the farthest ground by two cells.
    against
        Nats by which a half of the stop, or one kind of evidence, may like another pose better than the one
        found; of a kind, beyond what the best of so many wrong ones gets by chance. e^-10 is 1 in 22,000.
    largest_sigma_m, largest_sigma_rad
        Of the pose: the worst direction of shift, and turn.
    """

    farthest_m: float = 25.0
    search_cell_m: float = 0.5
    fit_cell_m: float = 0.25
    height_over_m: float = 2.0
    brightness_over_m: float = 1.0
    map_height_sigma_m: float = 0.1
    least_share: float = 0.3
    least_reach: float = 0.3
    least_evidence: float = 2.0
    largest_false_probability: float = 1e-3
    same_m: float = 1.0
    same_rad: float = math.radians(2.5)
    against: float = 10.0
    largest_sigma_m: float = 0.3
    largest_sigma_rad: float = math.radians(1.5)
    fit: FitOptions = field(default_factory=FitOptions)

    def __post_init__(self) -> None:
        for name in ("farthest_m", "search_cell_m", "fit_cell_m", "height_over_m", "brightness_over_m"):
            if not getattr(self, name) > 0:
                raise LocalizationError(f"{name} is {getattr(self, name)}; it must be positive")
        if not 0 < self.largest_false_probability < 1:
            raise LocalizationError(
                f"largest_false_probability is {self.largest_false_probability}; it must lie in 0 to 1"
            )


@dataclass(frozen=True, slots=True)
class RelocalisationRefusal:
    """One rule that fired: which, and the value against its limit."""

    fault: RelocalisationFault
    message: str


@dataclass(frozen=True, eq=False, slots=True)
class RelocalisedPose:
    """Where the stop is on the map.

    Attributes
    ----------
    east_m, north_m, up_m
        Of the stop's eye, site frame of the map.
    turn_rad
        Turn from the believed axes to the map's, counter-clockwise: what is added to the believed heading.
    covariance
        (4, 4), of (east, north, up, turn), m and rad. The prior is not in it.
    """

    east_m: float
    north_m: float
    up_m: float
    turn_rad: float
    covariance: Array

    @property
    def map_from_stop(self) -> Transform:
        """Return the pose of the stop's frame: level, its origin at the eye, in the believed axes."""
        return Transform.from_rpy(0.0, 0.0, self.turn_rad, (self.east_m, self.north_m, self.up_m))

    def pose_covariance(self, tilt_sigma_rad: float) -> Array:
        """Return the covariance (6, 6) of (turn, shift) in the stop's own axes, as `BundleAdjustment` takes
        it; roll and pitch are known to `tilt_sigma_rad` from elsewhere.
        """
        if not tilt_sigma_rad > 0:
            raise LocalizationError(f"sigma of roll and pitch is {tilt_sigma_rad} rad; it must be positive")
        c, s = math.cos(self.turn_rad), math.sin(self.turn_rad)
        move = np.zeros((4, 4))
        move[0, 3] = 1.0
        move[1:, :3] = [[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]
        out = np.diag([tilt_sigma_rad**2] * 2 + [0.0] * 4)
        out[2:, 2:] = move @ self.covariance @ move.T
        return out


@dataclass(frozen=True, eq=False, slots=True)
class Relocalisation:
    """What came of a stop.

    Attributes
    ----------
    refusals
        Rules that fired; none if the pose is accepted.
    evidence
        Nats over chance for the best pose, of both halves.
    false_probability
        Weight of all other poses; NaN where none was scored.
    found
        The pose, also of a refused stop if there was one, to be looked at and not to be used.
    """

    refusals: tuple[RelocalisationRefusal, ...]
    evidence: float
    false_probability: float
    found: RelocalisedPose | None

    @property
    def accepted(self) -> bool:
        """Return whether no rule fired."""
        return not self.refusals and self.found is not None

    @property
    def pose(self) -> RelocalisedPose:
        """Return the pose.

        Raises
        ------
        LocalizationError
            If the stop was refused: there is no pose that may be used.
        """
        if self.found is None or self.refusals:
            raise LocalizationError(f"the stop was refused: {'; '.join(r.message for r in self.refusals)}")
        return self.found

    @property
    def verdict(self) -> str:
        """Return one line for the operator."""
        if self.refusals:
            return "refused: " + "; ".join(refusal.message for refusal in self.refusals)
        return (
            f"accepted: {self.evidence:.0f} nats over chance, false with probability "
            f"{self.false_probability:.1e}"
        )


def relocalise(
    grid: ReliefMap,
    view: StopView,
    prior: RelocalisationPrior | None = None,
    options: RelocalisationOptions | None = None,
) -> Relocalisation:
    """Return where a stop lies on a map, or why it cannot be said.

    Parameters
    ----------
    grid
        The map; it should reach further than the prior and the stop's ground together.
    view
        What the stop saw, in the frame of the map as far as the rover knew it.

    Raises
    ------
    LocalizationError
        If the stop saw no ground near by.
    """
    prior, options = prior or RelocalisationPrior(), options or RelocalisationOptions()
    kinds = _kinds(grid, view, prior, options)
    if not kinds:
        message = f"the map has no ground within {prior.reach.shift_m:.1f} m of the believed place"
        return _nothing(RelocalisationFault.OFF_THE_MAP, message)
    both = kinds[0] if len(kinds) == 1 else kinds[0] + kinds[1]
    likelihood = both.likelihood[BOTH]
    best = both.pose(both.best())
    near = both.near(best, options.same_m, options.same_rad)
    peak = float(np.nanmax(likelihood))
    weight = np.exp(np.nan_to_num(likelihood - peak, nan=-np.inf))
    false = float(weight[~near].sum() / weight.sum())
    refusals = _judged(both, kinds, best, near, false, prior, options)
    fit, up = _fitted(grid, view, best, options)
    if fit is None or up is None:
        refusals.append(
            RelocalisationRefusal(RelocalisationFault.NOT_HELD, "no fit near the best pose of the search")
        )
        return Relocalisation(tuple(refusals), peak, false, None)
    eye = view.seen.eye
    found = RelocalisedPose(
        float(fit.pose[0]), float(fit.pose[1]), up[0], float(fit.pose[2]), _with_height(fit.covariance, up[1])
    )
    refusals += _judged_fit(found, np.append(eye[:2], 0.0) + best, options)
    return Relocalisation(tuple(refusals), peak, false, found)


def _nothing(fault: RelocalisationFault, message: str) -> Relocalisation:
    return Relocalisation((RelocalisationRefusal(fault, message),), 0.0, math.nan, None)


def _with_height(covariance: Array, variance: float) -> Array:
    """Return the covariance of (east, north, up, turn) from that of (east, north, turn, disparity)."""
    out = np.zeros((4, 4))
    out[np.ix_([0, 1, 3], [0, 1, 3])] = covariance[:3, :3]
    out[2, 2] = variance
    return out


def _logarithm(values: npt.NDArray[np.floating]) -> Array:
    given = np.asarray(values, dtype=float)
    return np.log(np.where(given > 0, given, np.nan))


def _spread_over(cells: StopCells, values: Array, over_m: float) -> Array:
    """Return the fine structure of values (n,) of a stop's cells."""
    rows, columns, shape = cells.raster()
    raster = np.full(shape, np.nan, np.float32)
    raster[rows, columns] = values
    return fine_structure(raster, over_m / cells.cell_m)[rows, columns].astype(float)


def _kinds(
    grid: ReliefMap, view: StopView, prior: RelocalisationPrior, options: RelocalisationOptions
) -> list[PoseGrid]:
    """Return the poses scored by each kind of evidence that stop and map have."""
    coarse = grid.coarser(max(1, round(options.search_cell_m / grid.spacing_m)))
    cells = stop_cells(view, coarse.spacing_m, farthest_m=options.farthest_m)
    step = coarse.spacing_m
    over = options.height_over_m
    found = [
        search(
            fine_structure(coarse.heights_m, over / step),
            coarse,
            view.seen.eye[:2],
            cells,
            _spread_over(cells, cells.places[:, 2], over),
            1.0 / (cells.sigma_m**2 + options.map_height_sigma_m**2),
            prior.reach,
            least_share=options.least_share,
        )
    ]
    if coarse.brightness is not None and cells.brightness is not None:
        over = options.brightness_over_m
        found.append(
            search(
                bounded(fine_structure(_logarithm(coarse.brightness), over / step)),
                coarse,
                view.seen.eye[:2],
                cells,
                bounded(_spread_over(cells, _logarithm(cells.brightness), over)),
                np.ones(len(cells.places)),
                prior.reach,
                least_share=options.least_share,
            )
        )
    return [kind for kind in found if kind is not None]


def _most(likelihood: Array, where: npt.NDArray[np.bool_]) -> float:
    """Return the largest likelihood of some poses, minus infinity where none of them is known."""
    return float(np.where(where & np.isfinite(likelihood), likelihood, -np.inf).max())


def _judged(
    both: PoseGrid,
    kinds: list[PoseGrid],
    best: Array,
    near: npt.NDArray[np.bool_],
    false: float,
    prior: RelocalisationPrior,
    options: RelocalisationOptions,
) -> list[RelocalisationRefusal]:
    """Return the rules about the search that fire."""
    found: list[RelocalisationRefusal] = []

    def refuse(fault: RelocalisationFault, message: str) -> None:
        found.append(RelocalisationRefusal(fault, message))

    scored = float(np.isfinite(both.likelihood[BOTH]).mean())
    if scored < options.least_reach:
        refuse(
            RelocalisationFault.OFF_THE_MAP,
            f"{100 * scored:.0f} % of the reach is on the map, limit {100 * options.least_reach:.0f} %",
        )
    tried = math.log(both.likelihood[BOTH].size)
    halves = [_most(both.likelihood[half], near) for half in (FIRST, SECOND)]
    if min(halves) < tried + options.least_evidence:
        refuse(
            RelocalisationFault.NOTHING_ALIKE,
            f"{min(halves):.1f} nats over chance in the weaker half of the stop, limit "
            f"{tried + options.least_evidence:.1f}",
        )
    if false > options.largest_false_probability:
        refuse(
            RelocalisationFault.AMBIGUOUS,
            f"false with probability {false:.2g}, limit {options.largest_false_probability:g}",
        )
    for half, name in ((FIRST, "first"), (SECOND, "second")):
        over = _most(both.likelihood[half], ~near) - halves[half]
        if math.isfinite(over) and over > options.against:
            refuse(
                RelocalisationFault.HALVES_DISAGREE,
                f"the {name} half of the stop likes another place better by {over:.1f} nats, limit "
                f"{options.against:g}",
            )
    for kind in kinds:
        over = _most(kind.likelihood[BOTH], ~near) - _most(kind.likelihood[BOTH], near)
        if math.isfinite(over) and over > options.against + tried:
            refuse(
                RelocalisationFault.KINDS_DISAGREE,
                f"one kind of evidence likes another place better by {over:.1f} nats, limit "
                f"{options.against + tried:.1f}",
            )
    reach = prior.reach
    rim = reach.shift_m - float(np.abs(best[:2]).max()), reach.turn_rad - abs(float(best[2]))
    if rim[0] < options.same_m or rim[1] < 0.5 * options.same_rad:
        refuse(
            RelocalisationFault.AT_THE_RIM,
            f"the best pose is {rim[0]:.1f} m and {math.degrees(rim[1]):.1f} degrees inside the reach, "
            f"limits {options.same_m:g} m and {math.degrees(0.5 * options.same_rad):.2g} degrees",
        )
    return found


def _fitted(
    grid: ReliefMap, view: StopView, best: Array, options: RelocalisationOptions
) -> tuple[PoseFit | None, tuple[float, float] | None]:
    """Return the fit from a pose of the search, and the eye's height with its variance."""
    cells = stop_cells(view, max(options.fit_cell_m, grid.spacing_m), farthest_m=options.farthest_m)
    layers = [Layer(grid.heights_m, cells.places[:, 2], cells.sigma_m, options.height_over_m)]
    if grid.brightness is not None and cells.brightness is not None:
        layers.append(
            Layer(
                _logarithm(grid.brightness).astype(np.float32),
                _logarithm(cells.brightness),
                np.zeros(len(cells.places)),
                options.brightness_over_m,
            )
        )
    start = np.append(view.seen.eye[:2], 0.0) + best
    fit = fit_pose(grid, cells, layers, start, options.fit)
    return fit, None if fit is None else _height(
        grid, cells, fit, 2.0 * options.fit.block_m, 0.5 * options.fit.scene_sigma_m
    )


def _height(
    grid: ReliefMap, cells: StopCells, fit: PoseFit, block_m: float, scene_m: float
) -> tuple[float, float] | None:
    """Return the height of the eye, m, and its variance, from the spread of the blocks' medians."""
    from rover_iface.localization.relocalisation_kernels import read_map

    seen, slopes = np.empty(len(cells.places)), np.empty((len(cells.places), 4))
    place = grid.west_m, grid.south_m, grid.spacing_m
    read_map(grid.heights_m, *place, cells.places, cells.stretch, fit.pose, seen, slopes)
    off = seen - cells.places[:, 2]
    known = np.isfinite(off)
    if not known.any():
        return None
    corner = np.floor(cells.places[known, :2] / block_m).astype(np.int64)
    _, number = np.unique(corner, axis=0, return_inverse=True)
    medians = np.array([np.median(off[known][number == k]) for k in range(int(number.max()) + 1)])
    middle = float(np.median(medians))
    spread = 1.4826 * float(np.median(np.abs(medians - middle)))
    variance = max(spread, 0.01) ** 2 * 1.57 / len(medians)  # of a median, pi / 2 that of a mean
    return middle, variance + scene_m**2


def _judged_fit(
    found: RelocalisedPose, start: Array, options: RelocalisationOptions
) -> list[RelocalisationRefusal]:
    """Return the rules about the fit that fire."""
    refusals = []
    moved = math.hypot(found.east_m - start[0], found.north_m - start[1])
    turned = abs(found.turn_rad - float(start[2]))
    if moved > options.same_m or turned > options.same_rad:
        refusals.append(
            RelocalisationRefusal(
                RelocalisationFault.NOT_HELD,
                f"the fit went {moved:.2f} m and {math.degrees(turned):.1f} degrees from the best pose, "
                f"limits {options.same_m:g} m and {math.degrees(options.same_rad):g} degrees",
            )
        )
    shift = math.sqrt(max(0.0, float(np.linalg.eigvalsh(found.covariance[:2, :2])[-1])))
    turn = math.sqrt(max(0.0, float(found.covariance[3, 3])))
    if shift > options.largest_sigma_m or turn > options.largest_sigma_rad:
        refusals.append(
            RelocalisationRefusal(
                RelocalisationFault.WEAK_GEOMETRY,
                f"pose is known to {shift:.2f} m and {math.degrees(turn):.1f} degrees, limits "
                f"{options.largest_sigma_m:g} m and {math.degrees(options.largest_sigma_rad):.1f} degrees",
            )
        )
    return refusals
