"""Which rock of one stop is which of another, seen from the other side, and how the stops lie.

The pose of one stop in the other's frame is taken as unknown within a prior, in shift and in heading. Every
pose is scored by the log likelihood ratio of the rocks seen: each rock of the second stop is either one of
the first (stereo's own covariance, sizes alike) or has no counterpart. All poses of the prior are scored on a
raster, the best are refined, and what each of them weighs, its likelihood times its volume, says how
probable it is that the best is the wrong one. Pairs are one to one and kept when they are probably right.

This replaces the published scheme, which counts equal shifts and compares sizes and stands in
`studies.common.published_matching`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_iface.errors import LocalizationError
from rover_iface.localization.seen_rock import SeenRock

Array = npt.NDArray[np.float64]


BIAS_PX = 0.05
"""Error of disparity that all rocks of a stop share, px: twice the 0.02 that rendered pairs have on rocks
(`python -m studies.localization --only noise`), and a little for a rig that is not rendered."""


@dataclass(frozen=True, slots=True)
class LegPrior:
    """What odometry and heading say of a leg: the pose of the second stop's frame in the first's.

    Attributes
    ----------
    x_m, y_m, z_m, heading_rad
        Shift and turn of the second frame, whose origin is where the second stop was.
    sigma_m, sigma_z_m, sigma_heading_rad
        Standard deviations.
    """

    x_m: float
    y_m: float
    z_m: float
    heading_rad: float
    sigma_m: float = 1.3
    sigma_z_m: float = 0.5
    sigma_heading_rad: float = math.radians(3.0)

    def __post_init__(self) -> None:
        values = (
            self.x_m,
            self.y_m,
            self.z_m,
            self.heading_rad,
            self.sigma_m,
            self.sigma_z_m,
            self.sigma_heading_rad,
        )
        if not all(map(math.isfinite, values)):
            raise LocalizationError("the prior of a leg has a value that is not finite")
        if not (self.sigma_m > 0 and self.sigma_z_m > 0 and self.sigma_heading_rad > 0):
            raise LocalizationError(
                f"the prior of a leg has deviations {self.sigma_m} m, {self.sigma_z_m} m, "
                f"{self.sigma_heading_rad} rad; all must be positive"
            )

    @property
    def length_m(self) -> float:
        """Return the straight length of the leg."""
        return math.hypot(self.x_m, self.y_m)


@dataclass(frozen=True, slots=True)
class MatchingOptions:
    """Parameters of the matching.

    Attributes
    ----------
    farthest_m
        Rocks farther from either stop take no part.
    detected
        The odds that a rock of one stop, if it is one, is among those of the other.
    log_height_sigma, log_width_sigma
        How the sizes of one rock seen from two sides differ, in natural logarithms.
    modes, most_rocks
        Best poses of the raster that are refined; rocks of each stop, the surest, scored on the raster. Of a
        hundred rocks a stop the thirty surest are not the same ones seen from the other side, and then every
        pose of the raster seems to fit.
    bias_px, range_factor
        Error of disparity that all rocks of a stop share, and focal length times base, px m.
    shift_step_m, turn_step_rad
        Raster of poses.
    reach_sigma
        How far the raster reaches, in deviations of the prior.
    least_pair, least_shown
        A pair is kept when, the pose being right, it is right with this probability; one that is less sure,
        down to the second, is told of as rejected.
    sharpness
        What a log likelihood ratio counts; below 1 the verdict is more careful than the model.
    """

    farthest_m: float = 24.0
    detected: float = 0.75
    log_height_sigma: float = 0.27
    log_width_sigma: float = 0.43
    shift_step_m: float = 0.35
    turn_step_rad: float = math.radians(1.1)
    reach_sigma: float = 3.0
    least_pair: float = 0.87
    least_shown: float = 0.1
    sharpness: float = 1.0
    modes: int = 12
    most_rocks: int = 100
    bias_px: float = BIAS_PX
    range_factor: float = 235.4


@dataclass(frozen=True, eq=False, slots=True)
class RockPair:
    """A rock of the first stop and the one of the second that it is, and how probably so."""

    first: int
    second: int
    probability: float


@dataclass(frozen=True, eq=False, slots=True)
class RockMatch:
    """The result for one leg.

    Attributes
    ----------
    pairs
        The most probable first.
    rejected
        Pairs that the pose brings together and that were not sure enough to keep, likewise.
    x_m, y_m, z_m, heading_rad
        Second frame in the first by the pairs; the prior's when there are none.
    covariance
        [4, 4] of these, m and rad.
    false_probability
        That the pose is wrong altogether: the weight of all other poses of the prior.
    chi2_per_pair
        Mean squared normalised distance of the pairs; 3 is expected.
    overlap
        Rocks of the first and of the second stop that lie within reach of both.
    """

    pairs: tuple[RockPair, ...]
    x_m: float
    y_m: float
    z_m: float
    heading_rad: float
    covariance: Array
    false_probability: float
    chi2_per_pair: float
    overlap: tuple[int, int]
    rejected: tuple[RockPair, ...] = ()


@dataclass(slots=True)
class _Rocks:
    xyz: Array
    cov: Array
    log_height: Array
    log_width: Array
    probability: Array
    index: npt.NDArray[np.int64]

    @staticmethod
    def of(rocks: Sequence[SeenRock], chosen: npt.NDArray[np.int64], origin: Array) -> _Rocks:
        part = [rocks[k] for k in chosen]
        return _Rocks(
            np.array([r.position for r in part]).reshape(-1, 3) - origin,
            np.array([r.covariance for r in part]).reshape(-1, 3, 3),
            np.log([max(r.height_m, 1e-3) for r in part]),
            np.log([max(r.width_m, 1e-3) for r in part]),
            np.array([r.probability for r in part], dtype=float),
            chosen,
        )

    def surest(self, count: int) -> npt.NDArray[np.int64]:
        """Return which are the most probably rocks."""
        return np.sort(np.argsort(-self.probability, kind="stable")[:count])

    @property
    def flat_cov(self) -> Array:
        return np.column_stack((self.cov[:, 0, 0], self.cov[:, 0, 1], self.cov[:, 1, 1]))


def overlapping(rocks: Sequence[SeenRock], other_eye: Array, farthest_m: float) -> npt.NDArray[np.int64]:
    """Return the indices of rocks that lie within reach of both their own stop and the other one.

    `other_eye` [3], m, is the other stop in the frame of the rocks; its height does not count. Between the
    stops 2 m are allowed for what their poses are off.
    """
    return np.array(
        [
            k
            for k, rock in enumerate(rocks)
            if rock.range_m <= farthest_m and math.hypot(*(rock.position - other_eye)[:2]) <= farthest_m + 2.0
        ],
        dtype=np.int64,
    )


def match_rocks(
    first: Sequence[SeenRock],
    second: Sequence[SeenRock],
    prior: LegPrior,
    options: MatchingOptions | None = None,
) -> RockMatch:
    """Return which rocks two stops have in common and the pose that follows.

    Rocks of each stop are in its own frame: level, z up, its origin at the stop.
    """
    from rover_iface.localization import matching_kernels as kernels

    options = options or MatchingOptions()
    there = np.array([prior.x_m, prior.y_m, prior.z_m])
    c, s = math.cos(prior.heading_rad), math.sin(prior.heading_rad)
    back = np.array([-c * there[0] - s * there[1], s * there[0] - c * there[1], -there[2]])
    a = _Rocks.of(first, overlapping(first, there, options.farthest_m), np.zeros(3))
    b = _Rocks.of(second, overlapping(second, back, options.farthest_m), np.zeros(3))
    overlap = len(a.index), len(b.index)
    coarse_a, coarse_b = a.surest(options.most_rocks), b.surest(options.most_rocks)
    nothing = RockMatch(
        (), prior.x_m, prior.y_m, prior.z_m, prior.heading_rad, _prior_covariance(prior), 1.0, 0.0, overlap
    )
    if min(overlap) < 2:
        return nothing
    gain = _size_gain(a, b, options) + np.log(a.probability)[:, None]
    clutter = _log_clutter(a)
    detected = options.detected * b.probability
    coarse_gain, coarse_clutter = gain[np.ix_(coarse_a, coarse_b)], clutter[coarse_a]
    reach = options.reach_sigma * prior.sigma_m
    shifts = np.arange(-reach, reach + 1e-9, options.shift_step_m)
    turns = np.arange(
        -options.reach_sigma * prior.sigma_heading_rad,
        options.reach_sigma * prior.sigma_heading_rad + 1e-9,
        options.turn_step_rad,
    )
    table = np.empty((len(turns), len(shifts), len(shifts)))
    for k, turn in enumerate(turns):
        terms = kernels.pair_terms(
            *a.xyz[coarse_a, :2].T,
            *b.xyz[coarse_b, :2].T,
            a.flat_cov[coarse_a],
            b.flat_cov[coarse_b],
            prior.heading_rad + turn,
            options.shift_step_m**2 / 6,
            options.turn_step_rad**2 / 6,
        )
        table[k] = kernels.score_shifts(
            *terms,
            coarse_gain,
            coarse_clutter,
            detected[coarse_b],
            prior.x_m + shifts,
            prior.y_m + shifts,
            12.0,
        )
    table *= options.sharpness
    table -= 0.5 * (turns[:, None, None] / prior.sigma_heading_rad) ** 2
    table -= 0.5 * (shifts[None, :, None] ** 2 + shifts[None, None, :] ** 2) / prior.sigma_m**2
    best = _modes(table, options.modes)
    refined = [
        _refine(
            np.array([prior.x_m + shifts[i], prior.y_m + shifts[j], prior.heading_rad + turns[k]]),
            a,
            b,
            gain,
            clutter,
            prior,
            options,
        )
        for k, i, j in best
    ]
    refined.sort(key=lambda mode: -mode.weight)
    distinct: list[_Mode] = []
    for mode in refined:
        if all(_differ(mode.pose, other.pose) for other in distinct):
            distinct.append(mode)
    top = distinct[0]
    share = 1.0 / sum(math.exp(mode.weight - top.weight) for mode in distinct)
    # the rest of the raster, where nothing stands out, weighs too
    share = min(share, _raster_share(table, best[0]))
    return _result(top, share, a, b, prior, options, overlap)


def _prior_covariance(prior: LegPrior) -> Array:
    return np.diag([prior.sigma_m**2, prior.sigma_m**2, prior.sigma_z_m**2, prior.sigma_heading_rad**2])


def _size_gain(a: _Rocks, b: _Rocks, options: MatchingOptions) -> Array:
    """Return the log ratio [n, m] of sizes alike by being one rock and alike by chance."""
    gain = np.zeros((len(a.index), len(b.index)))
    for one, two, sigma in (
        (a.log_height, b.log_height, options.log_height_sigma),
        (a.log_width, b.log_width, options.log_width_sigma),
    ):
        mean, spread = float(one.mean()), max(float(one.std()), 0.3)
        alike = -0.5 * ((one[:, None] - two[None]) / sigma) ** 2 - math.log(sigma)
        chance = -0.5 * ((one[:, None] - mean) / spread) ** 2 - math.log(spread)
        gain += np.clip(alike - chance, -6.0, 3.0)
    return gain


def _log_clutter(a: _Rocks) -> Array:
    """Return the log density of rocks, 1 / m2, round each rock of the first stop."""
    apart = np.hypot(a.xyz[:, None, 0] - a.xyz[None, :, 0], a.xyz[:, None, 1] - a.xyz[None, :, 1])
    count = ((apart < 3.0) * a.probability).sum(axis=1)
    return np.log(np.maximum(count, FEWEST_NEAR) / (math.pi * 9.0))


def _modes(table: Array, count: int) -> list[tuple[int, int, int]]:
    from scipy.ndimage import maximum_filter

    peaks = np.flatnonzero((maximum_filter(table, size=3, mode="nearest") == table).ravel())
    order = peaks[np.argsort(-table.ravel()[peaks])][:count]
    places = zip(*np.unravel_index(order, table.shape), strict=True)
    return [(int(k), int(i), int(j)) for k, i, j in places]


def _raster_share(table: Array, best: tuple[int, int, int]) -> float:
    """Return the share of the raster's weight within three steps of its best cell."""
    weight = np.exp(table - table[best])
    near = tuple(slice(max(0, v - r), v + r + 1) for v, r in zip(best, (3, 4, 4), strict=True))
    return float(weight[near].sum() / weight.sum())


