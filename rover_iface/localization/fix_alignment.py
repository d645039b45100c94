"""The site's place of an odometry frame, from several fixes: GNSS or localisation, some of them wrong.

Both frames have their z axis along the vertical, so what is sought is a turn about it and a shift. Fixes that
fit no common answer are named and left out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from rover_iface.errors import LocalizationError

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class FixAlignmentOptions:
    """How fixes are weighed.

    Attributes
    ----------
    false_outlier
        Chance that a good fix is called wrong; 0.001 costs 0.1 % of the fixes and 1 % of the spread.
    most_pairs
        Pairs of fixes tried for a first answer; all pairs of 90 fixes are 4,005.
    most_scored
        Fixes by which a first answer is judged; the final one uses all. 500 tell the share of wrong ones to
        2 %.
    most_fixes
        More are refused: their covariances and residuals are held at once, 0.5 kB each.
    longest_turn_sigma_rad
        A turn known worse than this is refused: the poses lie in one place. 0.5 rad is where the linear
        covariance of a turn stops to mean anything.
    """

    false_outlier: float = 0.001
    most_pairs: int = 4_005
    most_scored: int = 500
    most_fixes: int = 20_000
    longest_turn_sigma_rad: float = 0.5

    def __post_init__(self) -> None:
        if not 0.0 < self.false_outlier < 0.5:
            raise LocalizationError(f"false_outlier is {self.false_outlier:g}; it must lie in 0 to 0.5")
        if self.most_pairs < 1:
            raise LocalizationError(f"most_pairs is {self.most_pairs}; at least 1 is needed")


@dataclass(frozen=True, slots=True)
class FixAlignment:
    """Where the odometry frame lies: site = turn(yaw) odometry + shift.

    Attributes
    ----------
    yaw_rad
        Turn from the odometry frame to the site frame, counter-clockwise.
    shift_m
        Origin of the odometry frame in the site frame (3,); the last is NaN where no fix has a height.
    covariance
        Of (east, north, up, yaw), (4, 4), m and rad; row and column of `up` are NaN with it.
    agrees
        Which fixes were used (n,).
    residuals_m
        Fix minus transformed pose (n, 3).
    distances
        Mahalanobis distance of each residual (n,): of a fix that was left out, from the answer without it.
    """

    yaw_rad: float
    shift_m: Floats
    covariance: Floats
    agrees: Bools
    residuals_m: Floats
    distances: Floats

    def apply(self, poses_m: Floats) -> Floats:
        """Return points (n, 3), m, of the odometry frame in the site frame."""
        return np.asarray(poses_m @ _turn(self.yaw_rad).T + self.shift_m)


@dataclass(frozen=True, slots=True)
class _Pairs:
    """Fixes and poses (n, 3) with covariances (n, 3, 3); a missing height is NaN in the fix."""

    fixes: Floats
    fix_covariance: Floats
    poses: Floats
    pose_covariance: Floats

    @property
    def has_height(self) -> Bools:
        return np.isfinite(self.fixes[:, 2])

    def taken(self, which: Bools) -> _Pairs:
        return _Pairs(
            self.fixes[which], self.fix_covariance[which], self.poses[which], self.pose_covariance[which]
        )


def align_fixes(
    fixes_m: Floats,
    fix_covariance_m2: Floats,
    poses_m: Floats,
    pose_covariance_m2: Floats | None = None,
    *,
    options: FixAlignmentOptions | None = None,
    rng: np.random.Generator | None = None,
) -> FixAlignment:
    """Return turn and shift from the odometry frame to the site frame, with covariance.

    Errors of different fixes and poses are taken as independent; the drift of odometry along a way is not,
    so that `pose_covariance_m2` should be that of the way between fixes.

    Parameters
    ----------
    fixes_m
        Places in the site frame (n, 3), metres; NaN as height where it is not known.
    fix_covariance_m2
        Their covariances (n, 3, 3).
    poses_m, pose_covariance_m2
        The same places in the odometry frame (n, 3), and their covariances (n, 3, 3); none means exact.
    rng
        Draws pairs where there are more than `most_pairs`.

    Raises
    ------
    LocalizationError
        If there are fewer than 3 fixes or too many, no more than half agree, or they lie in one place.

    Notes
    -----
    First answer: the pair of fixes whose turn and shift leave the smallest sum of squared distances, each cut
    at the gate (Torr and Zisserman 2000, MSAC). Then Gauss-Newton on those within the gate until none comes
    or goes. All of it about the middle of poses and fixes: far from the origin the shift is known by the turn
    alone, and the normal matrix about the origin is too close to singular to be inverted. The covariance is
    its inverse at the end, moved to the origin.
    """
    chosen = options or FixAlignmentOptions()
    given = _checked(fixes_m, fix_covariance_m2, poses_m, pose_covariance_m2, chosen.most_fixes)
    pose_middle, fix_middle = given.poses.mean(axis=0), np.append(given.fixes[:, :2].mean(axis=0), 0.0)
    pairs = replace(given, poses=given.poses - pose_middle, fixes=given.fixes - fix_middle)
    flat = chi2.ppf(1.0 - chosen.false_outlier, 2)
    gate = np.where(pairs.has_height, chi2.ppf(1.0 - chosen.false_outlier, 3), flat)
    state = _first_answer(pairs, flat, chosen, rng or np.random.default_rng(0))
    agrees = _distances2(pairs.fixes * [1, 1, np.nan], pairs, state) <= flat
    for _ in range(30):  # each step changes the set or ends; more than ten were never seen
        _require_majority(agrees)
        state, normal = _fit(pairs.taken(agrees), state)
        now = _distances2(pairs.fixes, pairs, state) <= gate
        if (now == agrees).all():
            break
        agrees = now
    _require_majority(agrees)
    state, normal = _fit(pairs.taken(agrees), state)
    covariance = _inverse(normal, chosen.longest_turn_sigma_rad)
    shift = state[:3].copy()
    if not pairs.has_height[agrees].any():
        shift[2] = np.nan
    residuals = pairs.fixes - (pairs.poses @ _turn(state[3]).T + shift)
    distances = np.sqrt(_distances2(pairs.fixes, pairs, state))
    yaw = math.remainder(float(state[3]), 2 * math.pi)
    arm = _turn(yaw) @ pose_middle
    return FixAlignment(yaw, shift + fix_middle - arm, _moved(covariance, arm), agrees, residuals, distances)


def _checked(
    fixes: Floats, covariance: Floats, poses: Floats, pose_covariance: Floats | None, most: int
) -> _Pairs:
    fixes, poses = np.asarray(fixes, dtype=float), np.asarray(poses, dtype=float)
    n = len(fixes)
    if pose_covariance is None:
        pose_covariance = np.zeros((n, 3, 3))
    shapes = fixes.shape, poses.shape, np.shape(covariance), np.shape(pose_covariance)
    if shapes != ((n, 3), (n, 3), (n, 3, 3), (n, 3, 3)):
        raise LocalizationError(
            f"fixes, poses and covariances have the shapes {shapes}; n of each are needed"
        )
    if n < 3:
        raise LocalizationError(
            f"there are {n} fixes with a pose; 3 are needed, as two that differ do not say which is wrong"
        )
    if n > most:
        raise LocalizationError(f"there are {n} fixes with a pose; at most {most} are taken at once")
    if not (np.isfinite(fixes[:, :2]).all() and np.isfinite(poses).all()):
        raise LocalizationError("a fix or pose is not a number")
    known = np.asarray(covariance, dtype=float)
    for k in range(n):
        size = 3 if np.isfinite(fixes[k, 2]) else 2
        block = known[k, :size, :size]
        if not np.isfinite(block).all() or np.linalg.eigvalsh(block)[0] <= 0:
            raise LocalizationError(
                f"the covariance of fix {k + 1} is not positive definite: {block.tolist()}"
            )
    return _Pairs(fixes, known, poses, np.asarray(pose_covariance, dtype=float))


def _turn(yaw: float) -> Floats:
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _require_majority(agrees: Bools) -> None:
    n, good = len(agrees), int(agrees.sum())
    if good < 3 or 2 * good <= n:
        raise LocalizationError(
            f"only {good} of {n} fixes agree with one turn and shift; more than half and 3 are needed "
            "(are their standard deviations too small, or is the odometry bent?)"
        )


def _first_answer(
    pairs: _Pairs, gate: float, options: FixAlignmentOptions, rng: np.random.Generator
) -> Floats:
    """Return (east, north, up, yaw) of the best pair, by the horizontal places."""
    n = len(pairs.fixes)
    if n * (n - 1) // 2 <= options.most_pairs:
        one, two = np.triu_indices(n, 1)
    else:
        one = rng.integers(0, n, options.most_pairs)
        two = (one + rng.integers(1, n, options.most_pairs)) % n
    judges = pairs
    if n > options.most_scored:
        some = np.zeros(n, dtype=bool)
        some[rng.choice(n, options.most_scored, replace=False)] = True
        judges = pairs.taken(some)
    way = pairs.poses[two, :2] - pairs.poses[one, :2]
    seen = pairs.fixes[two, :2] - pairs.fixes[one, :2]
    yaws = np.arctan2(seen[:, 1], seen[:, 0]) - np.arctan2(way[:, 1], way[:, 0])
    best, lowest = np.zeros(4), math.inf
    level = judges.fixes * [1, 1, np.nan]
    for yaw, a, b in zip(yaws, one, two, strict=True):
        turned = pairs.poses[[a, b]] @ _turn(float(yaw)).T
        shift = (pairs.fixes[[a, b], :2] - turned[:, :2]).mean(axis=0)
        state = np.array([shift[0], shift[1], 0.0, yaw])
        cost = float(np.minimum(_distances2(level, judges, state), gate).sum())
        if cost < lowest:
            best, lowest = state, cost
    up = (pairs.fixes - pairs.poses)[:, 2]
    best[2] = float(np.median(up[np.isfinite(up)])) if np.isfinite(up).any() else 0.0
    return best


def _spread(pairs: _Pairs, yaw: float) -> Floats:
    turn = _turn(yaw)
    return np.asarray(pairs.fix_covariance + turn @ pairs.pose_covariance @ turn.T)


def _whitened(fixes: Floats, pairs: _Pairs, state: Floats) -> tuple[Floats, Floats]:
    """Return residuals (n, 3), 0 where there is no height, and information matrices (n, 3, 3)."""
    residual = fixes - (pairs.poses @ _turn(state[3]).T + state[:3])
    spread = _spread(pairs, state[3])
    flat = ~np.isfinite(residual[:, 2])
    information = np.zeros_like(spread)
    information[~flat] = np.linalg.inv(spread[~flat])
    information[flat, :2, :2] = np.linalg.inv(spread[flat, :2, :2])
    return np.nan_to_num(residual), information


def _distances2(fixes: Floats, pairs: _Pairs, state: Floats) -> Floats:
    residual, information = _whitened(fixes, pairs, state)
    return np.einsum("ni,nij,nj->n", residual, information, residual)


def _fit(pairs: _Pairs, start: Floats) -> tuple[Floats, Floats]:
    """Return the least squares answer (4,) and its normal matrix (4, 4)."""
    state = start.copy()
    for _ in range(20):
        residual, information = _whitened(pairs.fixes, pairs, state)
        jacobian = np.zeros((len(residual), 3, 4))
        jacobian[:, :, :3] = np.eye(3)
        turned = pairs.poses @ _turn(state[3]).T
        jacobian[:, 0, 3], jacobian[:, 1, 3] = -turned[:, 1], turned[:, 0]
        normal = np.einsum("nki,nkl,nlj->ij", jacobian, information, jacobian)
        right = np.einsum("nki,nkl,nl->i", jacobian, information, residual)
        step = np.linalg.pinv(normal) @ right
        state = state + step
        if float(np.abs(step).max()) < 1e-10:
            break
    return state, np.asarray(normal)


def _inverse(normal: Floats, longest_turn_sigma_rad: float) -> Floats:
    """Return the covariance (4, 4) of a normal matrix; NaN for `up` where nothing tells it.

    Raises
    ------
    LocalizationError
        If the turn is not known, or worse than the limit.
    """
    keep = [0, 1, 2, 3] if normal[2, 2] > 0 else [0, 1, 3]
    told = normal[np.ix_(keep, keep)]
    across = np.linalg.solve(told[:-1, :-1], told[:-1, -1])
    turn = float(told[-1, -1] - told[-1, :-1] @ across)  # what is known of the turn beside an unknown shift
    if not turn * longest_turn_sigma_rad**2 >= 1.0:
        known = f"to {math.degrees(1 / math.sqrt(turn)):.0f} degrees only" if turn > 0 else "not at all"
        raise LocalizationError(
            f"the turn is known {known}: the poses lie too close together for their fixes; at most "
            f"{math.degrees(longest_turn_sigma_rad):.0f} degrees are taken"
        )
    covariance = np.full((4, 4), np.nan)
    covariance[np.ix_(keep, keep)] = np.linalg.inv(told)
    return covariance


def _moved(covariance: Floats, arm: Floats) -> Floats:
    """Return a covariance (4, 4) counted from the origin; it was counted from `arm` [3], m, site axes."""
    move = np.eye(4)
    move[0, 3], move[1, 3] = arm[1], -arm[0]
    unknown = np.isnan(covariance)
    moved = move @ np.nan_to_num(covariance) @ move.T
    moved[unknown] = np.nan
    return np.asarray(moved)
