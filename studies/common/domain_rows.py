"""What trackers and odometry answer on the runs of `studies.domains`, beside the truth, and sums over it."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from rover_iface.cameras.model import CameraModel
from rover_iface.errors import TrackerError
from rover_iface.frames import Transform
from rover_iface.localization.visual_odometry import StepState, VisualOdometer
from rover_iface.vision.tracker import StereoView, TrackState, TrackUpdate
from rover_iface.vision.trackers import TrackerAids, make_tracker
from studies.common.domain_runs import Run
from studies.common.tracking_worlds import Array
from studies.common.warped import WarpedRun

WRONG_M = 0.05
"""Error across the line of sight from which on an answer is wrong (Kim et al. 2009 count 3 cm at 2 m)."""
WRONG_PX = 10.0
"""The same where no range is known."""
SAME_PX = 0.01
INSIDE = {2: 5.991, 3: 7.815, 6: 12.592}
"""95 % of chi square, by degrees of freedom."""


@dataclass(frozen=True, slots=True)
class Row:
    """One update: what was answered and what was so.

    Attributes
    ----------
    error
        Of the position (metres, 3-D), in domain (c) of the pixel.
    aside
        Across the line of sight, metres; in domain (c) pixels.
    nees, freedom
        Squared error over what was told, and its degrees of freedom.
    clean
        Whether nothing was wrong and the target is in sight: losing it is a false alarm.
    """

    seed: int
    fault: str
    target: int
    stop: int
    range_m: float
    state: TrackState
    error: float
    aside: float
    nees: float
    freedom: int
    confidence: float
    wrong: bool
    clean: bool
    end: bool
    reasons: tuple[str, ...] = ()

    @property
    def tracked(self) -> bool:
        """Return whether the target was told to be tracked."""
        return self.state is TrackState.TRACKED


def axes(camera: CameraModel) -> Array:
    """Return rows, columns and axis of a camera as the rows of a rotation."""
    return np.stack((camera.horizontal, np.cross(camera.A, camera.horizontal), camera.A))


class Looks:
    """What a tracker may ask of one run besides its views: the narrow pair of the first stop, and the wide
    pair of the stop that it is at.
    """

    def __init__(self, run: Run) -> None:
        self.views = [halt.view() for halt in run.halts]
        self.stop = 0
        left, right = run.narrow
        self._narrow = StereoView(left.unit, right.unit, left.told, right.told)

    def aids(self) -> TrackerAids:
        """Return them as a rover tells its tracker."""
        return TrackerAids(narrow=self.narrow, wide=lambda target, point: self.views[self.stop])

    def narrow(self, target: str, point: Array) -> StereoView:
        """Return the narrow pair; other stops have none."""
        if self.stop:
            raise TrackerError(f"stop {self.stop} has no narrow pair for target {target} at {point}")
        return self._narrow


def follow(run: Run, name: str) -> tuple[list[Row], int]:
    """Return a row for every update of every target by a tracker, and how many were refused at the start.

    Where a tracker takes a place beside the pixel it is given, that place is the target.
    """
    looks = Looks(run)
    tracker = make_tracker(name, looks.aids())
    first, rows, points = run.halts[0].left, [], {}
    for number, target in enumerate(run.targets):
        # what a person designates is a pixel; the rover's cameras are not quite where it believes them
        pixel = first.true.project(target.point)
        eye, ray = first.told.back_project(pixel)
        place = eye + float(np.linalg.norm(target.point - first.true.C)) * ray
        try:
            begun = tracker.start(str(number), place, looks.views[0])
        except TrackerError:
            continue
        moved = float(np.hypot(*(begun.pixel - pixel))) > SAME_PX
        points[number] = first.at(begun.pixel) if moved else target.point
    for stop in range(1, len(looks.views)):
        looks.stop = stop
        for number, point in points.items():
            update = tracker.update(str(number), looks.views[stop])
            rows.append(_row(run, number, stop, update, looks.views[stop], point))
    return rows, len(run.targets) - len(points)


def _row(run: Run, number: int, stop: int, update: TrackUpdate, view: StereoView, point: Array) -> Row:
    halt, target = run.halts[stop], run.targets[number]
    told, true = axes(view.left_camera), axes(halt.left.true)
    ray = true @ (point - halt.left.true.C)
    off = told @ (update.position - view.left_camera.C) - ray
    covariance = told @ update.covariance @ told.T
    distance = float(np.linalg.norm(ray))
    ray = ray / distance
    aside = float(np.linalg.norm(off - ray * (ray @ off)))
    spoiled = bool(run.fault) and stop >= run.hit.start
    return Row(
        run.seed,
        run.fault,
        number,
        stop,
        distance,
        update.state,
        float(np.linalg.norm(off)),
        aside,
        float(off @ np.linalg.solve(covariance, off)),
        3,
        update.confidence,
        aside > WRONG_M,
        not spoiled and target.visible[stop],
        stop == len(run.halts) - 1,
        update.reasons,
    )


def follow_warped(run: WarpedRun, name: str) -> tuple[list[Row], int]:
    """Return a row for every update; only the two coordinates of the image are known."""
    rows, started = [], []
    tracker = make_tracker(name)
    first = run.sights[0]
    for number, ray in enumerate(run.rays):
        pixel = first.true_left.project(run.origin + 5.0 * ray)
        try:
            tracker.start(str(number), None, first.view, pixel=pixel)  # type: ignore[call-arg]
        except TrackerError:
            continue
        started.append(number)
    for stop in range(1, len(run.sights)):
        sight = run.sights[stop]
        for number in started:
            true = sight.true_left.project(run.origin + 5.0 * run.rays[number])
            if not (15 < true[0] < sight.true_left.width - 15 and 15 < true[1] < sight.true_left.height - 15):
                continue
            update = tracker.update(str(number), sight.view)
            camera = sight.view.left_camera
            off = camera.project(update.position) - true
            jacobian = camera.jacobian(update.position)
            spread = jacobian @ update.covariance @ jacobian.T
            away = float(np.hypot(*off))
            rows.append(
                Row(
                    run.seed,
                    "",
                    number,
                    stop,
                    float(np.linalg.norm(update.position - camera.C)),
                    update.state,
                    away,
                    away,
                    float(off @ np.linalg.solve(spread, off)),
                    2,
                    update.confidence,
                    away > WRONG_PX,
                    True,
                    stop == len(run.sights) - 1,
                    update.reasons,
                )
            )
    return rows, len(run.rays) - len(started)


@dataclass(frozen=True, slots=True)
class OdometryRow:
    """One step of visual odometry: errors (metres, radians) and their squared ratio to what was told."""

    seed: int
    shift_m: float
    turn_rad: float
    nees: float
    features: int


def odometry(run: Run) -> list[OdometryRow]:
    """Return the steps of visual odometry over an approach; wheels are 3 % and 0.3 degrees off."""
    rng = np.random.default_rng([run.seed, 0x0D0])
    odometer, rows = VisualOdometer(), []
    for n, halt in enumerate(run.halts):
        into = halt.pose.site_from_rover.inverse()
        view = StereoView(
            halt.left.unit,
            halt.right.unit,
            halt.left.true.transformed(into),
            halt.right.true.transformed(into),
        )
        true = Transform.identity()
        if n:
            true = run.halts[n - 1].pose.site_from_rover.inverse() * halt.pose.site_from_rover
        way = float(np.linalg.norm(true.translation))
        wheels = true * Transform.from_rpy(
            0.0, 0.0, float(rng.normal(0, 0.005)), rng.normal(0, 0.03 * way, 3)
        )
        step = odometer.step(view, wheels)
        if step is None or step.state is StepState.BLIND:
            continue
        rows.append(_odometry_row(run.seed, step.old_from_new, true, step.covariance, step.features))
    return rows


def odometry_warped(run: WarpedRun) -> list[OdometryRow]:
    """Return the same where the cameras only turn: the rover stands, its attitude changes."""
    odometer, rows = VisualOdometer(), []
    before: Transform | None = None
    for sight in run.sights:
        into = Transform(axes(sight.true_left).T, sight.true_left.C).inverse()
        cameras = sight.true_left.transformed(into), sight.true_right.transformed(into)
        true = Transform.identity() if before is None else before * into.inverse()
        before = into
        step = odometer.step(StereoView(sight.view.left, sight.view.right, *cameras), true)
        if step is None or step.state is StepState.BLIND:
            continue
        rows.append(_odometry_row(run.seed, step.old_from_new, true, step.covariance, step.features))
    return rows


def _odometry_row(
    seed: int, found: Transform, true: Transform, covariance: Array, features: int
) -> OdometryRow:
    off = found.inverse() * true
    r = np.asarray(off.rotation)
    turn = 0.5 * np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]])
    both = np.concatenate((turn, off.translation))
    nees = float(both @ np.linalg.solve(covariance, both))
    return OdometryRow(
        seed, float(np.linalg.norm(off.translation)), float(np.linalg.norm(turn)), nees, features
    )


def auc(right: Array, wrong: Array) -> float:
    """Return the chance that a right answer has more confidence than a wrong one; NaN without both."""
    if not len(right) or not len(wrong):
        return math.nan
    order = np.concatenate((right, wrong))
    _, inverse, counts = np.unique(order, return_inverse=True, return_counts=True)
    rank = (np.cumsum(counts) - 0.5 * (counts - 1))[inverse]
    return float((rank[: len(right)].sum() - len(right) * (len(right) + 1) / 2) / (len(right) * len(wrong)))


@dataclass(frozen=True, slots=True)
class Sums:
    """One line of the table."""

    runs: int
    refused: int
    updates: int
    covered: float
    nees: float
    median: float
    p95: float
    end_median: float
    end_worst: float
    auc: float
    undetected: int
    tracked: int
    false_alarms: float


def sums(rows: Iterable[Row], refused: int) -> Sums:
    """Return what a table says of updates."""
    rows = list(rows)
    tracked = [r for r in rows if r.tracked]
    ends = [r.aside for r in tracked if r.end]
    clean = [r for r in rows if r.clean]
    aside = [r.aside for r in tracked]
    return Sums(
        len({(r.seed, r.fault, r.target) for r in rows}),
        refused,
        len(rows),
        100.0 * _mean(r.nees < INSIDE[r.freedom] for r in tracked),
        float(np.median([r.nees for r in tracked])) if tracked else math.nan,
        float(np.median(aside)) if aside else math.nan,
        float(np.percentile(aside, 95)) if aside else math.nan,
        float(np.median(ends)) if ends else math.nan,
        float(np.max(ends)) if ends else math.nan,
        auc(
            np.array([r.confidence for r in rows if not r.wrong]),
            np.array([r.confidence for r in rows if r.wrong]),
        ),
        sum(r.wrong for r in tracked),
        len(tracked),
        100.0 * _mean(not r.tracked for r in clean),
    )


def _mean(values: Iterable[bool]) -> float:
    found: list[bool] = list(values)
    return float(np.mean(found)) if found else math.nan
