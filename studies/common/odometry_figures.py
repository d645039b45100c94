"""What rendered drives tell: NEES of steps, a kilometre of their errors, and two runs over one ground."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np

from rover_iface.frames import Transform
from rover_iface.localization.bundle_adjustment import BundleAdjustment, chained, small_motion
from rover_iface.localization.visual_odometry import Step, StepState
from studies.common.localization_drive import (
    KNOWN_RAD,
    SUN_SIGMA,
    TILT_SIGMA,
    UNKNOWN_RAD,
    TiedLeg,
    flown_draw,
    kilometre,
)
from studies.common.odometry_drives import Flown, FlownStep
from studies.common.pages import table
from studies.common.tracking_worlds import Array

mpl.use("Agg")
import matplotlib.pyplot as plt

SITE_M = 25.0
"""Between the sites of a long run, as long as a leg of the kilometre."""
AXES = ("turn x", "turn y", "turn z", "shift x", "shift y", "shift z")
NAMES = {"own": "(a) own renderer", "draped": "(b) grain of real frames", "all": "all"}


def steps_told(steps: Sequence[FlownStep]) -> dict[str, Any]:
    """Return errors of steps (rms), their mean NEES and the band that holds it in 95 % of the cases.

    The same by axis: turn about x, y, z, shift along them, each squared error over its own variance.
    """
    from scipy.stats import chi2

    seen = [s for s in steps if s.step.state is not StepState.BLIND]
    errors, nees = np.array([s.error for s in seen]), np.array([s.nees for s in seen])
    variances = np.array([np.diag(s.step.covariance) for s in seen])
    count = len(seen)
    return {
        "steps": count,
        "blind": len(steps) - count,
        "shift_mm": 1e3 * float(np.sqrt((errors[:, 3:] ** 2).sum(axis=1).mean())),
        "turn_mrad": 1e3 * float(np.sqrt((errors[:, :3] ** 2).sum(axis=1).mean())),
        "heading_mrad": 1e3 * float(np.sqrt((errors[:, 2] ** 2).mean())),
        "nees": float(nees.mean()),
        "nees_median": float(np.median(nees)),
        "band": (chi2.ppf((0.025, 0.975), 6 * count) / count).tolist(),
        "inside": float(np.mean(nees < chi2.ppf(0.95, 6))),
        "axes": (errors**2 / variances).mean(axis=0).tolist(),
        "axis_band": (chi2.ppf((0.025, 0.975), count) / count).tolist(),
        "mean_over_error": (errors.mean(axis=0) / (errors.std(axis=0) / math.sqrt(count))).tolist(),
        "features": int(np.median([s.step.features for s in seen])),
    }


@dataclass(frozen=True, eq=False, slots=True)
class LongRun:
    """A long drive with its sites adjusted.

    Attributes
    ----------
    true, found
        [n, 3], m, site frame, the sites.
    end, covariance
        Pose found at the end, and [6, 6] of a small motion in its axes.
    length_m
        Of the true way.
    """

    true: Array
    found: Array
    true_end: Transform
    end: Transform
    covariance: Array
    length_m: float

    @property
    def error(self) -> Array:
        """Return the small motion [6] from the pose found at the end to the true one."""
        return small_motion(self.end, self.true_end)

    @property
    def spread(self) -> Array:
        """Return the covariance [3, 3], m^2, of the place found at the end, site axes."""
        rotation = self.end.rotation
        return np.asarray(rotation @ self.covariance[3:, 3:] @ rotation.T)

    @property
    def nees(self) -> float:
        """Return the squared error of the place at the end over its covariance; 3 is expected."""
        off = self.end.translation - self.true_end.translation
        return float(off @ np.linalg.solve(self.spread, off))


def adjusted_run(flown_drive: Flown, start: Transform, *, sun: bool) -> LongRun:
    """Return a drive from its true first pose on, with a site every 25 m, adjusted.

    At each site roll and pitch are measured to 0.3 degrees and with the sun the heading to one. Without it
    the heading of the first pose is what defines the frame. Cameras are those that odometry is told: no scale
    is off.
    """
    rng = np.random.default_rng([flown_drive.drive.ground, flown_drive.drive.run, 0x5A1])
    heading = SUN_SIGMA if sun else KNOWN_RAD
    held = (TILT_SIGMA, TILT_SIGMA, SUN_SIGMA if sun else UNKNOWN_RAD)

    def measured(pose: Transform) -> Transform:
        off = Transform.from_rpy(
            *(float(rng.normal(0, sigma)) for sigma in (TILT_SIGMA, TILT_SIGMA, heading))
        )
        return pose * off

    adjustment = BundleAdjustment()
    first = np.diag([TILT_SIGMA, TILT_SIGMA, heading, 1e-4, 1e-4, 1e-4]) ** 2
    true, believed = start, measured(start)
    adjustment.add_pose(0, believed, covariance=first)
    places, chain, length, since = [start.translation], [], 0.0, 0.0
    last = len(flown_drive.steps) - 1
    for number, one in enumerate(flown_drive.steps):
        true = true * one.true
        chain.append((one.step.old_from_new, one.step.covariance))
        way = float(np.linalg.norm(one.true.translation))
        length, since = length + way, since + way
        if since < SITE_M and number < last:
            continue
        motion, spread = chained(chain)
        site = len(places)
        believed = believed * motion
        adjustment.add_pose(site, believed)
        adjustment.add_motion(site - 1, site, motion, spread)
        adjustment.add_attitude(site, measured(true), held)
        places.append(true.translation)
        chain, since = [], 0.0
    solution = adjustment.solve()
    poses = [solution.poses[k] for k in range(len(places))]
    found = np.array([pose.site_from_rover.translation for pose in poses])
    return LongRun(np.array(places), found, true, poses[-1].site_from_rover, poses[-1].covariance, length)


def agreement(one: LongRun, two: LongRun) -> dict[str, float]:
    """Return how far apart, m, two runs believe the one place to be at which both ended, and their NEES."""
    apart = (one.end.translation - one.true_end.translation) - (
        two.end.translation - two.true_end.translation
    )
    spread = one.spread + two.spread
    return {
        "apart_m": float(np.linalg.norm(apart)),
        "sigma_m": math.sqrt(float(np.linalg.eigvalsh(spread)[-1])),
        "nees_apart": float(apart @ np.linalg.solve(spread, apart)),
    }


def flown_kilometre(drives: Sequence[Flown], legs: Sequence[TiedLeg], runs: int) -> dict[str, Any]:
    """Return errors at the end of kilometres whose visual odometry errs as on rendered drives.

    `runs` with the sun sighted once at each site, as many with two sightings and as many without. Rocks tie
    the sites of accepted legs.
    """
    pairs: list[list[tuple[Transform, Step]]] = [[(s.true, s.step) for s in one.steps] for one in drives]
    draw = flown_draw(pairs)
    out: dict[str, Any] = {"runs": runs, "legs": len(legs), "accepted": sum(leg.accepted for leg in legs)}
    for name, sightings, limit in (("sun", 1, 0.5), ("twice", 2, 0.5), ("none", 0, 1.0)):
        done = [kilometre(legs, seed, draw, sightings=sightings) for seed in range(runs)]
        for what in ("odometry", "adjusted"):
            share = np.array([100 * run.error_share(getattr(run, what)) for run in done])
            out[f"{name}_{what}"] = {
                "mean": float(share.mean()),
                "p95": float(np.percentile(share, 95)),
                "worst": float(share.max()),
                "limit": limit,
                "within": float(np.mean(share <= limit)),
            }
        out[f"{name}_adjusted"]["nees"] = float(np.mean([run.nees for run in done]))
    return out


def long_figures(runs: Sequence[Flown], starts: Sequence[Transform]) -> dict[str, Any]:
    """Return how two long runs over one ground ended and whether they agree, with and without the sun.

    `starts` are the true first poses, site frame.
    """
    out: dict[str, Any] = {}
    for name, sun in (("sun", True), ("none", False)):
        done = [adjusted_run(one, start, sun=sun) for one, start in zip(runs, starts, strict=True)]
        out[name] = {
            "length_m": [run.length_m for run in done],
            "off_m": [float(np.hypot(*(run.end.translation - run.true_end.translation)[:2])) for run in done],
            "nees": [run.nees for run in done],
            **agreement(done[0], done[1]),
        }
    return out


def steps_table(figures: dict[str, dict[str, Any]]) -> str:
    """Return both tables of the steps: errors and NEES, and NEES by axis."""
    rows, axes = [], []
    for name, f in figures.items():
        low, high = f["band"]
        rows.append(
            [
                NAMES[name],
                f"{f['steps']} + {f['blind']}",
                f"{f['shift_mm']:.2f}",
                f"{f['turn_mrad']:.2f}",
                f"{f['nees']:.2f} ({f['nees_median']:.1f})",
                f"{low:.2f} to {high:.2f}",
                f"{100 * f['inside']:.0f}",
            ]
        )
        low, high = f["axis_band"]
        axes.append([NAMES[name], *(f"{v:.2f}" for v in f["axes"]), f"{low:.2f} to {high:.2f}"])
    head = ["domain", "steps + blind", "shift, mm rms", "turn, mrad rms", "NEES mean (median), 6 expected"]
    one = table([*head, "band of the mean, 95 %", "inside 95 %"], rows)
    return one + "\n" + table(["squared error over variance, 1 expected", *AXES, "band, 95 %"], axes)


def kilometre_table(f: dict[str, Any]) -> str:
    """Return the table of the kilometre and what it is of."""
    rows = []
    for key, label in (
        ("sun_odometry", "visual odometry, heading of the start by the sun"),
        ("sun_adjusted", "+ adjustment, sun at each site"),
        ("twice_adjusted", "+ adjustment, sun sighted twice at each site"),
        ("none_odometry", "visual odometry, heading of the start given"),
        ("none_adjusted", "+ adjustment, no sun"),
    ):
        if key not in f:  # figures kept of a run before this row
            continue
        one = f[key]
        nees = f"{one['nees']:.1f}" if "nees" in one else ""
        share = [f"{one[k]:.2f} %" for k in ("mean", "p95", "worst")]
        rows.append([label, *share, f"{100 * one['within']:.0f} % within {one['limit']:g} %", nees])
    head = ["error at the end, share of the distance", "mean", "95 % of runs", "worst", "runs"]
    return (
        table([*head, "NEES of the last pose (6)"], rows)
        + f"\n{f['runs']} runs of 1 km each, over {f['legs']} legs, {f['accepted']} of them accepted."
    )


def long_table(f: dict[str, Any]) -> str:
    """Return the table of the two long runs."""
    rows = []
    for key, label in (("sun", "sun at each site"), ("none", "no sun")):
        one = f[key]
        ends = [
            f"{off:.2f} m ({100 * off / length:.2f} %), {nees:.1f}"
            for off, length, nees in zip(one["off_m"], one["length_m"], one["nees"], strict=True)
        ]
        rows.append(
            [label, *ends, f"{one['apart_m']:.2f} m, {one['sigma_m']:.2f} m", f"{one['nees_apart']:.1f}"]
        )
    first, second = f["sun"]["length_m"]
    head = ["adjusted", f"first run, {first:.0f} m: off, NEES (3)", f"second, {second:.0f} m: off, NEES (3)"]
    return table([*head, "errors apart, largest sigma", "NEES of that (3)"], rows)


def draw_steps(steps: Sequence[FlownStep], path: Path) -> None:
    """Draw how often steps reach a NEES, beside chi square of six."""
    from scipy.stats import chi2

    nees = np.sort([s.nees for s in steps if s.step.state is not StepState.BLIND])
    figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
    axes.plot(nees, 1.0 - np.arange(len(nees)) / len(nees), color="tab:blue", label=f"{len(nees)} steps")
    at = np.linspace(0.1, max(25.0, float(nees[-1])), 200)
    axes.plot(at, chi2.sf(at, 6), color="black", lw=1, label="chi square, 6 degrees of freedom")
    axes.set(xlabel="NEES", ylabel="share of steps above", yscale="log", ylim=(0.5 / len(nees), 1.1))
    axes.legend(fontsize=8)
    figure.savefig(path, dpi=90)
    plt.close(figure)
