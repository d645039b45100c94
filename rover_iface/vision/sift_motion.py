"""The rigid motion between two stops from matched, ranged features, and how sure it is.

Deans, Kunz, Sargent and others 2005: 100 draws of three matches, Horn's method, consensus within 3 cm, refit
until the consensus is stable; covariance by bootstrap. Kept as `method="published"`.

The shipped method differs in three ways, because stereo at ten metres errs by decimetres along the ray and by
millimetres across it. Consensus is told in the images. The motion minimises image residuals weighted by what
both pairs can know: the residual of a match has the covariance sigma^2 (I + J R P R^T J^T), P being that of
the old point for one pixel. And the covariance comes from those residuals, one by one and by part of the
image; bootstrap over points that carry their errors along with them cannot see those errors.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.model import Array, CameraModel
from rover_iface.frames import Transform
from rover_iface.vision.sift_features import Features
from rover_iface.vision.tracker import StereoView

Mask = npt.NDArray[np.bool_]
Cameras = tuple[CameraModel, ...]
LEAST_SHARE = 0.35
"""Share of the matches below which a consensus may be that of a thing that moves by itself."""


@dataclass(frozen=True, eq=False)
class Motion:
    """How the rover's idea of the site has moved between two stops.

    Attributes
    ----------
    new_from_old
        Where points believed at the earlier stop are believed now.
    covariance
        (6, 6): turn (3, radians, about `centre`) and shift (3, metres).
    inliers, matches
        How many features agree, of how many.
    points, pixels
        (n, 3) and (n, 2): those that agree, now, and where the left image shows them.
    residual_px
        Root mean square of what they disagree by, pixels.
    doubtful
        Whether dead reckoning would have to be off by more than it can well be, or most matches disagree.
    """

    new_from_old: Transform
    covariance: Array
    centre: Array
    inliers: int
    matches: int
    points: Array
    pixels: Array
    residual_px: float
    doubtful: bool = False

    def at(self, position: Array, covariance: Array) -> tuple[Array, Array]:
        """Return a point (3,), m, and its covariance (3, 3), m^2, after the motion."""
        moved = np.asarray(self.new_from_old.apply(position), dtype=np.float64)
        jacobian = np.hstack((-cross(np.asarray(moved - self.centre)), np.eye(3)))
        grown = jacobian @ self.covariance @ jacobian.T
        return moved, np.asarray(self.new_from_old.covariance(covariance) + grown)


@dataclass(frozen=True, eq=False, slots=True)
class Sheen:
    """Brightness that depends on the direction of view: all features move alike, and no residual tells.

    Soil is not Lambertian (Lunar-Lambert law, McEwen 1996): where it is rough, what is bright lies elsewhere
    for another direction of view. Over a step of 0.75 m that moves the features of a frame by some 0.05 px
    along the change of view, as a motion of the rover would.

    Attributes
    ----------
    old_eye
        (3,), m, where the old points were seen from, frame of the old points.
    per_rad
        Deviation of that shift, pixels for each radian that the view has changed, as a multiple of the
        residual (root mean square, pixels): what moves with the view moves each feature for itself, too.
    """

    old_eye: Array
    per_rad: float


def horn(p: Array, q: Array) -> Transform | None:
    """Return the rigid motion that brings points p (n, 3), m, nearest to q (n, 3), or None for degenerate
    ones.

    Horn 1987 by way of the singular value decomposition.
    """
    rotation, translation, good = _horn_many(p[None], q[None])
    return Transform(rotation[0], translation[0]) if good[0] else None


def _horn_many(p: Array, q: Array) -> tuple[Array, Array, Mask]:
    """Return rotations (k, 3, 3), translations (k, 3) and which are determined, of sets (k, n, 3)."""
    a, b = p.mean(axis=1, keepdims=True), q.mean(axis=1, keepdims=True)
    u, s, vt = np.linalg.svd(np.swapaxes(p - a, 1, 2) @ (q - b))
    v, ut = np.swapaxes(vt, 1, 2), np.swapaxes(u, 1, 2)
    flip = np.ones((len(p), 3))
    flip[:, 2] = np.sign(np.linalg.det(v @ ut))
    rotation = (v * flip[:, None, :]) @ ut
    translation = b[:, 0] - (rotation @ a[:, 0, :, None])[..., 0]
    return rotation, translation, s[:, 1] > 1e-12


def find_motion(
    old: Features,
    new: Features,
    pairs: npt.NDArray[np.int64],
    view: StereoView,
    *,
    draws: int,
    inlier_px: float,
    sigma_px: float,
    limit_m: float,
    least: int,
    rng: np.random.Generator,
    sheen: Sheen | None = None,
) -> Motion | None:
    """Return the motion that most matches agree on in both images, or None when fewer than four do.

    A motion that shifts the matches by more than `limit_m` (what dead reckoning can hardly be off) is
    believed only if no smaller one has `least` matches: the rover's own shadow and what it carries along look
    like it.

    `pairs` [n, 2] are indices of matched features, old and new.
    """
    if len(pairs) < 4:
        return None
    i, j = pairs[:, 0], pairs[:, 1]
    p, q = old.points[i], new.points[j]
    cameras = view.left_camera, view.right_camera
    seen = np.hstack((new.left_px[j], new.right_px[j]))
    unit = old.unit_covariance[i]
    rotations, translations = _draw(p, q, draws, rng)
    if not len(rotations):
        return None
    moved = np.einsum("kab,nb->kna", rotations, p) + translations[:, None]
    miss = _project(cameras, moved) - seen
    with np.errstate(invalid="ignore"):
        agree: Mask = np.asarray((np.abs(miss) < 2.0 * inlier_px).all(axis=2))
    support = agree.sum(axis=1)
    near = np.median(np.linalg.norm(moved - p, axis=2), axis=1) < limit_m
    if bool((support[near] >= least).any()):
        support[~near] = 0
    best = agree[int(support.argmax())]
    if best.sum() < 4:
        return None
    rotation, translation, good = _horn_many(p[best][None], q[best][None])
    if not good[0]:
        return None
    settled = settle(
        Transform(rotation[0], translation[0]),
        p,
        unit,
        seen,
        cameras,
        best,
        inlier_px=inlier_px,
        sigma_px=sigma_px,
        sheen=sheen,
    )
    if settled is None:
        return None
    motion, best = settled
    shift_m = float(np.median(np.linalg.norm(motion.points - p[best], axis=1)))
    return replace(motion, doubtful=shift_m > limit_m or float(best.mean()) < LEAST_SHARE)


def settle(
    guess: Transform,
    p: Array,
    unit: Array,
    seen: Array,
    cameras: Cameras,
    best: Mask,
    *,
    inlier_px: float,
    sigma_px: float,
    sheen: Sheen | None = None,
) -> tuple[Motion, Mask] | None:
    """Return the motion refitted until its consensus is stable, and that consensus; None below four, or
    where those that agree do not tell a motion, as points on a line or in one place do not.

    Parameters
    ----------
    p, unit
        (n, 3), m, points before the motion and their covariance (n, 3, 3) for one pixel of error.
    seen
        (n, 2 k), px, where the k cameras show them after it.
    best
        (n,) the consensus to begin with.
    """
    fit = guess
    for _ in range(10):
        fit, _, _ = _refine(fit, p[best], unit[best], seen[best], cameras)
        again = _mahalanobis(fit, p, unit, seen, cameras) < inlier_px**2
        if again.sum() < 4:
            return None
        if np.array_equal(again, best):
            break
        best = again
    fit, normal, variance = _refine(fit, p[best], unit[best], seen[best], cameras)
    inverse = _inverse(normal)
    if inverse is None:
        return None
    now = np.asarray(fit.apply(p[best]), dtype=np.float64)
    covariance = _spread(fit, p[best], unit[best], seen[best], cameras, inverse, sigma_px)
    if covariance is None:
        return None
    if sheen is not None:
        moved = _shift_by_view(fit, p[best], unit[best], seen[best], cameras, inverse, sheen.old_eye)
        covariance = covariance + (sheen.per_rad**2 * variance) * np.outer(moved, moved)
    count_in = int(best.sum())
    pixels = seen[best, :2]
    residual = math.sqrt(variance)
    return Motion(fit, covariance, now.mean(axis=0), count_in, len(p), now, pixels, residual), best


UNTOLD = 1e10
"""Condition of the normal equations, radians and metres, beyond which they tell no motion: some direction is
known 100,000 times worse than another, 100 m to 1 mm."""

CELLS = 4
"""Parts of the image to a side, of which each tells for itself what the motion should be."""


def _inverse(normal: Array) -> Array | None:
    """Return the inverse of a normal matrix (6, 6), positive definite; None where it tells no motion."""
    if not np.isfinite(normal).all():
        return None
    shares, axes = np.linalg.eigh(normal)
    if not shares[0] * UNTOLD > shares[-1]:
        return None
    return np.asarray((axes / shares) @ axes.T)


def _spread(
    fit: Transform, p: Array, unit: Array, seen: Array, cameras: Cameras, inverse: Array, sigma_px: float
) -> Array | None:
    """Return the covariance (6, 6) of a motion by the residuals: one by one, or by part of the image; None
    where the fit has put points behind a camera.

    Both are sandwiches, in each direction the wider counts. One by one (White 1980) it is that of features
    that err each for themselves, whatever the size of their errors; by parts (Liang and Zeger 1986) it sees
    that features that lie together err together: stereo's bias on one surface, a camera model that is off at
    one edge. The six residuals that the fit has taken up are given back at the noise that is expected, which
    is what is left where matches are few.
    """
    from rover_iface.cameras.stereo_kernels import few_parts

    r, _, j, w = _linear(fit, p, unit, seen, cameras)
    if not (np.isfinite(r).all() and np.isfinite(j).all()):
        return None
    pixels = seen[:, :2]
    scores = (np.swapaxes(j, 1, 2) @ (w @ r[..., None]))[..., 0]
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    cell = np.minimum((CELLS * (pixels - low) / np.maximum(high - low, 1e-9)).astype(np.int64), CELLS - 1)
    index = cell @ np.array([1, CELLS])
    parts = np.zeros((CELLS * CELLS, 6))
    np.add.at(parts, index, scores)
    counts = np.bincount(index, minlength=CELLS * CELLS).astype(np.float64)
    lost = 6.0 / r.size * sigma_px**2
    single = few_parts(np.ones(len(r))) * (inverse @ (scores.T @ scores) @ inverse + lost * inverse)
    return _wider(single, few_parts(counts) * inverse @ (parts.T @ parts) @ inverse)


def _linear(
    fit: Transform, p: Array, unit: Array, seen: Array, cameras: Cameras
) -> tuple[Array, Array, Array, Array]:
    """Return residuals (n, 2 k), px, their slope over the moved points (n, 2 k, 3) and over the motion
    (n, 2 k, 6), about the middle, and the weights (n, 2 k, 2 k) that the fit gives them.
    """
    moved = np.asarray(fit.apply(p), dtype=np.float64)
    r, slope = seen - _project(cameras, moved), _jacobian(cameras, moved)
    turn = -np.stack([cross(v) for v in moved - moved.mean(axis=0)])
    j = np.concatenate((slope @ turn, slope), axis=2)
    w = _weights(np.asarray(fit.rotation, np.float64), unit, slope)
    distance = np.sqrt(np.einsum("na,nab,nb->n", r, w, r) / seen.shape[1])
    return r, slope, j, w / np.maximum(1.0, distance / 0.5)[:, None, None]


def _shift_by_view(
    fit: Transform, p: Array, unit: Array, seen: Array, cameras: Cameras, inverse: Array, old_eye: Array
) -> Array:
    """Return the motion (6,), turn, rad, before shift, m, that features seem to make which move by one pixel
    for each radian that they are seen from elsewhere, all along that change.
    """
    _, slope, j, w = _linear(fit, p, unit, seen, cameras)
    moved = np.asarray(fit.apply(p), dtype=np.float64)
    before, now = np.asarray(fit.apply(old_eye)) - moved, cameras[0].C - moved
    away = np.linalg.norm(now, axis=1, keepdims=True)
    change = now / away - before / np.linalg.norm(before, axis=1, keepdims=True)
    shift = np.einsum("nab,nb->na", slope, change * away) / cameras[0].hs
    return np.asarray(inverse @ np.einsum("nai,nab,nb->i", j, w, shift))


def _wider(one: Array, other: Array) -> Array:
    """Return the least covariance that, in the axes that both share, is nowhere below either of two (n, n).

    `one` must be positive definite, but for what rounding does to an axis that is known far better than
    another.
    """
    variances, own = np.linalg.eigh(one)
    sigmas = np.sqrt(np.maximum(variances, np.finfo(float).eps * variances[-1]))
    root, from_unit = own * sigmas, (own / sigmas).T
    share, axes = np.linalg.eigh(from_unit @ other @ from_unit.T)
    axes = root @ axes
    return np.asarray((axes * np.maximum(share, 1.0)) @ axes.T)


def find_motion_published(
    old: Features,
    new: Features,
    pairs: npt.NDArray[np.int64],
    *,
    draws: int,
    tau_m: float,
    sets: int,
    rng: np.random.Generator,
) -> Motion | None:
    """Return the motion as published: consensus within `tau_m`, Horn's fit, covariance by bootstrap.

    `pairs` [n, 2] are indices of matched features, old and new.

    Deans, Kunz, Sargent and others 2005; `tau_m` is 3 cm there, `draws` 100. `sets` is the count of bootstrap
    samples.
    """
    if len(pairs) < 4:
        return None
    p, q = old.points[pairs[:, 0]], new.points[pairs[:, 1]]
    rotations, translations = _draw(p, q, draws, rng)
    if not len(rotations):
        return None
    moved = np.einsum("kab,nb->kna", rotations, p) + translations[:, None]
    agree = np.linalg.norm(moved - q, axis=2) < tau_m  # eq. 2
    best = agree[int(agree.sum(axis=1).argmax())]
    fit: Transform | None = None
    for _ in range(10):
        fit = horn(p[best], q[best]) if best.sum() >= 4 else None
        if fit is None:
            return None
        again: Mask = np.asarray(np.linalg.norm(fit.apply(p) - q, axis=1) < tau_m)
        if again.sum() < 4 or np.array_equal(again, best):
            break
        best = again
    assert fit is not None
    now = np.asarray(fit.apply(p[best]), dtype=np.float64)
    centre = now.mean(axis=0)
    residual = float(np.sqrt(((now - q[best]) ** 2).sum(axis=1).mean()))
    covariance = _bootstrap(p[best], q[best], fit, centre, sets, rng)
    pixels = new.left_px[pairs[best, 1]]
    return Motion(fit, covariance, centre, int(best.sum()), len(pairs), now, pixels, residual)


def _draw(p: Array, q: Array, draws: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Return the motions of draws of three matches; degenerate ones are left out."""
    picks = (
        rng.random((draws, len(p))).argpartition(3, axis=1)[:, :3] if len(p) > 3 else np.array([[0, 1, 2]])
    )
    rotations, translations, good = _horn_many(p[picks], q[picks])
    return rotations[good], translations[good]