def _differ(one: Array, two: Array) -> bool:
    return bool(math.hypot(*(one - two)[:2]) > 0.6 or abs(one[2] - two[2]) > math.radians(2.0))


@dataclass(slots=True)
class _Mode:
    pose: Array
    z: float
    weight: float
    posterior: Array


FEWEST_NEAR = 0.5
"""Rocks within 3 m of any, at least: how thinly a place can be strewn is not known better."""

NEAR_M = 4.0
"""Rocks farther apart than this after the move are not weighed as one: over five deviations of any pair."""


@dataclass(slots=True)
class _Terms:
    """Possible pairs under a pose: rock i of the first stop and j of the second.

    `odds` [p] of being one rock, `offset` [p, 3], `inverse` covariances [p, 3, 3].
    """

    i: npt.NDArray[np.int64]
    j: npt.NDArray[np.int64]
    odds: Array
    offset: Array
    inverse: Array


def _terms(
    pose: Array, z: float | None, a: _Rocks, b: _Rocks, gain: Array, clutter: Array, options: MatchingOptions
) -> _Terms:
    c, s = math.cos(pose[2]), math.sin(pose[2])
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    moved = b.xyz @ turn.T + np.array([pose[0], pose[1], 0.0 if z is None else z])
    apart = np.hypot(
        a.xyz[:, None, 0] - moved[None, :, 0],
        a.xyz[:, None, 1] - moved[None, :, 1],
    )
    i, j = np.nonzero(apart < NEAR_M)
    offset = a.xyz[i] - moved[j]
    cov = a.cov[i] + (turn @ b.cov @ turn.T)[j]
    if z is None:
        inverse = np.zeros_like(cov)
        inverse[:, :2, :2] = np.linalg.inv(cov[:, :2, :2])
        logdet = np.log(np.linalg.det(cov[:, :2, :2])) + 2 * math.log(2 * math.pi)
    else:
        inverse = np.linalg.inv(cov)
        logdet = np.log(np.linalg.det(cov)) + 3 * math.log(2 * math.pi)
        logdet = logdet - math.log(2 * math.pi * 0.25**2)  # against heights that spread by chance
    far = np.einsum("pi,pij,pj->p", offset, inverse, offset)
    level = gain[i, j] - clutter[i] - 0.5 * logdet - 0.5 * far
    detected = options.detected * b.probability[j]
    odds = np.where(far > 25.0, 0.0, detected * np.exp(np.clip(level, -60, 60)))
    return _Terms(i, j, odds, offset, inverse)


