"""Imaging commands of a rover on terrain: `image`, `imagepanorama`, `pointmast`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from executive.ports import Command, Value
from rover_iface.cameras.model import Array
from rover_iface.cameras.panorama import camera_document
from rover_iface.errors import CameraError, RenderError
from rover_iface.frames import wrap_angle
from rover_iface.simulator.body import Body
from rover_iface.simulator.engine import Action, Outcome, Step, number, pose_label
from rover_iface.simulator.following import TargetFollower
from rover_iface.simulator.mast_cameras import MastCameras
from rover_iface.simulator.products import picture_label, png
from rover_iface.simulator.routine import RoutineRover

IMAGE_PX = 400
MOSAIC_PX = 4096


class Imaging:
    """Takes pictures for science. Targets are looked at where they are believed to be."""

    def __init__(
        self, host: RoutineRover, body: Body, cameras: MastCameras, follower: TargetFollower
    ) -> None:
        self.host = host
        self.body = body
        self.cameras = cameras
        self.follower = follower

    def image(self, command: Command) -> Action:
        """Carry out `image`."""
        if self.host.camera_failed:
            return Outcome(False, "camera failed", {"made": False})
        name = str(command.parameters.get("target", ""))
        if name and name not in self.body.targets:
            return Outcome(False, f"unknown target {name}", {"made": False})
        instrument = str(command.parameters.get("instrument", ""))
        profile = self.body.profile
        figures = profile.instruments.get(instrument)
        if figures is None:
            figures = next(i for i in profile.instruments.values() if i.kind == "remote")
        camera = figures.camera or profile.cameras.science
        duration, energy = self.host.drawn(figures, self.body.rng)
        yield Step(duration, energy)
        point = self.follower.position(name) if name else self._far_point(command)
        values: dict[str, Value] = {"made": True, "energy_j": energy}
        try:
            shot = self.cameras.picture(np.asarray(point, dtype=float), camera, self.host.t_s, IMAGE_PX)
        except (CameraError, RenderError) as err:
            return Outcome(False, str(err), {"made": False, "energy_j": energy})
        truth = self.follower.truth(name) if name else None
        label = {
            "instrument": instrument or camera,
            "camera": camera,
            **picture_label(shot.camera, point, self.body, shot.frame.camera, truth),
        }
        if name:
            label["target"] = name
        values["products"] = float(
            self.host.write_product(command, "image", png(shot.frame.image8), ".png", label)
        )
        return Outcome(True, values=values)

    def _far_point(self, command: Command) -> Array:
        """Return a point (3,) 20 m away in the direction of a command, believed site frame."""
        azimuth, elevation = number(command, "azimuth", 0.0), number(command, "elevation", 0.0)
        mast = self.body.profile.mast
        eye = self.body.believed.site_from_rover.apply(
            np.array([mast.base_m[0], mast.base_m[1], mast.height_m])
        )
        level = math.cos(elevation)
        way = np.array([level * math.cos(azimuth), level * math.sin(azimuth), math.sin(elevation)])
        return np.asarray(eye + 20.0 * way)

    def panorama(self, command: Command) -> Action:
        """Carry out `imagepanorama`."""
        if self.host.camera_failed:
            return Outcome(False, "camera failed")
        duration, energy = self.host.spread("imagepanorama")
        yield Step(duration, energy)
        try:
            count = self._write_panorama(command)
        except (CameraError, RenderError) as err:
            return Outcome(False, str(err), {"energy_j": energy})
        return Outcome(True, values={"products": float(count), "energy_j": energy})

    def _write_panorama(self, command: Command) -> int:
        """Write a folder of the form `panorama/1`, and a mosaic of it; every file is a product."""
        if self.host.out is None:
            return 0
        heading = self.body.believed.heading
        left = number(command, "from_azimuth", heading + math.pi)
        right = number(command, "to_azimuth", left)
        cameras = self.body.profile.cameras
        name = str(command.parameters.get("instrument", cameras.navigation)).removesuffix("_left")
        taken = self.cameras.panorama(left, right, self.host.t_s, camera=name, name=command.id.task)
        stem = self.host.product_stem(command, "panorama")
        folder = taken.save(self.host.out / "products" / stem)
        mosaic, edges = _cut(*taken.mosaic(MOSAIC_PX))
        (folder / "mosaic.png").write_bytes(png(mosaic))
        self.host.announce_product(command, "panorama", folder / "mosaic.png", {"camera": name, **edges})
        truth = {"frame": "true site", "pose": pose_label(self.body.pose)}
        label: dict[str, Any] = {"camera": name, "simulation_truth": truth}
        self.host.announce_product(command, "stereopanorama", folder / "panorama.json", label)
        for k, wedge in enumerate(taken.wedges):
            for side, camera in (("left", wedge.left_camera), ("right", wedge.right_camera)):
                label = {"camera": f"{name}_{side}", "camera_model": camera_document(camera)}
                path = folder / f"wedge{k:02d}_{side}.png"
                self.host.announce_product(command, "wedge", path, label)
        return 2 + 2 * len(taken.wedges)

    def point_mast(self, command: Command) -> Action:
        """Carry out `pointmast`."""
        duration, energy = self.host.spread("pointmast")
        yield Step(duration, energy)
        name = str(command.parameters.get("target", ""))
        if name:
            if name not in self.body.targets:
                return Outcome(False, f"unknown target {name}")
            try:
                pan, tilt = self.cameras.point_at(self.follower.position(name))
            except CameraError as err:
                return Outcome(False, str(err))
        else:
            pan = wrap_angle(number(command, "azimuth", 0.0) - self.body.believed.heading)
            tilt = number(command, "elevation", 0.0)
        return Outcome(True, values={"pan": float(pan), "tilt": float(tilt)})


def _cut(
    mosaic: npt.NDArray[np.uint8], edges: Mapping[str, float]
) -> tuple[npt.NDArray[np.uint8], dict[str, float]]:
    """Return a mosaic of the whole round without the widest gap that no wedge fills, and its edges."""
    seen = np.flatnonzero(mosaic.any(axis=0))
    gaps = np.diff(np.append(seen, seen[0] + mosaic.shape[1]))
    widest = int(gaps.argmax())
    first = int(seen[(widest + 1) % len(seen)])
    width = mosaic.shape[1] - int(gaps[widest]) + 1
    left = (edges["left_azimuth_rad"] + first * edges["rad_per_px"]) % math.tau
    return np.roll(mosaic, -first, axis=1)[:, :width], {**edges, "left_azimuth_rad": left}
