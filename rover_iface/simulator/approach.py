"""One approach to a target with the tracker in the loop: what `outcrop sim track` shows."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from rover_iface.cameras.model import Array, CameraModel
from rover_iface.cameras.rig import CameraRig
from rover_iface.errors import RenderError, TrackerError
from rover_iface.frames import Pose, Transform, wrap_angle
from rover_iface.simulator.render.picture import Frame
from rover_iface.simulator.render.renderer import Renderer, Sun
from rover_iface.terrain.terrain import Terrain
from rover_iface.vision.correlation.ncc import NccTracker
from rover_iface.vision.template import NccOptions
from rover_iface.vision.tracker import StereoView, TrackState, TrackUpdate


@dataclass(frozen=True)
class ApproachOptions:
    """How an approach is driven. Kim et al. 2009: steps of 10 % of the range, subframes of 161 pixels."""

    step_share: float = 0.10
    last_m: float = 2.0
    subframe_px: int = 161
    odometry_error: float = 0.05
    heading_error_rad: float = 0.008
    mast_noise_rad: float = 0.0012
    tracker: NccOptions = field(default_factory=NccOptions)


@dataclass(frozen=True)
class ApproachStop:
    """What came of one stop; `error_m`: from the surface under the tracked pixel to the true target."""

    pose: Pose
    believed: Transform
    update: TrackUpdate
    frame: Frame
    error_m: float


def approach(
    renderer: Renderer,
    terrain: Terrain,
    rig: CameraRig,
    start: Pose,
    target: Array,
    sun: Sun,
    *,
    rng: np.random.Generator,
    options: ApproachOptions | None = None,
    pair: tuple[str, str] = ("navcam_left", "navcam_right"),
) -> list[ApproachStop]:
    """Return the stops of a straight approach from `start` to `target` (3,), a surface point of the site, m.

    The rover drives by odometry with the error of `options` and knows only what the tracker tells it; the
    run ends at the last range or when the target has failed.

    Raises
    ------
    TrackerError
        If the first pair does not show the target.
    """
    options = options or ApproachOptions()
    tracker = NccTracker(options.tracker)
    error, pose, travelled, look = Transform.identity(), start, 0.0, np.asarray(target, dtype=np.float64)
    stops: list[ApproachStop] = []
    while True:
        believed = error * pose.site_from_rover
        view, frame, camera = _look(renderer, rig, pair, pose, believed, look, sun, options, rng, travelled)
        if not stops:
            pixel = camera.project(target)
            if not renderer.scene.sees(camera.C, target[None])[0]:
                raise TrackerError("the target is hidden from the first stop")
            update = tracker.start("target", None, view, pixel=pixel)
        else:
            update = tracker.update("target", view)
        stops.append(ApproachStop(pose, believed, update, frame, _off(frame, update, target)))
        look = tracker.predicted("target")
        seen = believed.inverse().apply(look)
        remaining = float(np.hypot(seen[0] - rig.pivot_rover[0], seen[1] - rig.pivot_rover[1]))
        if update.state is TrackState.FAILED or remaining <= options.last_m or len(stops) > 60:
            return stops
        step = min(options.step_share * remaining, remaining - options.last_m + 0.02)
        heading = wrap_angle(pose.heading + math.atan2(seen[1], seen[0]))
        x, y = pose.x + step * math.cos(heading), pose.y + step * math.sin(heading)
        pose = Pose(x, y, terrain.height_at(x, y, "rover"), heading)
        slip = rng.normal(0.0, options.odometry_error * step, 3) * (1.0, 1.0, 0.2)
        turn = rng.normal(0.0, options.heading_error_rad * math.sqrt(step))
        error = Transform.from_rpy(0.0, 0.0, turn, slip) * error
        travelled += step


def _look(
    renderer: Renderer,
    rig: CameraRig,
    pair: tuple[str, str],
    pose: Pose,
    believed: Transform,
    look: Array,
    sun: Sun,
    options: ApproachOptions,
    rng: np.random.Generator,
    travelled: float,
) -> tuple[StereoView, Frame, CameraModel]:
    pan, tilt = rig.point_at(believed.inverse().apply(look), pair[0])
    noise = rng.normal(0.0, options.mast_noise_rad, 2)
    half = options.subframe_px // 2
    frames: list[Frame] = []
    cameras: list[CameraModel] = []
    for name in pair:
        told = rig.camera(name, pan, tilt).transformed(believed)
        middle = told.project(look)
        if not np.isfinite(middle).all():
            raise RenderError(f"the target is behind {name}")
        left = int(np.clip(round(float(middle[0])) - half, 0, told.width - options.subframe_px))
        top = int(np.clip(round(float(middle[1])) - half, 0, told.height - options.subframe_px))
        window = (left, top, options.subframe_px, options.subframe_px)
        frames.append(
            renderer.render(
                rig.camera(name, pan + noise[0], tilt + noise[1]),
                pose,
                sun,
                window=window,
                sensor=rig.mounted(name).sensor,
                exposure=frames[0].exposure if frames else None,
                seed=int(rng.integers(1 << 31)),
            )
        )
        cameras.append(told.window(*window))
    view = StereoView(frames[0].unit, frames[1].unit, cameras[0], cameras[1], travelled_m=travelled)
    return view, frames[0], frames[0].camera


def _off(frame: Frame, update: TrackUpdate, target: Array) -> float:
    if not np.isfinite(update.pixel).all():
        return math.inf
    line, sample = (
        int(np.clip(round(float(v)), 0, options - 1))
        for v, options in zip(update.pixel[::-1], frame.image.shape, strict=True)
    )
    return float(np.linalg.norm(frame.truth.point_site[line, sample] - target))
