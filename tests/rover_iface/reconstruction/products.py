"""Labelled products for tests: rendered pictures in the dialect of MER labels, and folders of real pairs."""

from __future__ import annotations

import math
import shutil
from datetime import datetime, timedelta
from functools import lru_cache
from pathlib import Path

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.model import Array, CameraModel
from rover_iface.cameras.rig import CameraRig, load_cameras
from rover_iface.frames import FRD_FROM_FLU, NED_FROM_ENU, Pose, Transform, quaternion_of
from rover_iface.simulator.render.from_terrain import scene_from_terrain
from rover_iface.simulator.render.picture import Frame
from rover_iface.simulator.render.renderer import Renderer, Sun
from rover_iface.terrain import Terrain, generate_terrain

RECORD = 1024
TAKEN = datetime.fromisoformat("2009-04-06T08:48:13.468")
SITE = Transform(np.eye(3), np.array([7.25, -3.5, 1.125]))
"""Where the terrain's origin lies in the site frame of the labels, east, north, up: not in its origin."""


def write_product(
    path: Path,
    samples: npt.NDArray[np.generic],
    camera_rover: CameraModel,
    site_from_rover: Transform,
    *,
    eye: str = "LEFT",
    seconds: float = 0.0,
    counter: tuple[int, int] = (137, 0),
    beside_deg: float = 0.0,
    lines: int | None = None,
    extra: str = "",
) -> Path:
    """Write samples [rows, columns] as an attached PDS3 product; cameras and poses are ours, the label's not.

    `beside_deg` falsifies the pointing that the label tells, `lines` the height that it tells.
    """
    camera = camera_rover.moved(FRD_FROM_FLU, np.zeros(3))
    turn = NED_FROM_ENU @ site_from_rover.rotation @ FRD_FROM_FLU
    offset = NED_FROM_ENU @ site_from_rover.translation
    azimuth = math.degrees(math.atan2(camera.A[1], camera.A[0])) + beside_deg
    elevation = math.degrees(math.asin(-camera.A[2]))
    number = TAKEN + timedelta(seconds=seconds)
    letters = list(camera.kind)
    vectors = "\n".join(
        f"  MODEL_COMPONENT_{k} = ({', '.join(f'{v:.9g}' for v in getattr(camera, letter))})"
        for k, letter in enumerate(letters, 1)
    )
    place = f"({counter[0]},{counter[1]},0,13,7)"
    text = f"""PDS_VERSION_ID = PDS3
RECORD_TYPE = FIXED_LENGTH
RECORD_BYTES = {RECORD}
^IMAGE = 8
FRAME_ID = "{eye}"
INSTRUMENT_ID = "NAVCAM_{eye}"
PRODUCT_ID = "{path.stem.upper()}"
ROVER_MOTION_COUNTER = {place}
START_TIME = {number.isoformat(timespec="milliseconds")}
GROUP = GEOMETRIC_CAMERA_MODEL
  MODEL_TYPE = {camera.kind}
  MODEL_COMPONENT_ID = ({", ".join(f'"{letter}"' for letter in letters)})
{vectors}
  REFERENCE_COORD_SYSTEM_INDEX = {place}
  REFERENCE_COORD_SYSTEM_NAME = ROVER_FRAME
END_GROUP = GEOMETRIC_CAMERA_MODEL
GROUP = ROVER_COORDINATE_SYSTEM
  COORDINATE_SYSTEM_NAME = ROVER_FRAME
  ORIGIN_OFFSET_VECTOR = ({", ".join(f"{v:.6f}" for v in offset)})
  ORIGIN_ROTATION_QUATERNION = ({", ".join(f"{v:.9f}" for v in quaternion_of(turn))})
  REFERENCE_COORD_SYSTEM_INDEX = {counter[0]}
  REFERENCE_COORD_SYSTEM_NAME = SITE_FRAME
END_GROUP = ROVER_COORDINATE_SYSTEM
GROUP = ROVER_DERIVED_GEOMETRY_PARMS
  INSTRUMENT_AZIMUTH = {azimuth:.4f} <deg>
  INSTRUMENT_ELEVATION = {elevation:.4f} <deg>
  REFERENCE_COORD_SYSTEM_NAME = ROVER_FRAME
END_GROUP = ROVER_DERIVED_GEOMETRY_PARMS
{extra}
OBJECT = IMAGE
  LINES = {samples.shape[0] if lines is None else lines}
  LINE_SAMPLES = {samples.shape[1]}
  SAMPLE_TYPE = MSB_INTEGER
  SAMPLE_BITS = 16
  BANDS = 1
  MISSING_CONSTANT = 0.0
END_OBJECT = IMAGE
END
"""
    label = text.encode("latin-1")
    assert len(label) <= 7 * RECORD
    path.write_bytes(label.ljust(7 * RECORD, b" ") + samples.astype(">i2").tobytes())
    return path


