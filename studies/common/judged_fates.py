"""What became of each target of a day on the `full` rover, and whether the truth bears it out."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rover_iface.behaviour.repertoire import FullRepertoire
from rover_iface.frames import Pose
from rover_iface.placement.arm import Arm
from rover_iface.placement.base_adjustment import FARTHEST_MOVE_M
from rover_iface.simulator.terrain_rover import TerrainRover
from studies.common.day_fates import NO_PRODUCT, PLACED, REFUSED, Fate, fates
from studies.common.plain_day import FlownDay
from studies.common.true_surface import SAFE, Possible, TrueLimits, body_at, possible, true_patch

MEASURED_M = 0.01
"""A measurement is of the target if the tool touched so near (Pedersen and others 2005: within 1 cm)."""


@dataclass(frozen=True, slots=True)
class Judged:
    """A target's fate beside the truth.

    Attributes
    ----------
    approached
        Whether the rover came to it: arrived, or stopped where a move without a look could still bring the
        arm.
    truth
        Of one that was approached and not measured: whether the tool could truly have been put within
        `MEASURED_M` of it from where the rover stood, first or last. None of all others.
    unsafe
        What the instrument does not bear where it was put, by the true surface under it.
    """

    fate: Fate
    approached: bool
    truth: Possible | None = None
    unsafe: tuple[str, ...] = ()

    @property
    def measured(self) -> bool:
        """Return whether it was measured, near enough."""
        off_m = self.fate.off_m
        return self.fate.what == PLACED and off_m is not None and off_m <= MEASURED_M

    @property
    def refused(self) -> bool:
        """Return whether the rover refused it on arrival."""
        return self.fate.what == REFUSED

    @property
    def refused_rightly(self) -> bool:
        """Return whether it was refused and could truly not have been measured."""
        return self.refused and self.truth is not None and self.truth.answer != SAFE

    @property
    def told(self) -> bool:
        """Return whether a target that was not measured has a reason."""
        return self.fate.placed or bool(self.fate.why)


def judged_fates(day: FlownDay, out: Path) -> list[Judged]:
    """Return what became of each target of a day whose run's folder is `out`."""
    refused = {r.target_id: r.reason for r in day.prepared.refused}
    history = day.rover.truth.history
    return [
        _judged(day.rover, out, fate) for fate in fates(out, [t.id for t in day.targets], refused, history)
    ]


def _judged(rover: TerrainRover, out: Path, fate: Fate) -> Judged:
    times = _times(out)
    drive, observe = f"navigate-{fate.target}", f"observe-R{fate.target.removeprefix('T')}"
    if observe in times:
        stands = [_stood(rover, t_s) for t_s in times[observe]]
    elif drive in times:
        stands = [_stood(rover, times[drive][1])]
    else:
        return Judged(fate, approached=False)
    point = rover.truth.point(fate.target)
    arm = Arm(rover.body.profile.arm)
    away_m = math.hypot(stands[-1].x - point[0], stands[-1].y - point[1])
    near_m = arm.profile.shoulder_m[0] + arm.profile.reach_m + FARTHEST_MOVE_M
    arrived = fate.what in (PLACED, NO_PRODUCT, REFUSED) or fate.wrong
    if not arrived and away_m > near_m:
        return Judged(fate, approached=False)
    unsafe = _unsafe(rover, arm, fate.target, stands[-1])
    judged = Judged(fate, approached=True, unsafe=unsafe)
    if judged.measured:
        return judged
    truth = possible(rover.body.renderer.scene, arm, stands, point, MEASURED_M, TrueLimits())
    return Judged(fate, approached=True, truth=truth, unsafe=unsafe)


def _unsafe(rover: TerrainRover, arm: Arm, name: str, stand: Pose) -> tuple[str, ...]:
    """Return what is wrong with the true surface where the tool was put, nothing where it was not."""
    own = rover.repertoire
    attempt = own.placing.attempts.get(name) if isinstance(own, FullRepertoire) else None
    if name not in rover.truth.touched or attempt is None or attempt.motion is None:
        return ()
    point, scene = rover.truth.touched[name], rover.body.renderer.scene
    axis = np.asarray(stand.site_from_rover.rotate(-arm.tool_axis(attempt.motion.contact)), dtype=np.float64)
    return true_patch(
        scene, body_at(scene, point)[0], point, axis, arm.profile.tool_radius_m, TrueLimits()
    ).wrong


def _times(out: Path) -> dict[str, tuple[float, float]]:
    """Return when each node of a run that started did, and when it ended, s."""
    begun: dict[str, float] = {}
    found: dict[str, tuple[float, float]] = {}
    for line in (out / "trace.jsonl").read_text("utf-8").splitlines():
        t_s, event, node, *_ = json.loads(line)
        if event == "start":
            begun[node] = t_s
        elif event == "end" and node in begun:
            found[node] = (begun[node], t_s)
    return found


def _stood(rover: TerrainRover, t_s: float) -> Pose:
    """Return where the rover truly stood at a time; plan time has milliseconds."""
    rows: Sequence[tuple[float, Pose, Pose]] = rover.truth.odometry
    return next((true for t, true, _ in reversed(rows) if t <= t_s + 1e-3), rows[0][1])
