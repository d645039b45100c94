"""Every frame of natural ground in the imagery folder, with its ground marked by hand.

Frames of one place form a *scene*, and are left out of training together: neighbouring views share their
stones. Not taken: the other products of Spirit's frame 2n292280938 (the same picture again), the K10 pair
(asphalt and made rocks), Curiosity's dark rear Hazcam (a label without a picture), the Aloe and chessboard
pairs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.labels import ImageProduct, read_product
from rover_iface.cameras.model import CameraModel, pinhole
from rover_iface.frames import Transform, rotation_from_quaternion
from rover_iface.simulator.render.renderer import Sun
from studies.common.product_chain import Product, product_of

Grey = npt.NDArray[np.float32]
Mask = npt.NDArray[np.bool_]
Polygon = tuple[tuple[int, int], ...]
IMAGERY = Path(__file__).resolve().parents[2].parent / "shared/data/imagery"
MARS = "Spirit", "Opportunity", "Curiosity", "Perseverance"
FLU_FROM_FRD = np.diag([1.0, -1.0, -1.0])
"""Rover axes of the missions (y right, z down) to those of REP 103."""

MER_ORIGIN_M = 0.30
"""Height of the MER rover frame's origin above the ground, as in `rover_iface/cameras/data/mer.toml`."""


@dataclass(frozen=True, slots=True)
class Guess:
    """A camera without a label: focal length, px, height over level ground, m, tilt below the horizon."""

    focal_px: float
    height_m: float
    tilt_rad: float
    sun_elevation_rad: float
    opacity: float = 0.45


@dataclass(frozen=True, slots=True)
class RealFrame:
    """A real picture and what may be said of it.

    Attributes
    ----------
    ground
        Polygons of (column, row) of the picture as read, px: ground and rocks, without sky, rover, its tracks
        and shadow, the photographer's shadow and lens flares.
    shown
        Whether the licence lets the repository show it.
    guess
        The view where no label tells it.
    shrink
        By how much the scan is reduced first: film is scanned finer than it is sharp.
    rise_rad
        How steeply the ground rises ahead of the rover, by eye: the label's camera is turned down by as much.
    """

    name: str
    mission: str
    scene: str
    path: str
    ground: tuple[Polygon, ...]
    shown: bool = True
    guess: Guess | None = None
    shrink: int = 1
    rise_rad: float = 0.0

    @property
    def of_mars(self) -> bool:
        """Return whether the ground is that of Mars."""
        return self.mission in MARS


# 0.27 mrad/px (Bell et al. 2003, f 43 mm, 12 um); tilt set so that the near rock is some 4 m away, as in the
# published panoramas of such frames; sun not known
_PANCAM = Guess(3583.0, 1.5, math.radians(20.0), math.radians(45.0))
# focal length of the data set; tilt from the row of the horizon (about 234 of 463); mast height is a guess
_DEVON = Guess(969.0, 1.0, math.radians(13.3), math.radians(35.0), 0.15)
# sfm_21030-21035.json, f 2845 px, halved; held before the chest, looking at the foot of the boulder; no air
_APOLLO = Guess(1422.5, 1.45, math.radians(16.0), math.radians(28.0), 1e-3)


def _apollo(number: int, scene: str, *ground: tuple[int, int]) -> RealFrame:
    path = f"sequences/apollo17_boulder_138/AS17-138-{number}HR.jpg"
    return RealFrame(f"Apollo 17, {number}", "Apollo 17", scene, path, (ground,), guess=_APOLLO, shrink=2)


