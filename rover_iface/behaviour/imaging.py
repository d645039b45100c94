"""Imaging commands of a rover on terrain: `image`, `imagepanorama`, `pointmast`."""

from __future__ import annotations

import math
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from executive.ports import Command, Value
from mission.instrument import Use
from rover_iface.behaviour.action import Action, Outcome, number
from rover_iface.behaviour.following import TargetFollower
from rover_iface.behaviour.hardware import Hardware, ProductFile
from rover_iface.behaviour.mast_cameras import MastCameras
from rover_iface.behaviour.products import picture_label, png
from rover_iface.cameras.model import Array
from rover_iface.cameras.panorama import camera_document
from rover_iface.errors import CameraError, RenderError
from rover_iface.frames import wrap_angle

IMAGE_PX = 400
MOSAIC_PX = 4096


class Imaging:
    """Takes pictures for science. Targets are looked at where they are believed to be."""

    def __init__(self, hardware: Hardware, cameras: MastCameras, follower: TargetFollower) -> None:
        self.hardware = hardware
        self.cameras = cameras
        self.follower = follower

    def image(self, command: Command) -> Action:
        """Carry out `image`."""
        if not self.hardware.cameras_work:
            return Outcome(False, "camera failed", {"made": False})
        name = str(command.parameters.get("target", ""))
        if name and name not in self.follower.targets:
            return Outcome(False, f"unknown target {name}", {"made": False})
        instrument = str(command.parameters.get("instrument", ""))
        profile = self.hardware.profile
        figures = profile.instruments.get(instrument)
        if figures is None:
            figures = profile.instrument(profile.usual_instrument(Use.REMOTE))
        camera = figures.camera or profile.cameras.science
        energy = yield from self.hardware.operate(figures)
        point = self.follower.position(name) if name else self._far_point(command)
        values: dict[str, Value] = {"made": True, "energy_j": energy}
        try:
            shot = self.cameras.picture(np.asarray(point, dtype=float), camera, IMAGE_PX)
        except (CameraError, RenderError) as err:
            return Outcome(False, str(err), {"made": False, "energy_j": energy})
        label = {
            "instrument": instrument or camera,
            "camera": camera,
            **picture_label(shot.camera, point),
        }
        if name:
            label["target"] = name
        values["products"] = float(
            self.hardware.write_product(
                command, "image", png(shot.picture.image8), ".png", label, picture=shot.picture.number
            )
        )
        return Outcome(True, values=values)

    def looked_at(self, command: Command) -> Array | None:
        """Return the point (3,), m, believed site frame, that a command looks at; None if it is of a target
        that nobody designated.
        """
        name = str(command.parameters.get("target", ""))
        if not name:
            return self._far_point(command)
        return np.asarray(self.follower.position(name)) if name in self.follower.targets else None

    def in_reach(self, point: Array) -> bool:
        """Return whether the mast can point at a point (3,), m, of the believed site frame from here."""
        try:
            self.cameras.point_at(point)
        except CameraError:
            return False
        return True

    def _far_point(self, command: Command) -> Array:
        """Return a point (3,) 20 m away in the direction of a command, believed site frame."""
        azimuth, elevation = number(command, "azimuth", 0.0), number(command, "elevation", 0.0)
        mast = self.hardware.profile.mast
        eye = self.hardware.believed.site_from_rover.apply(
            np.array([mast.base_m[0], mast.base_m[1], mast.height_m])
        )
        level = math.cos(elevation)
        way = np.array([level * math.cos(azimuth), level * math.sin(azimuth), math.sin(elevation)])
        return np.asarray(eye + 20.0 * way)

    def panorama(self, command: Command) -> Action:
        """Carry out `imagepanorama`."""
        if not self.hardware.cameras_work:
            return Outcome(False, "camera failed")
        energy = yield from self.hardware.spend("imagepanorama")
        try:
            count = self._write_panorama(command)
        except (CameraError, RenderError) as err:
            return Outcome(False, str(err), {"energy_j": energy})
        return Outcome(True, values={"products": float(count), "energy_j": energy})

    def _write_panorama(self, command: Command) -> int:
        """Write a folder of the form `panorama/1`, and a mosaic of it; every file is a product."""
        if not self.hardware.keeps_products:
            return 0
        heading = self.hardware.believed.heading
        left = number(command, "from_azimuth", heading + math.pi)
        right = number(command, "to_azimuth", left)
        cameras = self.hardware.profile.cameras
        name = str(command.parameters.get("instrument", cameras.navigation)).removesuffix("_left")
        taken = self.cameras.panorama(left, right, camera=name, name=command.id.task)
        mosaic, edges = taken.cut_mosaic(MOSAIC_PX)
        with TemporaryDirectory() as made:
            folder = taken.save(Path(made))
            files = [ProductFile("mosaic.png", png(mosaic), "panorama", {"camera": name, **edges})]
            document = (folder / "panorama.json").read_bytes()
            files.append(ProductFile("panorama.json", document, "stereopanorama", {"camera": name}))
            for k, wedge in enumerate(taken.wedges):
                for side, camera in (("left", wedge.left_camera), ("right", wedge.right_camera)):
                    label: dict[str, Any] = {
                        "camera": f"{name}_{side}",
                        "camera_model": camera_document(camera),
                    }
                    file = f"wedge{k:02d}_{side}.png"
                    files.append(ProductFile(file, (folder / file).read_bytes(), "wedge", label))
        return self.hardware.write_folder(command, "panorama", files)

    def point_mast(self, command: Command) -> Action:
        """Carry out `pointmast`."""
        energy = yield from self.hardware.spend("pointmast")
        name = str(command.parameters.get("target", ""))
        if name:
            if name not in self.follower.targets:
                return Outcome(False, f"unknown target {name}", {"energy_j": energy})
            try:
                pan, tilt = self.cameras.point_at(self.follower.position(name))
            except CameraError as err:
                return Outcome(False, str(err), {"energy_j": energy})
        else:
            pan = wrap_angle(number(command, "azimuth", 0.0) - self.hardware.believed.heading)
            tilt = number(command, "elevation", 0.0)
        return Outcome(True, values={"pan": float(pan), "tilt": float(tilt), "energy_j": energy})