def _project(cameras: Cameras, points: Array) -> Array:
    """Return (..., 2 k): sample and line in the image of each camera."""
    return np.concatenate([camera.project(points) for camera in cameras], axis=-1)


def _weights(rotation: Array, unit: Array, jacobian: Array) -> Array:
    """Return (n, 2 k, 2 k), inverse covariance of the residuals for one pixel of error everywhere."""
    turned = jacobian @ rotation
    return np.asarray(np.linalg.inv(np.eye(turned.shape[1]) + turned @ unit @ np.swapaxes(turned, 1, 2)))


def _jacobian(cameras: Cameras, points: Array) -> Array:
    return np.concatenate([camera.jacobian(points) for camera in cameras], axis=1)


def _mahalanobis(fit: Transform, p: Array, unit: Array, seen: Array, cameras: Cameras) -> Array:
    """Return (n,), squared residuals in pixels, weighted; not finite ones as infinity."""
    moved = np.asarray(fit.apply(p), dtype=np.float64)
    r, j = seen - _project(cameras, moved), _jacobian(cameras, moved)
    good = np.isfinite(r).all(axis=1) & np.isfinite(j).all(axis=(1, 2))
    out = np.full(len(p), np.inf)
    w = _weights(np.asarray(fit.rotation, np.float64), unit[good], j[good])
    # two coordinates' worth: comparable with the error in one image
    out[good] = np.einsum("na,nab,nb->n", r[good], w, r[good]) / len(cameras)
    return out