def _refine(
    pose: Array, a: _Rocks, b: _Rocks, gain: Array, clutter: Array, prior: LegPrior, options: MatchingOptions
) -> _Mode:
    """Return the mode next to a pose: association odds and least squares in turn."""
    z: float | None = None
    start = np.array([prior.x_m, prior.y_m, prior.heading_rad])
    held = np.diag([prior.sigma_m**-2, prior.sigma_m**-2, prior.sigma_heading_rad**-2])
    normal = held.copy()
    count = len(b.index)
    alone = 1.0 - options.detected * b.probability
    for turn in range(10):
        pairs = _terms(pose, z, a, b, gain, clutter, options)
        total = alone + np.bincount(pairs.j, weights=pairs.odds, minlength=count)
        posterior = pairs.odds / total[pairs.j]
        if turn == 1 and posterior.sum() > 0.5:
            z = _weighted_median(pairs.offset[:, 2], posterior)
            continue
        c, s = math.cos(pose[2]), math.sin(pose[2])
        x, y = c * b.xyz[:, 0] - s * b.xyz[:, 1], s * b.xyz[:, 0] + c * b.xyz[:, 1]
        jac = np.zeros((len(pairs.j), 3, 3))
        jac[:, 0, 0] = jac[:, 1, 1] = 1.0
        jac[:, 0, 2], jac[:, 1, 2] = -y[pairs.j], x[pairs.j]
        info = posterior[:, None, None] * pairs.inverse
        weighted = np.swapaxes(jac, 1, 2) @ info
        normal = held + (weighted @ jac).sum(axis=0)
        right = held @ (start - pose) + (weighted @ pairs.offset[:, :, None]).sum(axis=0)[:, 0]
        step = np.linalg.solve(normal, right)
        pose = pose + step
        if z is not None:
            wz = info[:, 2, 2]
            z += float((wz * pairs.offset[:, 2]).sum() / (wz.sum() + prior.sigma_z_m**-2))
        if turn > 2 and np.abs(step).max() < 1e-4:
            break
    pairs = _terms(pose, z, a, b, gain, clutter, options)
    total = alone + np.bincount(pairs.j, weights=pairs.odds, minlength=count)
    away = pose - start
    weight = options.sharpness * float(np.log(total).sum()) - 0.5 * float(away @ held @ away)
    weight -= 0.5 * float(np.linalg.slogdet(normal)[1])
    posterior = np.zeros((len(a.index), count))
    posterior[pairs.i, pairs.j] = pairs.odds / total[pairs.j]
    return _Mode(pose, prior.z_m if z is None else z, weight, posterior)


