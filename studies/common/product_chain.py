"""What becomes of a picture between the sensor and the product that the archives hold.

A rendered picture is light on a sensor; a real product has a fixed pattern, was averaged, coded at few bits
a pixel, taken through a colour filter, or resampled into a camera without distortion. Most of what statistics
of single pixels tell of a real frame comes from there, so the partner of a real frame goes the way that its
label says the real one went.
"""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.linear import warp
from rover_iface.cameras.model import CameraModel, ModelKind
from rover_iface.simulator.render.picture import AutoExposure, Negative

Grey = npt.NDArray[np.float32]
Mask = npt.NDArray[np.bool_]
FULL_SCALE = 4095
"""Of the 12 bits that MER and MSL cameras have."""

ROW_EDGE = 0.0137
"""By how much the edge between two pixels of a column is off, share of a pixel, rms: what one gains the other
loses. `shared_pattern` of Spirit's two left Navcam frames of sol 1869 has 3.8e-4 at the same pixel and
-1.9e-4 one row on, as such edges have: twice and minus once this squared."""

NAVCAM_RADIAL = (0.0, -0.0143, 0.0209)
"""Distortion of a Navcam before linearisation: R of the label of 2N292280938EFFB100P0703L0M1, centred."""

JPEG_QUALITY = 85
"""Of Perseverance's products for the public; set by eye."""


