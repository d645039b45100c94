"""A rendered stereo panorama from where the rover stands."""

from __future__ import annotations

import math

from rover_iface.cameras.panorama import Panorama, StereoWedge, wedge_pans
from rover_iface.cameras.rig import CameraRig
from rover_iface.frames import Pose
from rover_iface.simulator.render.picture import Frame
from rover_iface.simulator.render.renderer import Renderer, Sun


def take_panorama(
    renderer: Renderer,
    rig: CameraRig,
    pose: Pose,
    sun: Sun,
    *,
    pair: tuple[str, str] = ("navcam_left", "navcam_right"),
    from_azimuth_rad: float = math.pi,
    span_rad: float = math.tau,
    tilts_rad: tuple[float, ...] = (-0.32,),
    overlap: float = 0.1,
    name: str = "",
    t_s: float = 0.0,
    seed: int = 0,
) -> Panorama:
    """Return stereo wedges side by side, clockwise from an azimuth (counter-clockwise from the front).

    Each pair is exposed by its left image; cameras are given in the site frame of `pose`.
    """
    pans = wedge_pans(rig.mounted(pair[0]).model, from_azimuth_rad, span_rad, overlap)
    wedges = []
    for row, tilt in enumerate(tilts_rad):
        for k, pan in enumerate(pans):
            frames: list[Frame] = []
            for number, camera in enumerate(pair):
                frames.append(
                    renderer.render(
                        rig.camera(camera, pan, tilt),
                        pose,
                        sun,
                        sensor=rig.mounted(camera).sensor,
                        exposure=frames[0].exposure if frames else None,
                        seed=seed + 100 * row + 2 * k + number,
                    )
                )
            wedges.append(
                StereoWedge(
                    f"{row}.{k}", frames[0].image8, frames[1].image8, frames[0].camera, frames[1].camera
                )
            )
    return Panorama(wedges, name, t_s)
