"""Motion from stop to stop by stereo features, beside the wheels, and slip where the two disagree.

The features and their robust motion are those of the feature tracker (`rover_iface.vision.sift`); here the
pictures of two stops are taken in the rover's own frame, wheel odometry predicts where features will be, and
the motion comes with a covariance. A step without enough features falls back on the wheels, with a covariance
that allows for slip.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
import numpy.typing as npt

from rover_iface.errors import LocalizationError
from rover_iface.frames import Transform
from rover_iface.localization.bundle_adjustment import adjoint, chained
from rover_iface.vision.sift_features import Features, find_features, match_moved
from rover_iface.vision.sift_motion import Motion, Sheen, find_motion
from rover_iface.vision.tracker import StereoView

Array = npt.NDArray[np.float64]


class StepState(StrEnum):
    """What a step is known by."""

    GOOD = "good"
    SLIP = "slip"
    BLIND = "blind"


@dataclass(frozen=True, slots=True)
class OdometryOptions:
    """Parameters.

    Attributes
    ----------
    least
        Features that must agree on a motion.
    wheel_share, wheel_floor_m, wheel_turn_rad
        Deviation of wheel odometry: share of the distance, floor, and heading for each metre (square root
        law).
    slip_tail
        Slip is reported when wheels and pictures differ by what chance does less often than this.
    least_slip
        And when the difference is at least this share of the distance.
    blind_share
        Deviation of the way of a blind step: slip is possible and not seen.
    inflate
        Factor on the feature covariance; features of one picture do not err independently.
    sheen_per_rad
        What a change of view by a radian moves all features alike, as a multiple of their residual
        (`rover_iface.vision.sift_motion.Sheen`). On tuning drives of the own renderer, whose soil follows the
        Lunar-Lambert law, the shift was 0.9 px a radian at a residual of 0.27 px.
    features, ratio, row_px, gate_px, draws, inlier_px, sigma_px
        As of the feature tracker (`rover_iface.vision.sift`); gated round where the wheels have them.
    """

    least: int = 15
    wheel_share: float = 0.05
    wheel_floor_m: float = 0.005
    wheel_turn_rad: float = math.radians(0.5)
    slip_tail: float = 1e-4
    least_slip: float = 0.1
    blind_share: float = 0.3
    inflate: float = 1.0
    sheen_per_rad: float = 3.0
    features: int = 1500
    ratio: float = 0.8
    row_px: float = 1.5
    gate_px: float = 120.0
    draws: int = 100
    inlier_px: float = 1.5
    sigma_px: float = 0.3

    def __post_init__(self) -> None:
        if self.least < 6 or not 0 < self.wheel_share < 1 or not 0 < self.slip_tail < 1:
            raise LocalizationError(
                f"visual odometry with {self.least} features, wheel share {self.wheel_share}, slip tail "
                f"{self.slip_tail}; at least 6, and 0 to 1 are needed"
            )


@dataclass(frozen=True, eq=False, slots=True)
class Step:
    """The motion of one step.

    Attributes
    ----------
    old_from_new
        Pose of the rover after the step in its frame before.
    covariance
        [6, 6] of a small motion (turn, shift) in the axes after the step.
    slip
        Share of the wheels' path that was not made good, along it; NaN when blind or standing.
    features
        How many agree.
    """

    old_from_new: Transform
    covariance: Array
    state: StepState
    slip: float
    features: int
    reason: str = ""


class VisualOdometer:
    """Take stereo views (cameras in the rover frame) one after the other; each gives a `Step`."""

    def __init__(self, options: OdometryOptions | None = None) -> None:
        self.options = options or OdometryOptions()
        self._last: Features | None = None
        self._count = 0

    def step(self, view: StereoView, wheels: Transform) -> Step | None:
        """Return the motion since the last view; None for the first. `wheels` is their old_from_new."""
        options = self.options
        believed = moved_view(view, wheels)
        features = find_features(believed, count=options.features, ratio=options.ratio, row_px=options.row_px)
        last, self._last = self._last, _moved(features, wheels.inverse())
        self._count += 1
        if last is None:
            return None
        return step_from_features(last, features, believed, wheels, options, seed=self._count)


def step_from_features(
    old: Features,
    new: Features,
    believed: StereoView,
    wheels: Transform,
    options: OdometryOptions,
    *,
    seed: int = 0,
) -> Step:
    """Return the motion between features of two stops; `new` and the view are moved by `wheels`."""
    expected = np.asarray(believed.left_camera.project(old.points))
    pairs = match_moved(old, new, expected, ratio=options.ratio, gate_px=options.gate_px)
    # the mast stands as it stood, or moved its camera by centimetres
    old_eye = np.asarray(wheels.inverse().apply(believed.left_camera.C), dtype=np.float64)
    motion = find_motion(
        old,
        new,
        pairs,
        believed,
        draws=options.draws,
        inlier_px=options.inlier_px,
        sigma_px=options.sigma_px,
        limit_m=math.inf,
        least=options.least,
        rng=np.random.default_rng([seed, len(pairs)]),
        sheen=Sheen(old_eye, options.sheen_per_rad),
    )
    return judged_step(motion, wheels, options)


def moved_view(view: StereoView, wheels: Transform) -> StereoView:
    """Return the view with its cameras in the frame before the step, as the wheels have it."""
    return replace(
        view,
        left_camera=view.left_camera.transformed(wheels),
        right_camera=view.right_camera.transformed(wheels),
    )


def _moved(features: Features, transform: Transform) -> Features:
    turn = transform.rotation
    return replace(
        features,
        points=np.asarray(transform.apply(features.points), dtype=np.float64),
        unit_covariance=turn @ features.unit_covariance @ turn.T,
    )


def wheel_covariance(wheels: Transform, options: OdometryOptions, *, share: float | None = None) -> Array:
    """Return the covariance [6, 6] of a step by the wheels alone."""
    way = float(np.linalg.norm(wheels.translation))
    along = math.hypot((options.wheel_share if share is None else share) * way, options.wheel_floor_m)
    turn = options.wheel_turn_rad * math.sqrt(max(way, 0.05))
    return np.diag(np.array([turn, turn, turn, along, along, along]) ** 2)


def judged_step(motion: Motion | None, wheels: Transform, options: OdometryOptions) -> Step:
    """Return the step that a motion of features and the wheels tell together.

    Raises
    ------
    LocalizationError
        If the wheels' motion is not finite.
    """
    from scipy.stats import chi2

    if not np.isfinite(wheels.translation).all():
        raise LocalizationError("the wheels' motion of a step is not finite")
    way = float(np.linalg.norm(wheels.translation))
    if motion is None or motion.inliers < options.least:
        count = 0 if motion is None else motion.inliers
        blind = wheel_covariance(wheels, options, share=options.blind_share)
        reason = f"{count} features agree, limit {options.least}: wheels alone"
        return Step(wheels, blind, StepState.BLIND, math.nan, count, reason)
    old_from_new = motion.new_from_old.inverse() * wheels
    # a turn w about the features' middle c and a shift d are the small motion (w, d + c x w) of the frame
    c = motion.centre
    lever = np.eye(6)
    lever[3:, :3] = np.array([[0.0, -c[2], c[1]], [c[2], 0.0, -c[0]], [-c[1], c[0], 0.0]])
    into = adjoint(wheels.inverse()) @ lever
    covariance = options.inflate * into @ motion.covariance @ into.T
    gap = old_from_new.translation - wheels.translation
    spread = (
        wheel_covariance(wheels, options)[3:, 3:]
        + old_from_new.rotation @ covariance[3:, 3:] @ old_from_new.rotation.T
    )
    far = float(gap @ np.linalg.solve(spread, gap))
    slip = math.nan if way < 0.02 else -float(gap @ wheels.translation) / way**2
    state, reason = StepState.GOOD, ""
    share = float(np.linalg.norm(gap)) / max(way, 0.02)
    if far > float(chi2.isf(options.slip_tail, 3)) and share >= options.least_slip:
        state = StepState.SLIP
        reason = (
            f"pictures say {np.linalg.norm(old_from_new.translation):.3f} m, wheels {way:.3f} m: "
            f"{100 * share:.0f} % of the distance, limit {100 * options.least_slip:.0f} %"
        )
    return Step(old_from_new, covariance, state, slip, motion.inliers, reason)


def drive(steps: list[Step]) -> tuple[Transform, Array]:
    """Return the motion over a drive and its covariance [6, 6] in the axes at its end."""
    return chained([(step.old_from_new, step.covariance) for step in steps])
