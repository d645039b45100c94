"""A rover's hardware in a simulated world: what behaviour sees of `Body`, and what it does to it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache

import numpy as np

from executive.ports import Command, Value
from mission.instrument import Instrument
from rover_iface.behaviour.action import Doing, Step
from rover_iface.behaviour.hardware import (
    CloseUp,
    Cloud,
    Contact,
    Drive,
    Look,
    Picture,
    ProductFile,
    TrackReport,
)
from rover_iface.cameras.model import Array, CameraModel, pinhole
from rover_iface.cameras.rig import rig_of
from rover_iface.errors import PlacementError, RenderError
from rover_iface.frames import Pose
from rover_iface.navigation.navigator import Way
from rover_iface.navigation.sensor import StereoSensor
from rover_iface.placement.arm import Arm
from rover_iface.placement.arm_motion import Motion
from rover_iface.placement.base_placement import check_observation_point
from rover_iface.profile import RoverProfile
from rover_iface.side_by_side import side_by_side
from rover_iface.simulator.body import Body
from rover_iface.simulator.contact import held, place_tool, press
from rover_iface.simulator.engine import milliseconds
from rover_iface.simulator.microscope import close_up
from rover_iface.simulator.render.picture import Frame, Negative
from rover_iface.simulator.routine import RoutineRover
from rover_iface.simulator.truth import Truth


class SimulatedHardware:
    """See `rover_iface.behaviour.hardware.Hardware`.

    A picture is rendered with the camera where it truly is: on the true pose, with the mast off by its bias
    and noise; those of a look together, when the first of them is read out. `truth` is told everything that a
    simulation can score.
    """

    def __init__(self, host: RoutineRover, body: Body, truth: Truth) -> None:
        self.host = host
        self.body = body
        self.truth = truth
        self.rig = rig_of(body.profile)
        self._bias = mast_bias(body)
        self._noisy = 0
        self._ranger = StereoSensor(body.profile)
        self._close_up: Callable[[str], CloseUp] | None = None

    # ---- platform

    @property
    def profile(self) -> RoverProfile:
        return self.body.profile

    @property
    def t_s(self) -> float:
        return self.host.t_s

    @property
    def drawn_j(self) -> float:
        return self.host.drawn_j

    @property
    def believed(self) -> Pose:
        return self.body.believed

    @property
    def travelled_m(self) -> float:
        return self.body.chassis.travelled_m

    @property
    def cameras_work(self) -> bool:
        return True

    @property
    def keeps_products(self) -> bool:
        return self.host.out is not None

    def spend(self, activity: str, share: float = 1.0) -> Doing[float]:
        duration_ms, energy_j = self.host.spread(activity)
        yield Step(round(duration_ms * share), energy_j * share)
        return energy_j * share

    def operate(self, instrument: Instrument, dwell_s: float = 0.0) -> Doing[float]:
        duration_ms, energy_j = self.host.drawn(instrument, self.body.rng)
        yield Step(duration_ms + milliseconds(dwell_s), energy_j)
        return energy_j

    def instrument_delivers(self, instrument: Instrument) -> bool:
        return bool(self.body.rng.random() < instrument.p_success)

    def get(self, key: str) -> Value | None:
        return self.host.get(key)

    def set(self, key: str, value: Value) -> None:
        self.host.set(key, value)

    def report(self) -> None:
        self.host.report()

    def log_track(self, report: TrackReport) -> None:
        self.truth.told(self.host.t_s, report)

    def write_log(self, command: Command, kind: str) -> int:
        rows, data = self.truth.log(kind)
        if not rows:
            return 0
        return int(self.host.write_product(command, kind, data, ".json", {"frame": "site", "rows": rows}))

    def write_product(
        self,
        command: Command,
        kind: str,
        data: bytes,
        suffix: str,
        label: Mapping[str, object],
        *,
        picture: int | None = None,
    ) -> int:
        if picture is not None:
            label = {**label, "simulation_truth": self.truth.label(picture, label.get("target"), kind)}
        return int(self.host.write_product(command, kind, data, suffix, label))

    def write_folder(self, command: Command, kind: str, files: Sequence[ProductFile]) -> int:
        if self.host.out is None:
            return 0
        folder = self.host.out / "products" / self.host.product_stem(command, kind)
        folder.mkdir(parents=True, exist_ok=True)
        for file in files:
            (folder / file.name).write_bytes(file.data)
        for file in files:
            label = dict(file.label)
            if file.kind == "stereopanorama":
                label["simulation_truth"] = self.truth.pose_label()
            self.host.announce_product(command, file.kind, folder / file.name, label)
        return len(files)

    # ---- wheels

    def drive(self, way: Way) -> Doing[Drive]:
        start = self.body.believed
        driven = self.body.chassis.follow(way)
        end = self.body.believed
        yield Step(milliseconds(driven.duration_s), driven.energy_j, ((start.x, start.y), (end.x, end.y)))
        self.tell_pose()
        return Drive(driven.collision, driven.stuck)

    def correct(self, pose: Pose) -> None:
        self.body.chassis.believed = pose
        self.tell_pose()

    def tell_pose(self) -> None:
        """Put the believed pose and the tilt into telemetry, and both poses into the truth's odometry."""
        self.host.set_pose(self.body.believed)
        self.host.set("tilt", self.body.pose.tilt)
        self.truth.moved(self.host.t_s)

    # ---- cameras and ranges

    def scan(self, *, around: bool) -> list[Cloud]:
        return self._ranger.look(self.body.ground, self.body.pose, self.body.rng, around=around)

    def look(self, look: Look) -> Sequence[Picture]:
        mounted = [self.rig.mounted(name) for name in look.cameras]
        pan, tilt = look.pan_rad, look.tilt_rad
        if any(camera.mount == "mast" for camera in mounted):
            off = self._jitter()
            pan, tilt = pan + float(off[0]), tilt + float(off[1])
        sun, render, true = self.body.sun(self.t_s), self.body.eye, self.body.pose.site_from_rover
        models = [
            self.rig.camera(name, pan, tilt).scaled(look.scale).transformed(true) for name in look.cameras
        ]
        for model, window in zip(models, look.windows, strict=True):
            render.require(model, window)
        # the noise of a lone picture of a camera on the body is the same for every one, so that stored days
        # repeat
        alone = len(mounted) == 1 and mounted[0].mount != "mast"
        salts = [0 if alone else self.body.seed * 100_003 + self._noisy + 1 + n for n in range(len(mounted))]
        self._noisy += 0 if alone else len(mounted)

        def gather(number: int) -> Negative:
            window, sensor = look.windows[number], mounted[number].sensor
            return render.gather(models[number], None, sun, window=window, sensor=sensor)

        @cache
        def frames() -> list[Frame]:
            first, *others = side_by_side(gather, range(len(mounted)))
            taken = [first.develop(None, salts[0])]
            for negative, salt in zip(others, salts[1:], strict=True):
                taken.append(negative.develop(taken[-1].exposure, salt))
            return taken

        def picture(number: int) -> Picture:
            taken = self.truth.took(
                models[number].window(*look.windows[number]),
                (lambda: frames()[number]) if look.track else None,
            )
            return Picture(lambda: frames()[number].unit, mounted[number].sensor.bits, taken)

        return [picture(number) for number in range(len(mounted))]

    def _jitter(self) -> Array:
        noise: Array = self._bias + self.body.profile.mast.noise_rad * self.body.rng.standard_normal(2)
        return noise

    # ---- arm

    def reach(self, target: str, point: Array, instrument: str) -> Contact:
        """See `Hardware`; the arm holds the tool along the normal of the true ground, or as near as it can,
        and moves it to where its contact sensors touch.
        """
        body = self.body
        place = np.asarray(body.true_from_believed.apply(point), dtype=np.float64)
        spot = [float(v) for v in place]
        check_observation_point(
            body.terrain, body.profile, body.pose, spot, target=target, instrument=instrument
        )
        normal = np.asarray(body.terrain.normal(spot[0], spot[1], 0.08), dtype=np.float64)
        arm = body.profile.arm
        tool = held(body.renderer.scene, Arm(arm), body.pose.site_from_rover, place, normal)
        if isinstance(tool, str):
            raise PlacementError(f"target {target}: {tool}")
        touch = press(body.renderer.scene, arm, tool)
        believed_from_true = body.true_from_believed.inverse()
        at = np.asarray(believed_from_true.apply(touch.point), dtype=np.float64)
        if not touch.made:
            self._close_up = None
            return Contact(False, touch.reason, at, touch.beyond_m)
        self.truth.touched[target] = touch.point
        camera = imager_over(touch.point, normal)

        def seen(_name: str) -> CloseUp:
            frame = body.renderer.render(camera, None, body.sun(self.t_s), samples=2)
            return CloseUp(
                frame.image8, camera.transformed(believed_from_true), self.truth.took(frame.camera)
            )

        self._close_up = seen
        return Contact(True, "", at, touch.beyond_m)

    def move_arm(self, target: str, motion: Motion) -> Doing[Contact]:
        yield from ()
        body = self.body
        touch = place_tool(
            body.renderer.scene, Arm(body.profile.arm), body.pose.site_from_rover, motion, rng=body.rng
        )
        believed_from_true = body.true_from_believed.inverse()
        at = np.asarray(believed_from_true.apply(touch.point), dtype=np.float64)

        def seen(name: str) -> CloseUp:
            mounted = self.rig.mounted(name)
            camera = mounted.model.transformed(touch.site_from_tool)
            sun = body.sun(self.t_s)
            found = close_up(body.renderer, camera, sun, sensor=mounted.sensor, seed=body.seed)
            return CloseUp(
                found.image,
                found.frame.camera.transformed(believed_from_true),
                self.truth.took(found.frame.camera),
                found.sharp,
                found.pixel_m,
                len(found.stack),
            )

        self._close_up = None
        if touch.made:
            self.truth.touched[target] = touch.point
            self._close_up = seen
        return Contact(touch.made, touch.reason, at, touch.beyond_m)

    def take_close_up(self, camera: str) -> CloseUp:
        if self._close_up is None:
            raise RenderError("the imager on the tool touches nothing")
        return self._close_up(camera)