def _refine(
    guess: Transform, p: Array, unit: Array, seen: Array, cameras: Cameras
) -> tuple[Transform, Array, float]:
    """Return the motion that fits all images best, its normal matrix about the middle, and the variance.

    Where the points tell no motion it is as far as it came, and the matrix singular.
    """
    rotation, translation = np.asarray(guess.rotation, np.float64), np.asarray(guess.translation, np.float64)
    normal: Array = np.zeros((6, 6))
    variance = 1.0
    for _ in range(8):
        moved = p @ rotation.T + translation
        r, slope = seen - _project(cameras, moved), _jacobian(cameras, moved)
        good = np.isfinite(r).all(axis=1) & np.isfinite(slope).all(axis=(1, 2))
        if good.sum() < 3:
            normal = np.zeros((6, 6))
            break
        centre = moved[good].mean(axis=0)
        turn = -np.stack([cross(v) for v in moved[good] - centre])
        j = np.concatenate((slope[good] @ turn, slope[good]), axis=2)
        w = _weights(rotation, unit[good], slope[good])
        distance = np.sqrt(np.einsum("na,nab,nb->n", r[good], w, r[good]) / seen.shape[1])
        w = w / np.maximum(1.0, distance / 0.5)[:, None, None]
        jw = np.swapaxes(j, 1, 2) @ w
        normal = (jw @ j).sum(axis=0) + 1e-9 * np.eye(6)
        inverse = _inverse(normal)
        if inverse is None:
            break
        step = inverse @ (jw @ r[good][..., None]).sum(axis=0)[:, 0]
        variance = float(np.einsum("na,nab,nb->", r[good], w, r[good])) / max(
            1, seen.shape[1] * int(good.sum()) - 6
        )
        small = small_rotation(step[:3])
        rotation = small @ rotation
        translation = small @ (translation - centre) + centre + step[3:]
        if np.abs(step).max() < 1e-7:
            break
    u, _, vt = np.linalg.svd(rotation)
    return Transform(u @ vt, translation), normal, variance


