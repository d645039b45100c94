"""Studies of motion: steps by visual odometry, a kilometre of legs, and how long an adjustment takes."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.model import CameraModel, pinhole
from rover_iface.cameras.rig import CameraRig, load_cameras
from rover_iface.cameras.stereo import triangulate
from rover_iface.frames import Transform, rotation_rpy
from rover_iface.localization.bundle_adjustment import (
    Adjustment,
    BundleAdjustment,
    StereoRig,
    chained,
    small_motion,
)
from rover_iface.localization.leg import localise_leg
from rover_iface.localization.traverse import covariance_among
from rover_iface.localization.visual_odometry import (
    OdometryOptions,
    Step,
    step_from_features,
)
from rover_iface.vision.sift_features import Features
from rover_iface.vision.tracker import StereoView
from studies.common.localization_legs import LegRecord, wheel_prior

Array = npt.NDArray[np.float64]
STEP_M = 0.75
WHEEL_SHARE = 0.05
PIVOT = (0.3, 0.0, 1.35)
SUN_SIGMA = math.radians(1.0)
TILT_SIGMA = math.radians(0.3)
VO_SCALE = 0.005
KNOWN_RAD, UNKNOWN_RAD = 1e-4, 10.0
"""Deviations of a heading that defines the frame, 2 cm over 200 m, and of one that nobody measured."""


# ---- steps on features


def navcams() -> tuple[CameraModel, CameraModel]:
    """Return the MER navcams in the rover frame, looking 30 degrees down."""
    rig = CameraRig(load_cameras("mer"), PIVOT)
    return rig.camera("navcam_left", 0.0, -0.52), rig.camera("navcam_right", 0.0, -0.52)


def feature_steps(
    count: int,
    seed: int,
    *,
    sigma_px: float = 0.3,
    wrong: float = 0.15,
    slip: float = 0.0,
    sheen: float = 0.0,
    options: OdometryOptions | None = None,
) -> list[tuple[Transform, Step]]:
    """Return true motions and steps found from modelled features of random ground, `count` of them.

    150 points round the rover are seen from both stops of a step of 0.75 m, each pixel off by `sigma_px`, a
    share `wrong` of the matches false; the wheels are off by 5 % and turn by half a degree, and with `slip`
    they claim 1 / (1 - slip) of the way. With `sheen` all features of a stop are shifted along the change of
    view, by as many pixels a radian (deviation, one draw a step).
    """
    rng = np.random.default_rng([seed, 0x0D0])
    left, right = navcams()
    blank = np.zeros((left.height, left.width), np.float32)
    options = options or OdometryOptions()
    found = []
    for k in range(count):
        turn = rng.normal(0.0, math.radians(3.0))
        true = Transform(
            rotation_rpy(*rng.normal(0, math.radians(1.5), 2), turn),
            (STEP_M, rng.normal(0, 0.02), rng.normal(0, 0.02)),
        )
        points = np.column_stack(
            (rng.uniform(2.2, 12.0, 600), rng.uniform(-4, 4, 600), rng.normal(0, 0.05, 600))
        )
        old_left, old_right = left.project(points), right.project(points)
        later = true.inverse().apply(points)
        new_left, new_right = left.project(later), right.project(later)
        inside = np.ones(len(points), dtype=bool)
        for pixels in (old_left, old_right, new_left, new_right):
            with np.errstate(invalid="ignore"):
                inside &= ((pixels > 5) & (pixels < 1018)).all(axis=1)
        chosen = np.flatnonzero(inside)[:150]
        names = rng.normal(size=(len(chosen), 128)).astype(np.float32)
        shuffled = names.copy()
        bad = rng.random(len(chosen)) < wrong
        shuffled[bad] = names[bad][rng.permutation(int(bad.sum()))]
        claimed = 1.0 / (1.0 - slip) * (1.0 + rng.normal(0, WHEEL_SHARE))
        wheels = Transform(
            rotation_rpy(0, 0, turn + rng.normal(0, math.radians(0.5))), claimed * true.translation
        )
        noisy = [
            p[chosen] + rng.normal(0, sigma_px, (len(chosen), 2))
            for p in (old_left, old_right, new_left, new_right)
        ]
        if sheen:
            strength = rng.normal(0, sheen)
            for pixels, camera in ((noisy[2], left), (noisy[3], right)):
                pixels += strength * seen_aside(camera, later[chosen], true)
        believed = left.transformed(wheels), right.transformed(wheels)
        old = Features(*triangulate(left, right, noisy[0], noisy[1], sigma_px=1.0), noisy[0], noisy[1], names)
        new = Features(
            *triangulate(*believed, noisy[2], noisy[3], sigma_px=1.0), noisy[2], noisy[3], shuffled
        )
        view = StereoView(blank, blank, *believed)
        found.append((true, step_from_features(old, new, view, wheels, options, seed=k)))
    return found


def seen_aside(camera: CameraModel, points: Array, true: Transform) -> Array:
    """Return by how much the view of points [n, 3], m, rover frame after a step, has changed: radians on the
    axes of the picture [n, 2].
    """
    before, now = true.inverse().apply(camera.C) - points, camera.C - points
    away = np.linalg.norm(now, axis=1, keepdims=True)
    change = now / away - before / np.linalg.norm(before, axis=1, keepdims=True)
    return np.asarray(np.einsum("nab,nb->na", camera.jacobian(points), change * away) / camera.hs)


Draw = Callable[[int, np.random.Generator], tuple[Array, Array]]
"""Draws so many consecutive steps: errors [n, 6] and covariances told [n, 6, 6] of small motions."""


def modelled_draw(steps: Sequence[tuple[Transform, Step]]) -> Draw:
    """Return a draw of the errors of feature steps, each for itself, with their mean covariance.

    With either sign: the mean of a hundred steps is chance, and over a thousand steps would be a bias.
    """
    errors = np.array([small_motion(true, step.old_from_new) for true, step in steps])
    both = np.concatenate((errors, -errors))
    claimed = np.mean([step.covariance for _, step in steps], axis=0)

    def draw(count: int, rng: np.random.Generator) -> tuple[Array, Array]:
        return both[rng.integers(len(both), size=count)], np.repeat(claimed[None], count, axis=0)

    return draw


def flown_draw(drives: Sequence[Sequence[tuple[Transform, Step]]]) -> Draw:
    """Return a draw of the errors of rendered drives as they are, each with the covariance of its own step.

    What is drawn is a row of consecutive steps of one drive, from any step of any drive on and round its end:
    errors that steps share, a scale above all, stay together over a leg. Neither their sign nor their mean is
    changed, so a bias common to all drives adds up over the kilometre, and so does the chance in their mean.
    """
    errors = [np.array([small_motion(true, step.old_from_new) for true, step in drive]) for drive in drives]
    told = [np.array([step.covariance for _, step in drive]) for drive in drives]
    shares = np.array([len(drive) for drive in drives], dtype=float)

    def draw(count: int, rng: np.random.Generator) -> tuple[Array, Array]:
        one = int(rng.choice(len(drives), p=shares / shares.sum()))
        row = (int(rng.integers(len(errors[one]))) + np.arange(count)) % len(errors[one])
        return errors[one][row], told[one][row]

    return draw


def step_figures(steps: Sequence[tuple[Transform, Step]]) -> dict[str, float]:
    """Return errors of steps: shift and heading (rms), mean NEES (6 expected), share of states."""
    off = np.array([small_motion(true, step.old_from_new) for true, step in steps])
    nees = [float(e @ np.linalg.solve(step.covariance, e)) for e, (_, step) in zip(off, steps, strict=True)]
    return {
        "steps": len(steps),
        "shift_mm": 1e3 * float(np.sqrt((off[:, 3:] ** 2).sum(axis=1).mean())),
        "heading_mrad": 1e3 * float(np.sqrt((off[:, 2] ** 2).mean())),
        "nees": float(np.median(nees) / 5.35 * 6.0),
        "nees_mean": float(np.mean(nees)),
        "slip": float(np.mean([step.state == "slip" for _, step in steps])),
        "blind": float(np.mean([step.state == "blind" for _, step in steps])),
    }


# ---- a kilometre


@dataclass(frozen=True, eq=False)
class TiedLeg:
    """A leg with its rock pairs: positions and covariances in the frames of both ends, true axes.

    `shift` is the true way [3]; the leg is turned so that it leads along x.
    """

    shift: Array
    first: list[tuple[Array, Array]]
    second: list[tuple[Array, Array]]
    accepted: bool
    right: int


def tied_leg(record: LegRecord) -> TiedLeg:
    """Return the rock pairs found on a leg with wheel odometry and headings to 5 degrees."""
    prior = wheel_prior(record, np.random.default_rng([record.seed, 0x71E]))
    result = localise_leg(record.ends[0].rocks, record.ends[1].rocks, prior)
    shift = record.eyes[1] - record.eyes[0]
    turn = rotation_rpy(0.0, 0.0, -math.atan2(shift[1], shift[0]))
    pairs = result.match.pairs if result.accepted and result.match is not None else ()
    ends: tuple[list[tuple[Array, Array]], list[tuple[Array, Array]]] = ([], [])
    right = 0
    for pair in pairs:
        bodies = record.ends[0].bodies[pair.first] & record.ends[1].bodies[pair.second]
        right += bool(bodies)
        for end, index in ((0, pair.first), (1, pair.second)):
            rock = record.ends[end].rocks[index]
            spread = covariance_among(rock, len(pairs))
            ends[end].append((turn @ rock.position, turn @ spread @ turn.T))
    return TiedLeg(turn @ shift, *ends, result.accepted, right)


@dataclass(frozen=True, eq=False)
class Kilometre:
    """One simulated traverse: true and estimated places [n, 3] of the sites, and the adjustment."""

    true: Array
    wheels: Array
    odometry: Array
    adjusted: Array
    length_m: float
    adjustment: Adjustment
    before: list[Array]
    nees: float
    ties: int
    refused: int

    def error_share(self, which: Array) -> float:
        """Return the horizontal error at the end as a share of the distance."""
        return float(np.hypot(*(which[-1] - self.true[-1])[:2])) / self.length_m


def kilometre(
    legs: Sequence[TiedLeg],
    seed: int,
    draw: Draw,
    *,
    length_m: float = 1000.0,
    sightings: int = 1,
) -> Kilometre:
    """Return a traverse over legs in random order, with odometry drawn anew.

    The wheels are off by 5 % of the way, half of the variance the same on the whole run; the pictures by what
    steps were off (`draw`), and 0.5 % of scale, which a calibration is off and no step shows; roll and pitch
    are measured to 0.3 and the heading at each site to 1 degree by each of so many sightings of the sun. With
    no sighting the site frame is that of the first pose: its heading is known, no other is measured.
    """
    sun_sigma = SUN_SIGMA / math.sqrt(sightings) if sightings else KNOWN_RAD
    measured = (TILT_SIGMA, TILT_SIGMA, sun_sigma if sightings else UNKNOWN_RAD)
    rng = np.random.default_rng([seed, 0x1000])
    bias, scale = rng.normal(0, WHEEL_SHARE / math.sqrt(2)), rng.normal(0, VO_SCALE)
    order, course = [int(k) for k in rng.permutation(len(legs))], 0.0
    true = [Transform(rotation_rpy(*rng.normal(0, TILT_SIGMA, 2), rng.normal(0, sun_sigma)), np.zeros(3))]
    adjustment = BundleAdjustment()
    start = np.diag([TILT_SIGMA, TILT_SIGMA, sun_sigma, 1e-4, 1e-4, 1e-4]) ** 2
    believed = Transform.identity()
    adjustment.add_pose(0, believed, covariance=start)
    wheels, odometry, chain = [np.zeros(3)], [believed], [(Transform.identity(), start)]
    before, travelled, ties, refused = [start[3:, 3:]], 0.0, 0, 0
    for site, leg in enumerate((legs[k] for k in order), 1):
        course = 0.6 * course + rng.normal(0, 0.3)
        turn = rotation_rpy(0.0, 0.0, course)
        way = turn @ leg.shift
        level = float(np.hypot(*way[:2]))
        travelled += level
        attitude = rotation_rpy(*rng.normal(0, TILT_SIGMA, 2), rng.normal(0, sun_sigma))
        true.append(Transform(attitude, true[-1].translation + way))
        # wheels: along the way as believed at the last site, where the sun gave the heading
        slip = bias + rng.normal(0, WHEEL_SHARE / math.sqrt(2))
        back = true[-2].inverse()
        wheels.append(wheels[-1] + back.rotate((1.0 + slip) * way))
        # pictures: the errors of as many steps as the leg has
        motion = back * true[-1]
        count = max(1, round(level / STEP_M))
        errors, told = draw(count, rng)
        walked = _walked(motion, errors, 1.0 + scale)
        spread = chained([(_part(motion, count), one) for one in told])[1]
        along = motion.inverse().rotate(motion.translation)
        # the scale is one for the whole run: on n legs its variance counts n times, or it would average out
        spread[3:, 3:] += (length_m / level) * VO_SCALE**2 * np.outer(along, along)
        odometry.append(odometry[-1] * walked)
        chain.append((walked, spread))
        total, covariance = chained(chain)
        before.append(total.rotation @ covariance[3:, 3:] @ total.rotation.T)
        adjustment.add_pose(site, odometry[-1])
        adjustment.add_motion(site - 1, site, walked, spread)
        adjustment.add_attitude(site, Transform.identity(), measured)
        refused += not leg.accepted
        for number, (one, two) in enumerate(zip(leg.first, leg.second, strict=True)):
            name = (site, number)
            for pose, (where, spread3) in ((site - 1, one), (site, two)):
                rotation = true[pose].rotation.T @ turn
                place = rotation @ where
                if pose == site - 1:
                    adjustment.add_point(name, odometry[pose].apply(place))
                adjustment.add_rock(pose, name, place, rotation @ spread3 @ rotation.T)
            ties += 1
        if travelled >= length_m:
            break
    solution = adjustment.solve()
    last = solution.poses[len(true) - 1]
    off = small_motion(last.site_from_rover, true[-1])
    return Kilometre(
        np.array([t.translation for t in true]),
        np.array(wheels),
        np.array([t.translation for t in odometry]),
        np.array([solution.poses[k].site_from_rover.translation for k in range(len(true))]),
        travelled,
        solution,
        before,
        float(off @ np.linalg.solve(last.covariance, off)),
        ties,
        refused,
    )


def _part(motion: Transform, count: int) -> Transform:
    return Transform(np.eye(3), motion.translation / count)


def _walked(motion: Transform, errors: Array, scale: float) -> Transform:
    """Return a motion as found in steps: equal parts, each with its error, and a scale on the way."""
    step = Transform(np.eye(3), scale * motion.translation / len(errors))
    total = Transform.identity()
    for error in errors:
        total = total * step * Transform(rotation_rpy(*error[:3]), error[3:])
    return total * Transform(motion.rotation, np.zeros(3))


# ---- speed


def speed(poses: int = 100, points: int = 2600, *, seen: int = 180, seed: int = 0) -> dict[str, float]:
    """Return CPU seconds and fit of an adjustment of stereo features along a drive of 0.6 m steps."""
    rng = np.random.default_rng(seed)
    base = 0.2
    left = pinhole(focal_px=1177.0, width=1024, height=1024)
    rig = StereoRig.of(left, left.moved(np.eye(3), (0.0, -base, 0.0)))
    way = [Transform(np.eye(3), (0.6 * k, 0.0, 0.0)) for k in range(poses)]
    where = np.column_stack(
        (rng.uniform(2, 0.6 * poses + 10, points), rng.uniform(-6, 6, points), rng.uniform(-2, 0, points))
    )
    began = time.process_time()
    adjustment, known, count = BundleAdjustment(huber=None), set(), 0
    for k, true in enumerate(way):
        guess = true * Transform(rotation_rpy(*rng.normal(0, 0.01, 3)), rng.normal(0, 0.05, 3))
        adjustment.add_pose(k, true if k == 0 else guess, covariance=1e-8 * np.eye(6) if k == 0 else None)
        local = true.inverse().apply(where)
        u, v = 511.5 - 1177 * local[:, 1] / local[:, 0], 511.5 - 1177 * local[:, 2] / local[:, 0]
        good = (local[:, 0] > 1.5) & (local[:, 0] < 12) & (np.abs(u - 511) < 511) & (np.abs(v - 511) < 511)
        for j in np.flatnonzero(good)[:seen].tolist():
            if j not in known:
                known.add(j)
                adjustment.add_point(j, where[j] + rng.normal(0, 0.1, 3))
            noise = rng.normal(0, 0.5, 3)
            measured = (u[j] + noise[0], u[j] - 1177 * base / local[j, 0] + noise[1], v[j] + noise[2])
            adjustment.add_stereo(k, j, rig, measured)
            count += 1
    built = time.process_time() - began
    began = time.process_time()
    plain = adjustment.solve(covariances=False)
    solved = time.process_time() - began
    return {
        "poses": poses,
        "points": len(known),
        "observations": count,
        "build_s": built,
        "solve_s": solved,
        "iterations": plain.iterations,
        "chi2_per_freedom": plain.chi2 / plain.freedom,
    }


def speed_summary(repeats: int = 5) -> dict[str, Any]:
    """Return the median of several speeds."""
    runs = [speed(seed=k) for k in range(repeats)]
    return {key: float(np.median([run[key] for run in runs])) for key in runs[0]}
