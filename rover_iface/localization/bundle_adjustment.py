"""Bundle adjustment of a traverse: stereo features, rocks seen from two sites, odometry and headings.

A thin layer over GTSAM. Poses are `site_from_rover`; a small motion of a pose is (turn, shift), six numbers
in the axes of the rover at that pose, radians and metres; covariances [6, 6] are of that. `solve` adjusts all
at once (Levenberg-Marquardt), `update` takes up what was added since the last call (iSAM2). Stereo enters
through linearised cameras (`StereoRig`); a rock enters as what a camera looking at it would have measured,
with the rock's own covariance, so that the long tail of its range is kept.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.model import CameraModel
from rover_iface.errors import LocalizationError
from rover_iface.frames import Transform

Array = npt.NDArray[np.float64]
ROCK_FOCAL_PX, ROCK_BASE_M = 1000.0, 0.2


@dataclass(frozen=True, eq=False)
class StereoRig:
    """A pair as GTSAM takes it: one focal length, level rows. Made from any cameras by linearisation.

    Attributes
    ----------
    rover_from_camera
        Frame of the aligned left camera: x right, y down, z forward.
    focal_px, centre_px, base_m
        Of both aligned cameras; distance of their centres.
    """

    left: CameraModel
    right: CameraModel
    aligned: tuple[CameraModel, CameraModel]
    rover_from_camera: Transform
    focal_px: float
    centre_px: tuple[float, float]
    base_m: float

    @staticmethod
    def of(left: CameraModel, right: CameraModel) -> StereoRig:
        """Return the rig of two cameras (CAHV, CAHVOR or CAHVORE) given in the rover frame."""
        from rover_iface.cameras.linear import aligned_pair

        one, two = aligned_pair(left, right)
        row = one.horizontal
        axes = np.column_stack((row, np.cross(one.A, row), one.A))
        base = float(np.linalg.norm(two.C - one.C))
        pose = Transform(axes, one.C)
        return StereoRig(left, right, (one, two), pose, one.hs, (one.hc, one.vc), base)

    def measured(self, left_px: npt.ArrayLike, right_px: npt.ArrayLike) -> Array:
        """Return (u left, u right, v) [n, 3], px, in the aligned pair of pixels [n, 2] of the real images."""
        pair = []
        for camera, to, pixels in zip(
            (self.left, self.right), self.aligned, (left_px, right_px), strict=True
        ):
            origins, rays = camera.back_project(np.atleast_2d(np.asarray(pixels, dtype=float)))
            pair.append(to.project(origins + 1e6 * rays))
        return np.column_stack((pair[0][:, 0], pair[1][:, 0], 0.5 * (pair[0][:, 1] + pair[1][:, 1])))


@dataclass(frozen=True, eq=False, slots=True)
class AdjustedPose:
    """A pose, its covariance [6, 6] in its own axes, and that of its position [3, 3] in the site's."""

    site_from_rover: Transform
    covariance: Array

    @property
    def position_covariance(self) -> Array:
        """Return the covariance of the position [3, 3], site axes, m^2."""
        rotation = self.site_from_rover.rotation
        return np.asarray(rotation @ self.covariance[3:, 3:] @ rotation.T)


@dataclass(frozen=True, eq=False, slots=True)
class Adjustment:
    """The solution: poses and points by their keys, and how well it fits.

    `chi2` is the sum of squared normalised residuals, to be compared with `freedom`.
    """

    poses: Mapping[Hashable, AdjustedPose]
    points: Mapping[Hashable, Array]
    chi2: float
    freedom: int
    iterations: int


