"""Two clouds of one place registered to each other: what the mast's pair ranges, brought to what the hazcams
range.

The mast is never quite where it is believed to be, and its pair comes out of calibration. So the second
cloud is turned about its eye, shifted and stretched along its lines of sight (that is what an error of all
disparities does) until the first lies on its surface: iterated closest points, point to plane (Chen and
Medioni 1992), robust, with priors for each of the seven numbers, so that flat ground, which tells only three
of them, leaves the rest as believed. A smooth rock fits itself in more than one place, and there the
brightness of the surface decides.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from rover_iface.errors import PlacementError
from rover_iface.frames import Transform
from rover_iface.placement.cloud import Array, SurfaceCloud
from rover_iface.placement.cloud_edges import away_from_edges
from rover_iface.placement.cloud_texture import tie as texture_tie
from rover_iface.vision.sift_motion import small_rotation

Index = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class AlignmentOptions:
    """Parameters of the alignment.

    Attributes
    ----------
    turn_rad, shift_m, stretch_per_m
        One deviation of what the second eye may be off: turn about it, shift, and share of the range for each
        metre of it.
    reaches_m
        Points farther than this from the other surface are left out, in turn; many turns with the far ones,
        because rough rocks have more than one place where they nearly fit.
    samples, posts, neighbours
        Points of the first cloud, places of the second where its surface is known, and how many points tell
        the plane there: planes of a few points bear the noise of stereo, and the cloud ends up beside its
        place.
    patch_px
        Side of the patch of the first cloud that shares one error, pixels.
    tied_reaches_m, tie_m
        Where the brightness of both tells how far the second lies beside its place (`cloud_texture`), turns
        after that, and one deviation of it. Closest points hold to their place harder than they know it: by
        0.7 mm it stayed 0.9 mm off in the median, by 0.3 mm 0.5 (20 rocks, 44300 to 44316, 45000 to 45003).
    most_residual_m, least_overlap, most_sigma_m
        An alignment is believed if the robust deviation between the surfaces is at most the first, this
        share of the samples within the last reach, and the second cloud's middle known to the third.
    """

    turn_rad: float = 0.02
    shift_m: float = 0.002
    stretch_per_m: float = 0.01
    reaches_m: tuple[float, ...] = (*[0.12] * 4, *[0.08] * 6, *[0.06] * 5, *[0.04] * 4, *[0.02] * 3)
    tied_reaches_m: tuple[float, ...] = (*[0.04] * 3, *[0.02] * 5)
    tie_m: float = 0.0003
    samples: int = 4000
    posts: int = 5000
    neighbours: int = 100
    patch_px: float = 9.0
    most_residual_m: float = 0.005
    least_overlap: float = 0.6
    most_sigma_m: float = 0.0022

    def __post_init__(self) -> None:
        for name in ("turn_rad", "shift_m", "stretch_per_m", "samples", "posts", "neighbours"):
            if not getattr(self, name) > 0:
                raise PlacementError(f"alignment: {name} is {getattr(self, name)}; it must be positive")


@dataclass(frozen=True, eq=False)
class Alignment:
    """A second cloud registered to a first.

    Attributes
    ----------
    cloud
        The second one in the frame of the first.
    motion, stretch_per_m
        What was done to it: stretched by this share of the range for each metre of it, then moved.
    residual_m
        Robust deviation between the surfaces.
    overlap
        Share of the first cloud's samples, of those that the second eye's frame holds, that have a surface of
        the second cloud nearby.
    sigma_m
        How far the middle of the second cloud may be off, one deviation of the worst direction.
    """

    cloud: SurfaceCloud
    motion: Transform
    stretch_per_m: float
    residual_m: float
    overlap: float
    sigma_m: float

    def believed(self, options: AlignmentOptions | None = None) -> bool:
        """Return whether the second cloud may be used."""
        options = options or AlignmentOptions()
        return (
            self.residual_m <= options.most_residual_m
            and self.overlap >= options.least_overlap
            and self.sigma_m <= options.most_sigma_m
        )

    def as_dict(self) -> dict[str, float]:
        """Return the JSON form of how well it was laid."""
        return {"residual_m": self.residual_m, "overlap": self.overlap, "sigma_m": self.sigma_m}


def align(
    second: SurfaceCloud, first: SurfaceCloud, options: AlignmentOptions | None = None
) -> Alignment | None:
    """Return the second cloud registered to the first, None where they have too little in common.

    Raises
    ------
    PlacementError
        If the second cloud has no eye.
    """
    options = options or AlignmentOptions()
    if second.eye is None:
        raise PlacementError("the cloud that is to be aligned has no eye")
    chosen = _samples(first, second, options)
    if len(chosen) < LEAST_POINTS or len(second) < LEAST_POINTS:
        return None
    # samples of one patch share their error
    worth = min(1.0, len(first) / options.patch_px**2 / len(chosen))
    surfaces = _Surfaces(
        second.eye, *_posts(second, options), first.points[chosen], first.covariances[chosen], worth
    )
    fit = _turns(surfaces, np.zeros(7), options.reaches_m, options)
    if fit is None:
        return None
    found = texture_tie(_laid(second, fit.motion)[0], first)
    if found is not None:
        tied = _Tied(second.points[found.number] - second.eye, found.place - second.eye, found.along)
        fit = _turns(surfaces, fit.motion, options.tied_reaches_m, options, tied) or fit
    cloud, motion = _laid(second, fit.motion)
    return Alignment(
        cloud,
        motion,
        float(fit.motion[6]),
        fit.residual_m,
        fit.overlap,
        _middle_sigma(second.points.mean(axis=0) - second.eye, np.asarray(np.linalg.inv(fit.information))),
    )


LEAST_POINTS = 50
"""Of either cloud, and of samples that meet a surface."""


@dataclass(frozen=True, eq=False)
class _Surfaces:
    """The second eye (3,), places of its surface (n, 3) and the normals there (n, 3), samples of the first
    cloud (k, 3), their covariances (k, 3, 3), and what each counts.
    """

    eye: Array
    posts: Array
    normals: Array
    fixed: Array
    spread: Array
    worth: float


@dataclass(frozen=True, eq=False)
class _Tied:
    """A place (3,) of the second cloud and where it belongs (3,), both from its eye, m, and the directions
    (2, 3) along which that is known.
    """

    way: Array
    belongs: Array
    along: Array

    def rows(self, p: Array) -> tuple[Array, Array]:
        """Return how the place changes with each of the seven numbers (2, 7), and what it is off (2,), m."""
        length = float(np.linalg.norm(self.way))
        there = (1.0 + p[6] * length) * (small_rotation(p[:3]) @ self.way) + p[3:6]
        change = np.column_stack((np.cross(there, self.along), self.along, length * (self.along @ there)))
        return change, np.asarray(self.along @ (self.belongs - there))


@dataclass(frozen=True, eq=False)
class _Fit:
    """Turn, shift and stretch (7,), their information (7, 7), and how well the surfaces meet."""

    motion: Array
    information: Array
    residual_m: float
    overlap: float


def _turns(
    surfaces: _Surfaces,
    start: Array,
    reaches_m: tuple[float, ...],
    options: AlignmentOptions,
    tied: _Tied | None = None,
) -> _Fit | None:
    """Return what closest points make of the motion from `start` (7,), None where too few meet."""
    from scipy.spatial import cKDTree

    eye, posts, fixed = surfaces.eye, surfaces.posts, surfaces.fixed
    prior = 1.0 / np.array(
        3 * [options.turn_rad] + 3 * [options.shift_m] + [options.stretch_per_m], dtype=np.float64
    )
    p = start
    information: Array = np.diag(prior**2)
    residual, overlap = math.inf, 0.0
    for reach in reaches_m:
        turn = small_rotation(p[:3])
        laid = (
            (posts - eye) * (1.0 + p[6] * np.linalg.norm(posts - eye, axis=1))[:, None] @ turn.T
            + eye
            + p[3:6]
        )
        facing = surfaces.normals @ turn.T
        far, near = cKDTree(laid).query(fixed)
        off = ((fixed - laid[near]) * facing[near]).sum(axis=1)
        use = (far < reach + 0.01) & (np.abs(off) < reach)
        overlap = float(use.mean())
        if use.sum() < LEAST_POINTS:
            return None
        n, q, r = facing[near[use]], laid[near[use]] - eye, off[use]
        residual = max(1.4826 * float(np.median(np.abs(r - np.median(r)))), 1e-4)
        # the first cloud errs along its own lines of sight
        expected = np.einsum("ni,nij,nj->n", n, surfaces.spread[use], n) + 1e-6
        share = 1.4826**2 * float(np.median(r**2 / expected))
        weight = surfaces.worth / (share * expected + (r / 2.0) ** 2)
        along = (q * n).sum(axis=1) * np.linalg.norm(q, axis=1)
        jacobian = np.column_stack((np.cross(q, n), n, along))
        information = np.asarray(jacobian.T @ (weight[:, None] * jacobian) + np.diag(prior**2))
        gain = jacobian.T @ (weight * r) - prior**2 * p
        if tied is not None:
            change, away = tied.rows(p)
            information = information + change.T @ change / options.tie_m**2
            gain = gain + change.T @ away / options.tie_m**2
        p = p + np.linalg.solve(information, gain)
    return _Fit(p, information, residual, overlap)


def _laid(second: SurfaceCloud, p: Array) -> tuple[SurfaceCloud, Transform]:
    """Return the second cloud stretched and moved by seven numbers (7,), and that motion."""
    assert second.eye is not None
    turn = small_rotation(p[:3])
    motion = Transform(turn, second.eye + p[3:6] - turn @ second.eye)
    return _stretched(second, float(p[6])).moved(motion, up=second.up), motion


def _samples(first: SurfaceCloud, second: SurfaceCloud, options: AlignmentOptions) -> Index:
    """Return points (n,) of the first cloud, away from edges, where the second eye looked."""
    assert second.eye is not None
    trusted = np.flatnonzero(away_from_edges(first, 3, 0.035))
    ways = second.points - second.eye
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    middle = ways.mean(axis=0)
    middle /= np.linalg.norm(middle)
    widest = float(np.quantile(ways @ middle, 0.1))
    sight = first.points[trusted] - second.eye
    inside = trusted[(sight @ middle) / np.linalg.norm(sight, axis=1) > widest]
    return _drawn(inside, options.samples)


def _posts(second: SurfaceCloud, options: AlignmentOptions) -> tuple[Array, Array]:
    """Return places (n, 3) on the second cloud's surface and the normals there, from its nearest points."""
    trusted = np.flatnonzero(away_from_edges(second, 2, 0.035))
    chosen = _drawn(trusted, options.posts)
    near = second.tree.query(second.points[chosen], options.neighbours)[1]
    around = second.points[np.minimum(near, len(second) - 1)]
    middle = around.mean(axis=1)
    away = around - middle[:, None]
    normals = np.linalg.eigh(np.einsum("nki,nkj->nij", away, away))[1][:, :, 0]
    return middle, normals


def _drawn(index: Index, count: int) -> Index:
    if len(index) <= count:
        return index
    return np.asarray(np.random.default_rng(0).choice(index, count, replace=False))


def _stretched(cloud: SurfaceCloud, stretch_per_m: float) -> SurfaceCloud:
    """Return the cloud with ranges changed by this share for each metre of them."""
    assert cloud.eye is not None
    way = cloud.points - cloud.eye
    return replace(
        cloud,
        points=cloud.eye + way * (1.0 + stretch_per_m * np.linalg.norm(way, axis=1))[:, None],
    )


def _middle_sigma(middle: Array, covariance: Array) -> float:
    """Return the largest deviation of a place (3,), seen from the eye, by that of turn, shift and stretch."""
    x, y, z = middle
    turned = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])
    moved = np.column_stack((turned, np.eye(3), middle * np.linalg.norm(middle)))
    return math.sqrt(float(np.linalg.eigvalsh(moved @ covariance @ moved.T)[-1]))