def _weighted_median(values: Array, weights: Array) -> float:
    order = np.argsort(values)
    sums = np.cumsum(weights[order])
    return float(values[order[np.searchsorted(sums, 0.5 * sums[-1])]])


def _result(
    top: _Mode,
    share: float,
    a: _Rocks,
    b: _Rocks,
    prior: LegPrior,
    options: MatchingOptions,
    overlap: tuple[int, int],
) -> RockMatch:
    from scipy.optimize import linear_sum_assignment

    rows, columns = linear_sum_assignment(-top.posterior)
    row_total = top.posterior.sum(axis=1)
    pairs, rejected = [], []
    for i, j in zip(rows, columns, strict=True):
        # a rock of the first stop that two of the second want is certain of neither
        given_pose = float(top.posterior[i, j] / max(1.0, row_total[i]))
        if given_pose >= options.least_pair:
            pairs.append((given_pose * share, int(i), int(j)))
        elif given_pose >= options.least_shown:
            rejected.append((given_pose * share, int(i), int(j)))
    pairs.sort(reverse=True)
    rejected.sort(reverse=True)
    pose, z, covariance, chi2 = _fit(pairs, top, a, b, prior, options)
    return RockMatch(
        tuple(RockPair(int(a.index[i]), int(b.index[j]), p) for p, i, j in pairs),
        float(pose[0]),
        float(pose[1]),
        z,
        float(pose[2]),
        covariance,
        1.0 - share,
        chi2,
        overlap,
        tuple(RockPair(int(a.index[i]), int(b.index[j]), p) for p, i, j in rejected),
    )