@dataclass
class BundleAdjustment:
    """A traverse under adjustment. Poses and points have any hashable key.

    Parameters
    ----------
    huber
        Stereo features and rocks beyond this many deviations weigh less; None for plain least squares.
    """

    huber: float | None = 2.5
    _graph: Any = field(init=False)
    _fresh: Any = field(init=False)
    _values: Any = field(init=False)
    _fresh_values: Any = field(init=False)
    _pose_keys: dict[Hashable, int] = field(init=False, default_factory=dict)
    _point_keys: dict[Hashable, int] = field(init=False, default_factory=dict)
    _measured: set[int] = field(init=False, default_factory=set)
    _residuals: int = field(init=False, default=0)
    _isam: Any = field(init=False, default=None)

    def __post_init__(self) -> None:
        import gtsam

        if self.huber is not None and not self.huber > 0:
            raise LocalizationError(f"Huber limit is {self.huber}; it must be positive")
        self._graph, self._fresh = gtsam.NonlinearFactorGraph(), gtsam.NonlinearFactorGraph()
        self._values, self._fresh_values = gtsam.Values(), gtsam.Values()

    # ---- what is adjusted

    def add_pose(self, key: Hashable, guess: Transform, *, covariance: npt.ArrayLike | None = None) -> None:
        """Add a pose at a guess; a covariance [6, 6] (turn, rad, before shift, m, in the axes of the pose)
        holds it there (the first pose needs one).
        """
        import gtsam

        if key in self._pose_keys:
            raise LocalizationError(f"pose {key!r} is there already")
        spread = None if covariance is None else _covariance(covariance, 6, f"pose {key!r}")
        number = gtsam.symbol("x", len(self._pose_keys))
        self._pose_keys[key] = number
        self._insert(number, _pose3(guess))
        if spread is not None:
            noise = gtsam.noiseModel.Gaussian.Covariance(spread)
            self._add(gtsam.PriorFactorPose3(number, _pose3(guess), noise), 6)

    def add_point(self, key: Hashable, guess: npt.ArrayLike) -> None:
        """Add a point [3], m, of the site frame at a guess."""
        import gtsam

        if key in self._point_keys:
            raise LocalizationError(f"point {key!r} is there already")
        where = np.asarray(guess, dtype=float)
        if where.shape != (3,) or not np.isfinite(where).all():
            raise LocalizationError(f"point {key!r} lies at {where}; three finite numbers are needed")
        number = gtsam.symbol("l", len(self._point_keys))
        self._point_keys[key] = number
        self._insert(number, where)

    # ---- what was measured

    def add_motion(
        self, old: Hashable, new: Hashable, old_from_new: Transform, covariance: npt.ArrayLike
    ) -> None:
        """Add a measured motion (wheels or visual odometry) with covariance [6, 6] in the axes of `new`:
        turn, rad, before shift, m.
        """
        import gtsam

        noise = gtsam.noiseModel.Gaussian.Covariance(_covariance(covariance, 6, f"motion {old!r} to {new!r}"))
        self._add(gtsam.BetweenFactorPose3(self._pose(old), self._pose(new), _pose3(old_from_new), noise), 6)

    def add_attitude(
        self, key: Hashable, site_from_rover: Transform, sigma_rad: tuple[float, float, float]
    ) -> None:
        """Add a measured attitude with deviations of roll, pitch and heading (sun sighting: heading)."""
        import gtsam

        if not min(sigma_rad) > 0:
            raise LocalizationError(f"attitude of {key!r} has deviations {sigma_rad}; all must be positive")
        noise = gtsam.noiseModel.Diagonal.Sigmas(np.array(sigma_rad))
        turn = gtsam.Rot3(np.asarray(site_from_rover.rotation))
        self._add(gtsam.PoseRotationPrior3D(self._pose(key), turn, noise), 3)

    def add_stereo(
        self,
        pose: Hashable,
        point: Hashable,
        rig: StereoRig,
        measured: npt.ArrayLike,
        *,
        sigma_px: float = 0.5,
    ) -> None:
        """Add a stereo measurement [3], (u left, u right, v) in px, in the aligned pair of a rig.

        Raises
        ------
        LocalizationError
            If the sigma or the disparity is not positive.
        """
        import gtsam

        if not sigma_px > 0:
            raise LocalizationError(f"a stereo measurement has sigma {sigma_px} px; it must be positive")
        u_left, u_right, v = (float(value) for value in np.asarray(measured, dtype=float))
        if not u_left > u_right:
            raise LocalizationError(
                f"point {point!r} has disparity {u_left - u_right:.2f} px at pose {pose!r}; "
                "it must be positive"
            )
        calibration = gtsam.Cal3_S2Stereo(rig.focal_px, rig.focal_px, 0.0, *rig.centre_px, rig.base_m)
        noise = self._robust(gtsam.noiseModel.Isotropic.Sigma(3, sigma_px))
        self._stereo(
            pose, point, gtsam.StereoPoint2(u_left, u_right, v), noise, calibration, rig.rover_from_camera
        )

    def add_rock(
        self,
        pose: Hashable,
        point: Hashable,
        position_rover: npt.ArrayLike,
        covariance: npt.ArrayLike,
        *,
        eye_rover: npt.ArrayLike = (0.0, 0.0, 0.0),
    ) -> None:
        """Add a rock seen at a place [3], m, of the rover frame with covariance [3, 3], m^2, from the mast's
        eye.

        `eye_rover` [3], m, is that eye in the rover frame.
        """
        import gtsam

        where, eye = np.asarray(position_rover, dtype=float), np.asarray(eye_rover, dtype=float)
        sight = where - eye
        if not np.isfinite(sight).all() or np.linalg.norm(sight) < 0.5:
            raise LocalizationError(f"rock {point!r} lies at {where} m, less than 0.5 m from the eye")
        spread = _covariance(covariance, 3, f"rock {point!r}")
        away = float(np.linalg.norm(sight))
        forward = sight / away
        right = np.cross(forward, (0.0, 0.0, 1.0))
        right /= max(float(np.linalg.norm(right)), 1e-9)
        axes = np.column_stack((right, np.cross(forward, right), forward))
        # derivative of (u left, u right, v) on the axis of the virtual camera
        f, b, z = ROCK_FOCAL_PX, ROCK_BASE_M, away
        slope = np.array([[f / z, 0.0, 0.0], [f / z, 0.0, f * b / z**2], [0.0, f / z, 0.0]]) @ axes.T
        noise = self._robust(gtsam.noiseModel.Gaussian.Covariance(slope @ spread @ slope.T))
        calibration = gtsam.Cal3_S2Stereo(f, f, 0.0, 0.0, 0.0, b)
        measured = gtsam.StereoPoint2(0.0, -f * b / z, 0.0)
        self._stereo(pose, point, measured, noise, calibration, Transform(axes, eye))

    # ---- the solution

    def solve(self, *, covariances: bool = True, most: int = 50) -> Adjustment:
        """Return all poses and points adjusted at once.

        Raises
        ------
        LocalizationError
            If something is not held by what was measured, so that no solution stands out.
        """
        import gtsam

        self._take_up()
        parameters = gtsam.LevenbergMarquardtParams()
        parameters.setMaxIterations(most)
        parameters.setRelativeErrorTol(1e-6)
        try:
            optimizer = gtsam.LevenbergMarquardtOptimizer(self._graph, self._values, parameters)
            self._values = optimizer.optimize()
            count = int(optimizer.iterations())
            marginals = gtsam.Marginals(self._graph, self._values) if covariances else None
        except RuntimeError as err:
            raise LocalizationError(f"the traverse cannot be adjusted: {_first_line(err)}") from err
        return self._answer(None if marginals is None else marginals.marginalCovariance, count)

    def update(self) -> Adjustment:
        """Return the solution with what was added since the last call, adjusting only what it touches."""
        import gtsam

        if self._isam is None:
            parameters = gtsam.ISAM2Params()
            parameters.setRelinearizeThreshold(0.01)
            parameters.relinearizeSkip = 1
            self._isam = gtsam.ISAM2(parameters)
        fresh, values = self._fresh, self._fresh_values
        self._take_up()
        try:
            self._isam.update(fresh, values)
            for _ in range(2):
                self._isam.update()
            self._values = self._isam.calculateEstimate()
        except RuntimeError as err:
            raise LocalizationError(f"the traverse cannot be adjusted: {_first_line(err)}") from err
        return self._answer(self._isam.marginalCovariance, 1)

    # ---- inside

    def _answer(self, covariance_of: Any, iterations: int) -> Adjustment:
        poses = {}
        for key, number in self._pose_keys.items():
            pose = self._values.atPose3(number)
            spread = np.full((6, 6), np.nan) if covariance_of is None else np.asarray(covariance_of(number))
            poses[key] = AdjustedPose(Transform(pose.rotation().matrix(), pose.translation()), spread)
        points = {key: np.asarray(self._values.atPoint3(number)) for key, number in self._point_keys.items()}
        unknown = 6 * len(poses) + 3 * len(points)
        chi2 = 2.0 * float(self._graph.error(self._values))
        return Adjustment(poses, points, chi2, self._residuals - unknown, iterations)

    def _insert(self, number: int, value: Any) -> None:
        self._fresh_values.insert(number, value)

    def _add(self, factor: Any, residuals: int) -> None:
        self._fresh.add(factor)
        self._measured.update(int(key) for key in list(factor.keys()))
        self._residuals += residuals

    def _take_up(self) -> None:
        import gtsam

        if not self._pose_keys:
            raise LocalizationError("a traverse without poses cannot be adjusted")
        for what, keys in (("pose", self._pose_keys), ("point", self._point_keys)):
            for key, number in keys.items():
                if number not in self._measured:
                    raise LocalizationError(f"{what} {key!r} was never measured")
        self._graph.push_back(self._fresh)
        self._values.insert(self._fresh_values)
        self._fresh, self._fresh_values = gtsam.NonlinearFactorGraph(), gtsam.Values()

    def _stereo(
        self, pose: Hashable, point: Hashable, measured: Any, noise: Any, calibration: Any, camera: Transform
    ) -> None:
        import gtsam

        if point not in self._point_keys:
            raise LocalizationError(f"point {point!r} is unknown; add it first")
        factor = gtsam.GenericStereoFactor3D(
            measured,
            noise,
            self._pose(pose),
            self._point_keys[point],
            calibration,
            False,
            False,
            _pose3(camera),
        )
        self._add(factor, 3)

    def _robust(self, noise: Any) -> Any:
        import gtsam

        if self.huber is None:
            return noise
        return gtsam.noiseModel.Robust.Create(gtsam.noiseModel.mEstimator.Huber.Create(self.huber), noise)

    def _pose(self, key: Hashable) -> int:
        if key not in self._pose_keys:
            raise LocalizationError(f"pose {key!r} is unknown; add it first")
        return self._pose_keys[key]