FRAMES = (
    RealFrame(
        "Spirit Navcam, sol 1869, right",
        "Spirit",
        "Spirit sol 1869",
        "mer/2n292280938effb100p0703l0m1.img.gz",
        (
            (
                (20, 120),
                (1000, 120),
                (1000, 770),
                (680, 870),
                (610, 880),
                (610, 620),
                (440, 610),
                (160, 700),
                (20, 960),
            ),
        ),
    ),
    RealFrame(
        "Spirit Navcam, sol 1869, left",
        "Spirit",
        "Spirit sol 1869",
        "mer/2n292280989effb100p0703l0m1.img.gz",
        (((20, 230), (1000, 230), (1000, 850), (330, 830), (300, 860), (190, 990), (20, 990)),),
    ),
    RealFrame(
        "Spirit Navcam, sol 1907",
        "Spirit",
        "Spirit sol 1907",
        "mer/2n295663162fflb1dnp1902l0m1.img.gz",
        (
            ((20, 340), (680, 340), (350, 520), (370, 600), (440, 760), (500, 1000), (20, 1000)),
            ((760, 340), (1000, 340), (1000, 1000), (780, 1000), (640, 740), (520, 600), (480, 500)),
        ),
    ),
    RealFrame(
        "Spirit Pancam, left",
        "Spirit",
        "Spirit Pancam",
        "sequences/spirit_pancam_stereo/4l.png",
        (((20, 20), (860, 20), (860, 1000), (20, 1000)),),
        guess=_PANCAM,
    ),
    RealFrame(
        "Spirit Pancam, right",
        "Spirit",
        "Spirit Pancam",
        "sequences/spirit_pancam_stereo/4r.png",
        (((20, 20), (860, 20), (860, 1000), (20, 1000)),),
        guess=_PANCAM,
    ),
    RealFrame(
        "Opportunity Navcam",
        "Opportunity",
        "Opportunity Navcam",
        "mer/1n579700548ffld2fcp1981l0m1.img.gz",
        (((20, 20), (1000, 20), (1000, 880), (840, 900), (600, 930), (20, 960)),),
    ),
    RealFrame(
        "Opportunity front Hazcam",
        "Opportunity",
        "Opportunity Hazcam",
        "mer/1f581291004ednd2fcp1121r0m1.img.gz",
        (
            (
                (253, 135),
                (470, 177),
                (470, 285),
                (408, 300),
                (394, 416),
                (84, 436),
                (64, 364),
                (211, 360),
                (253, 332),
            ),
        ),
    ),
    RealFrame(
        "Curiosity Navcam, sol 3422",
        "Curiosity",
        "Curiosity sol 3422",
        "msl/NRB_701384494RAD_F0933408NCAM00200M1.IMG.gz",
        (
            (
                (20, 20),
                (1000, 20),
                (1000, 1000),
                (450, 1000),
                (440, 740),
                (670, 700),
                (670, 480),
                (560, 285),
                (380, 265),
                (250, 330),
                (60, 180),
                (20, 180),
            ),
        ),
    ),
    RealFrame(
        "Perseverance Navcam, sol 670",
        "Perseverance",
        "Perseverance sol 670",
        "m2020/NLF_0670_0726421423_362ECM_N0320604NCAM08111_01_095J01-metadata.json",
        (((20, 420), (500, 300), (1270, 120), (1270, 950), (20, 950)),),
        # the upper left tile of a frame: over level ground its middle would see the horizon
        rise_rad=math.radians(12.0),
    ),
    RealFrame(
        "Devon Island 1",
        "Devon Island",
        "Devon Island 1",
        "devon/devon1-left.png",
        (((20, 420), (1260, 340), (1260, 670), (1200, 670), (1200, 940), (20, 940)),),
        shown=False,
        guess=_DEVON,
    ),
    RealFrame(
        "Devon Island 2",
        "Devon Island",
        "Devon Island 2",
        "devon/devon2-left.png",
        (
            (
                (20, 420),
                (500, 420),
                (560, 260),
                (1260, 260),
                (1260, 590),
                (760, 590),
                (760, 940),
                (20, 940),
            ),
        ),
        shown=False,
        guess=_DEVON,
    ),
    _apollo(21030, "Apollo 17 boulder", (20, 480), (1150, 480), (1150, 1150), (20, 1150)),
    _apollo(21031, "Apollo 17 boulder", (20, 400), (1150, 500), (1150, 1150), (20, 1150)),
    _apollo(
        21032,
        "Apollo 17 boulder",
        (20, 300),
        (500, 300),
        (700, 480),
        (1150, 480),
        (1150, 1150),
        (20, 1150),
    ),
    _apollo(
        21033,
        "Apollo 17 boulder",
        (20, 300),
        (400, 300),
        (560, 450),
        (1150, 450),
        (1150, 1150),
        (20, 1150),
    ),
    _apollo(
        21034,
        "Apollo 17 boulder",
        (20, 30),
        (600, 30),
        (800, 500),
        (1150, 400),
        (1150, 1150),
        (350, 1150),
        (300, 480),
        (20, 480),
    ),
    _apollo(
        21035,
        "Apollo 17 boulder",
        (20, 60),
        (1000, 100),
        (1150, 400),
        (1150, 1150),
        (450, 1050),
        (20, 980),
    ),
    _apollo(
        21036,
        "Apollo 17 boulder",
        (20, 100),
        (1150, 350),
        (1150, 1150),
        (980, 1150),
        (980, 850),
        (680, 850),
        (680, 1150),
        (20, 1150),
    ),
    _apollo(
        21037,
        "Apollo 17 boulder",
        (20, 100),
        (1150, 350),
        (1150, 1150),
        (1040, 1150),
        (1040, 840),
        (640, 840),
        (640, 1150),
        (20, 1150),
    ),
)