def _fit(
    pairs: list[tuple[float, int, int]],
    top: _Mode,
    a: _Rocks,
    b: _Rocks,
    prior: LegPrior,
    options: MatchingOptions,
) -> tuple[Array, float, Array, float]:
    """Return pose (x, y, heading), z, covariance [4, 4] (x, y, z, heading) and chi2 per pair."""
    x = np.array([top.pose[0], top.pose[1], top.z, top.pose[2]])
    start = np.array([prior.x_m, prior.y_m, prior.z_m, prior.heading_rad])
    held = np.linalg.inv(_prior_covariance(prior))
    normal, chi2 = held, 0.0
    if not pairs:
        return start[[0, 1, 3]], float(start[2]), _prior_covariance(prior), 0.0
    i = np.array([pair[1] for pair in pairs])
    j = np.array([pair[2] for pair in pairs])
    for _ in range(5):
        c, s = math.cos(x[3]), math.sin(x[3])
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        rotated = b.xyz[j] @ turn.T
        rest = a.xyz[i] - rotated - x[:3]
        info = np.linalg.inv(a.cov[i] + turn @ b.cov[j] @ turn.T)
        jac = np.zeros((len(pairs), 3, 4))
        jac[:, 0, 0] = jac[:, 1, 1] = jac[:, 2, 2] = 1.0
        jac[:, 0, 3], jac[:, 1, 3] = -rotated[:, 1], rotated[:, 0]
        normal = held + np.einsum("pki,pkl,plj->ij", jac, info, jac)
        right = held @ (start - x) + np.einsum("pki,pkl,pl->i", jac, info, rest)
        x = x + np.linalg.solve(normal, right)
        chi2 = float(np.einsum("pi,pij,pj->", rest, info, rest)) / len(pairs)
    covariance = np.linalg.inv(normal)
    # what a stereo pair's own bias does to all rocks of a stop does not average out
    for ranged, sign, rotation in ((a.xyz[i], 1.0, np.eye(3)), (b.xyz[j], -1.0, turn)):
        away = np.linalg.norm(ranged, axis=1, keepdims=True)
        moved = sign * (ranged * away / options.range_factor) @ rotation.T
        shift = options.bias_px * covariance @ np.einsum("pki,pkl,pl->i", jac, info, moved)
        covariance = covariance + np.outer(shift, shift)
    return x[[0, 1, 3]], float(x[2]), covariance, chi2