def _pose3(transform: Transform) -> Any:
    import gtsam

    return gtsam.Pose3(gtsam.Rot3(np.asarray(transform.rotation)), np.asarray(transform.translation))


def _covariance(values: npt.ArrayLike, size: int, what: str) -> Array:
    matrix = np.asarray(values, dtype=float)
    if matrix.shape != (size, size) or not np.isfinite(matrix).all():
        raise LocalizationError(f"{what} has a covariance of shape {matrix.shape}; {size} x {size} is needed")
    least = float(np.linalg.eigvalsh(0.5 * (matrix + matrix.T))[0])
    if not least > 0:
        raise LocalizationError(f"{what} has a covariance with eigenvalue {least:.3g}; all must be positive")
    return 0.5 * (matrix + matrix.T)


def _first_line(err: BaseException) -> str:
    return " ".join(str(err).split())[:160]


def adjoint(transform: Transform) -> Array:
    """Return the matrix [6, 6] that takes a small motion in b's axes to one in a's, for a_from_b."""
    t = transform.translation
    cross = np.array([[0.0, -t[2], t[1]], [t[2], 0.0, -t[0]], [-t[1], t[0], 0.0]])
    out = np.zeros((6, 6))
    out[:3, :3] = out[3:, 3:] = transform.rotation
    out[3:, :3] = cross @ transform.rotation
    return out


def chained(steps: list[tuple[Transform, Array]]) -> tuple[Transform, Array]:
    """Return the motion over several steps, with its covariance.

    A step, and what comes back, is a motion `old_from_new` and its covariance [6, 6] in the axes of the new
    pose: turn, rad, before shift, m.
    """
    total, covariance = Transform.identity(), np.zeros((6, 6))
    for step, spread in steps:
        back = adjoint(step.inverse())
        covariance = back @ covariance @ back.T + spread
        total = total * step
    return total, covariance


def small_motion(reference: Transform, other: Transform) -> Array:
    """Return the small motion [6] (turn, shift) in the axes of `reference` that leads to `other`."""
    import gtsam

    return np.asarray(gtsam.Pose3.Logmap(_pose3(reference.inverse() * other)))