@dataclass(frozen=True, slots=True)
class Product:
    """How a frame became a product.

    Attributes
    ----------
    exposure
        The rule by which the exposure was set; None where no label tells it.
    linearised
        Whether it was resampled into a camera without distortion.
    averaged
        Pixels of the sensor a side that a pixel of the product is the mean of.
    bits_per_pixel
        Of the wavelet coder on board; None without.
    flat
        Whether the pixels' own gains and the lens's fall-off have been divided out.
    mosaic
        Whether the sensor has a colour filter, whose three channels the grey is the mean of.
    """

    exposure: AutoExposure | None = None
    linearised: bool = False
    averaged: int = 1
    bits_per_pixel: float | None = None
    flat: bool = True
    mosaic: bool = False

    def camera(self, camera: CameraModel) -> CameraModel:
        """Return the camera to be rendered for a product of `camera`."""
        taken = camera
        if self.linearised:
            taken = CameraModel(
                ModelKind.CAHVOR,
                camera.width,
                camera.height,
                camera.C,
                camera.A,
                camera.H,
                camera.V,
                camera.A,
                np.array(NAVCAM_RADIAL),
            )
        k = self.averaged
        if k == 1:
            return taken
        aside = 0.5 * (k - 1)  # pixel (0, 0) is the centre of the upper left one
        return replace(
            taken,
            width=k * taken.width,
            height=k * taken.height,
            H=k * taken.H + aside * taken.A,
            V=k * taken.V + aside * taken.A,
        )

    def develop(self, negative: Negative, camera: CameraModel, seed: int) -> Grey:
        """Return grey (height, width) as the product of `camera` has it, of a whole picture by the camera
        that is to be rendered for it.
        """
        if not self.flat:
            gains = fall_off(negative.camera) * row_edges(negative.light.shape, seed)
            negative = replace(negative, light=np.ascontiguousarray(negative.light * gains, np.float32))
        grey = negative.develop(self.exposure, seed).image.astype(np.float32)
        if self.averaged > 1:
            grey = np.round(self._blocks(grey).mean(axis=(1, 3)))
        if self.bits_per_pixel is not None:
            grey = wavelet_coded(grey, self.bits_per_pixel)
        if self.linearised:
            grey = warp(grey, self.camera(camera), camera)
        if self.mosaic:
            grey = through_mosaic(grey)
        return grey.astype(np.float32)

    def mask(self, rendered: Mask) -> Mask:
        """Return which pixels (rows, columns) of the product come of rendered ones that the mask holds."""
        return np.asarray(self._blocks(rendered).all(axis=(1, 3)))

    def _blocks(self, values: npt.NDArray[Any]) -> npt.NDArray[Any]:
        k = self.averaged
        return values.reshape(values.shape[0] // k, k, values.shape[1] // k, k)


def product_of(label: Mapping[str, Any]) -> Product:
    """Return how the product of a MER or MSL label came about.

    Raises
    ------
    KeyError
        If the label lacks one of the groups that tell.
    """
    asked, state = label["OBSERVATION_REQUEST_PARMS"], label["INSTRUMENT_STATE_PARMS"]
    return Product(
        AutoExposure(
            float(asked["AUTO_EXPOSURE_DATA_CUT"]) / FULL_SCALE, float(asked["AUTO_EXPOSURE_PERCENT"])
        ),
        linearised=label["GEOMETRY_PROJECTION_TYPE"] == "LINEARIZED",
        averaged=int(state["PIXEL_AVERAGING_WIDTH"]),
        bits_per_pixel=float(label["COMPRESSION_PARMS"]["INST_CMPRS_RATE"]),
        flat="FLAT_FIELD_FILE_NAME" in label.get("DERIVED_IMAGE_PARMS", {}),
    )


def row_edges(shape: tuple[int, ...], seed: int) -> Grey:
    """Return the gains (rows, columns) of pixels whose edges along a column are off by `ROW_EDGE`."""
    edges = np.random.default_rng([seed, 0x0F9A]).normal(0.0, ROW_EDGE, (shape[0] + 1, shape[1]))
    return np.asarray(1.0 + np.diff(edges, axis=0), dtype=np.float32)


def shared_pattern(first: Grey, second: Grey, rows: int = 0) -> float:
    """Return the covariance of what two frames (h, w) of one sensor have in common, `rows` apart.

    It is that of what each pixel differs by from its surroundings, as a share of these: different scenes have
    nothing in common there, the sensor's fixed pattern is in both.
    """
    import cv2

    limit = 0.1  # edges of the scene are larger, a pattern is not
    a, b = (f / cv2.GaussianBlur(f, (0, 0), 1.5) - 1.0 for f in (first, second))
    a, b = a[: a.shape[0] - rows], b[rows:]
    kept = (np.abs(a) < limit) & (np.abs(b) < limit)
    return float(np.mean(a[kept] * b[kept]))


def wavelet_coded(grey: Grey, bits_per_pixel: float) -> Grey:
    """Return grey of 12 bits (rows, columns) as it comes back from a wavelet coder at that rate.

    JPEG 2000 stands for ICER, which is as good at equal rates (Kiely and Klimesh 2003, section VI).
    """
    from PIL import Image

    held = io.BytesIO()
    counts = np.clip(np.round(grey), 0, FULL_SCALE).astype(np.uint16)
    # the library counts its rate against the 16 bits that it is handed
    Image.fromarray(counts).save(
        held, "JPEG2000", quality_mode="rates", quality_layers=[16.0 / bits_per_pixel], irreversible=True
    )
    return np.asarray(Image.open(held), dtype=np.float32)


def through_mosaic(grey: Grey) -> Grey:
    """Return the mean of red, green and blue (rows, columns) of grey ground, each sampled behind a Bayer
    filter and interpolated linearly.
    """
    import cv2

    linear = np.array([[1, 2, 1], [2, 4, 2], [1, 2, 1]], np.float32)
    total = np.zeros_like(grey)
    for places in (((0, 0),), ((0, 1), (1, 0)), ((1, 1),)):
        taken = np.zeros_like(grey)
        for down, across in places:
            taken[down::2, across::2] = 1.0
        total += cv2.filter2D(grey * taken, -1, linear) / cv2.filter2D(taken, -1, linear)
    return total / 3.0


def jpeg_coded(grey: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    """Return grey of 8 bits (rows, columns) as it comes back from JPEG."""
    import cv2

    coded = cv2.imencode(".jpg", grey, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])[1]
    return np.asarray(cv2.imdecode(coded, cv2.IMREAD_GRAYSCALE), dtype=np.uint8)


def fall_off(camera: CameraModel) -> npt.NDArray[np.float64]:
    """Return which share of the light in the middle falls on each pixel (h, w) of a camera, by its optics.

    That goes with the solid angle that a pixel sees and with the cosine of the angle to the optical axis, by
    which the pupil is foreshortened: cos^4 for a lens without distortion, less for a fisheye.
    """
    u, v = np.meshgrid(np.arange(camera.width, dtype=float), np.arange(camera.height, dtype=float))
    _, rays = camera.back_project(np.stack((u, v), axis=-1))
    down, across = np.gradient(rays, axis=(0, 1))
    angle = np.linalg.norm(np.cross(down, across), axis=-1)
    axis = camera.O if camera.kind is ModelKind.CAHVORE else camera.A
    light = np.clip(rays @ (axis / np.linalg.norm(axis)), 0.0, 1.0) * angle
    return np.asarray(light / light.max())