@dataclass(frozen=True, eq=False)
class View:
    """A frame as data, and what is needed to render its like.

    Attributes
    ----------
    image, ground
        The picture, as stored, and where its ground is; both (height, width).
    camera
        Over level ground at z = 0, x forward, y left, z up, m.
    sun
        In the camera's frame; None where it is not known (its elevation is then the guess's).
    linear
        Whether grey is proportional to light; else it is coded by a square root or as for print.
    product
        How it became what is stored, as far as its label tells.
    """

    frame: RealFrame
    image: Grey
    ground: Mask
    camera: CameraModel
    sun: Sun | None
    linear: bool
    product: Product


def ground_mask(shape: tuple[int, int], ground: tuple[Polygon, ...]) -> Mask:
    """Return where (rows, columns) of that shape polygons of (column, row) lie, px."""
    import cv2

    filled = np.zeros(shape, np.uint8)
    for polygon in ground:
        cv2.fillPoly(filled, [np.array(polygon, np.int32)], 1)
    return filled.astype(bool)


def load_view(frame: RealFrame, folder: Path = IMAGERY) -> View:
    """Return a frame with its mask and camera.

    Raises
    ------
    FileNotFoundError
        If the picture is not there.
    """
    import cv2

    path = folder / frame.path
    if not path.is_file():
        raise FileNotFoundError(f"{frame.name}: no picture {frame.path} in {folder}")
    if frame.guess is None:
        product = read_product(path)
        if product.image is None:
            raise FileNotFoundError(f"{frame.name}: {frame.path} is a label without a picture")
        grey = np.asarray(product.image, dtype=np.float32)
        coloured = grey.ndim == 3
        grey = grey.mean(axis=-1) if coloured else grey
        camera = _above_ground(product, frame)
        return View(
            frame,
            grey,
            ground_mask((grey.shape[0], grey.shape[1]), frame.ground),
            camera,
            _label_sun(product),
            not coloured,
            Product(flat=False, mosaic=True) if coloured else product_of(product.label),
        )
    grey = np.asarray(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE), dtype=np.float32)
    if frame.shrink > 1:
        size = grey.shape[1] // frame.shrink, grey.shape[0] // frame.shrink
        grey = np.asarray(cv2.resize(grey, size, interpolation=cv2.INTER_AREA), dtype=np.float32)
    guess = frame.guess
    camera = pinhole(
        focal_px=guess.focal_px,
        width=grey.shape[1],
        height=grey.shape[0],
        center=(0.0, 0.0, guess.height_m),
        forward=(math.cos(guess.tilt_rad), 0.0, -math.sin(guess.tilt_rad)),
    )
    return View(
        frame, grey, ground_mask((grey.shape[0], grey.shape[1]), frame.ground), camera, None, False, Product()
    )


def _above_ground(product: ImageProduct, frame: RealFrame) -> CameraModel:
    """Return the label's camera, axes of REP 103, origin on the ground, on which the rover stands level."""
    lift = MER_ORIGIN_M if frame.mission in ("Spirit", "Opportunity") else 0.0
    camera = product.camera.transformed(Transform(FLU_FROM_FRD, np.array([0.0, 0.0, lift])))
    eye = camera.C
    turn = Transform.from_rpy(0.0, frame.rise_rad, 0.0)
    return camera.transformed(Transform(turn.rotation, eye - turn.rotate(eye)))


def _label_sun(product: ImageProduct) -> Sun | None:
    """Return the sun in rover axes of REP 103, where the label tells it and how the rover stood."""
    derived = product.label.get("SITE_DERIVED_GEOMETRY_PARMS")
    stood = product.label.get("ROVER_COORDINATE_SYSTEM")
    if derived is None or stood is None:
        return None
    azimuth = math.radians(float(derived["SOLAR_AZIMUTH"]))
    # MER's labels call the angle an elevation yet some print it with the sign of the z axis, which is down
    height = abs(math.radians(float(derived["SOLAR_ELEVATION"])))
    level = math.cos(height)
    ned = np.array([level * math.cos(azimuth), level * math.sin(azimuth), -math.sin(height)])
    site_from_rover = rotation_from_quaternion(*(float(q) for q in stood["ORIGIN_ROTATION_QUATERNION"]))
    x, y, z = FLU_FROM_FRD @ (site_from_rover.T @ ned)
    return Sun((float(x), float(y), float(z)))