def _bootstrap(
    p: Array, q: Array, fit: Transform, centre: Array, sets: int, rng: np.random.Generator
) -> Array:
    """Return the covariance of the motion over sets of inliers drawn with replacement (eq. 5)."""
    picks = rng.integers(len(p), size=(sets, len(p)))
    rotations, translations, good = _horn_many(p[picks], q[picks])
    if good.sum() <= 6:
        return np.eye(6)
    change = rotations[good] @ fit.rotation.T
    turn = 0.5 * np.stack(
        (
            change[:, 2, 1] - change[:, 1, 2],
            change[:, 0, 2] - change[:, 2, 0],
            change[:, 1, 0] - change[:, 0, 1],
        ),
        axis=1,
    )
    middle = np.asarray(fit.inverse().apply(centre))
    shift = rotations[good] @ middle + translations[good] - centre
    rows = np.hstack((turn, shift))
    return np.asarray(rows.T @ rows / len(rows))


def cross(v: Array) -> Array:
    """Return the matrix (3, 3) of the vector product with v (3,)."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def small_rotation(turn: Array) -> Array:
    """Return the rotation (3, 3) by a rotation vector (3,), radians."""
    angle = float(np.linalg.norm(turn))
    if angle < 1e-12:
        return np.eye(3) + cross(turn)
    k = cross(turn / angle)
    return np.asarray(np.eye(3) + math.sin(angle) * k + (1.0 - math.cos(angle)) * (k @ k))