@lru_cache(maxsize=1)
def site() -> Terrain:
    """Return a small generated site, the truth of rendered products."""
    return generate_terrain(11, 48.0)


@lru_cache(maxsize=1)
def rendered() -> tuple[tuple[Pose, tuple[CameraModel, CameraModel], tuple[Array, Array]], ...]:
    """Return two stereo pairs of a turned and tilted rover: its pose, cameras in the rover, samples."""
    terrain = site()
    pose = Pose(0.0, 0.0, float(terrain.height(0.0, 0.0)), heading=0.7, pitch=-0.06, roll=0.04)
    rig = CameraRig(load_cameras("mer"), (0.45, 0.03, 1.1))
    renderer = Renderer(scene_from_terrain(terrain, radius_m=14.0, stones_per_m2=2.0))
    sun = Sun.from_angles(math.radians(240.0), math.radians(45.0))
    pairs = []
    for k, pan in enumerate((0.25, -0.35)):
        # half the resolution of the flight camera: a quarter of the time
        cameras = [rig.camera(f"navcam_{side}", pan, -0.45).scaled(0.5) for side in ("left", "right")]
        frames: list[Frame] = []
        for number, camera in enumerate(cameras):
            exposure = frames[0].exposure if frames else None
            frames.append(renderer.render(camera, pose, sun, exposure=exposure, seed=10 * k + number))
        samples = [np.maximum(1, np.round(4095.0 * f.unit)).astype(np.float64) for f in frames]
        pairs.append((pose, (cameras[0], cameras[1]), (samples[0], samples[1])))
    return tuple(pairs)


def rendered_folder(folder: Path, pairs: int = 2) -> Path:
    """Write the rendered pairs as products in the dialect of MER labels."""
    folder.mkdir(parents=True, exist_ok=True)
    for k, (pose, cameras, samples) in enumerate(rendered()[:pairs]):
        for eye, camera, picture in zip(("LEFT", "RIGHT"), cameras, samples, strict=True):
            write_product(
                folder / f"2n{k}{eye.lower()}.img",
                picture,
                camera,
                SITE * pose.site_from_rover,
                eye=eye,
                seconds=51.0 * k,
            )
    return folder


DEVON_RIG = """
[rig.pinhole]
width = 1280
height = 960
focal_px = 968.999694824
principal_px = [635.139038086, 463.537109375]
baseline_m = 0.239977002
"""


def devon_folder(imagery: Path, folder: Path, *numbers: int) -> Path:
    """Copy pairs of the Devon set to a folder with their description; the pose of the camera is made up."""
    folder.mkdir(parents=True, exist_ok=True)
    text = f'format = "image-pairs/1"\nname = "Devon"\n{DEVON_RIG}'
    for number in numbers:
        names = [f"devon{number}-{side}.png" for side in ("left", "right")]
        for name in names:
            shutil.copyfile(imagery / "devon" / name, folder / name)
        text += f"""
[[pairs]]
left = "{names[0]}"
right = "{names[1]}"
position_m = [0.0, {3.0 * number:.1f}, 1.5]
heading_deg = 90.0
pitch_deg = -22.0
"""
    (folder / "pairs.toml").write_text(text)
    return folder