def mast_bias(body: Body) -> Array:
    """Return by how much the mast of a rover is off (2,), pan and tilt, radians; drawn once, at its start."""
    return np.asarray(body.profile.mast.bias_rad * body.rng.standard_normal(2))


def designated(body: Body, bias: Array, point: Array, camera: str = "navcam_left") -> Array:
    """Return where a surface point (3,), m, of the true site lies by a picture that a person points at it in.

    Believed site frame. The mast is off by its bias (2,), pan and tilt in rad, in that picture as in all that
    are taken later, so the pixel that the person meant is found again; by its noise they differ.

    Raises
    ------
    CameraError
        If the mast cannot point there.
    """
    rig, point = rig_of(body.profile), np.asarray(point, dtype=np.float64)
    believed, true = body.believed.site_from_rover, body.pose.site_from_rover
    there = np.asarray(believed.apply(true.inverse().apply(point)), dtype=np.float64)
    pan, tilt = rig.point_at(believed.inverse().apply(there), camera)
    actual = rig.camera(camera, pan + float(bias[0]), tilt + float(bias[1])).transformed(true)
    told = rig.camera(camera, pan, tilt).transformed(believed)
    eye, way = told.back_project(actual.project(point))
    return np.asarray(eye + float(np.linalg.norm(point - actual.C)) * way)


def imager_over(point: Array, normal: Array, distance_m: float = 0.11, field_m: float = 0.05) -> CameraModel:
    """Return the camera of a microscopic imager over a point (3,), m, looking against the normal (3,), site
    frame.
    """
    away = np.asarray(normal, dtype=float)
    away = away / np.linalg.norm(away)
    up = np.array([0.0, 1.0, 0.0]) if abs(away[2]) > 0.9 else np.array([0.0, 0.0, 1.0])
    pixels = 256
    return pinhole(
        focal_px=pixels * distance_m / field_m,
        width=pixels,
        height=pixels,
        center=np.asarray(point, dtype=float) + distance_m * away,
        forward=-away,
        up=up,
    )
