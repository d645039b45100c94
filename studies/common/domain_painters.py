"""Who takes the pictures of `studies.domains`: own renderer, real grain over its geometry, or MuJoCo."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.model import CameraModel
from rover_iface.cameras.rig import Sensor
from rover_iface.simulator.render.picture import AutoExposure, Truth
from rover_iface.simulator.render.renderer import Renderer, Sun
from studies.common.domain_split import GRAIN, Purpose
from studies.common.draped import Drape, digitised, draped_light, gain_for
from studies.common.tracking_worlds import Array

Window = tuple[int, int, int, int]
LARGEST_PX = (481, 401)
"""Largest window that a painter is asked for if nothing is said, width and height."""
Picture = tuple[npt.NDArray[np.uint8], Truth, float]
"""Picture in 8 bits, what it shows, and the gain it was exposed with."""


class Painter(Protocol):
    """Takes pictures of one world."""

    def __call__(
        self, camera: CameraModel, window: Window, sun: Sun, gain: float | None, noise: int
    ) -> Picture:
        """Return a window of a camera (site frame); a gain of None exposes it, `noise` is a seed."""

    def close(self) -> None:
        """Free what is kept between pictures."""


class OwnPainter:
    """Domain (a): the own renderer."""

    def __init__(self, renderer: Renderer, sensor: Sensor) -> None:
        self.renderer, self.sensor = renderer, sensor

    def __call__(
        self, camera: CameraModel, window: Window, sun: Sun, gain: float | None, noise: int
    ) -> Picture:
        """See `Painter`."""
        frame = self.renderer.render(
            camera,
            None,
            sun,
            window=window,
            sensor=self.sensor,
            exposure=AutoExposure() if gain is None else gain,
            seed=noise,
        )
        return frame.image8, frame.truth, frame.exposure

    def close(self) -> None:
        """See `Painter`."""


class DrapedPainter:
    """Domain (b): the renderer's geometry and shade under the grain, albedo and blur of a real frame."""

    def __init__(self, renderer: Renderer, purpose: Purpose, imagery: Path, seed: int) -> None:
        self.renderer, self.seed = renderer, seed
        rng = np.random.default_rng([seed, 0xD4A])
        self.drape = _drape(purpose, imagery, rng)
        self.blur_px = float(rng.uniform(0.45, 0.85))

    def __call__(
        self, camera: CameraModel, window: Window, sun: Sun, gain: float | None, noise: int
    ) -> Picture:
        """See `Painter`."""
        light, truth = draped_light(self.renderer, self.drape, camera, window, sun, self.blur_px)
        used = gain_for(light) if gain is None else gain
        return digitised(light, used, np.random.default_rng([self.seed, noise])), truth, used

    def close(self) -> None:
        """See `Painter`."""


class MujocoPainter:
    """Domain (d): the same triangles in MuJoCo's renderer; blur and noise of the sensor are added."""

    def __init__(
        self,
        renderer: Renderer,
        purpose: Purpose,
        imagery: Path,
        seed: int,
        middle: Array,
        largest: tuple[int, int],
    ) -> None:
        from studies.common.mujoco_pictures import MujocoPictures, baked

        self.scene, self.seed, self.middle = renderer.scene, seed, middle
        rng = np.random.default_rng([seed, 0xD4D])
        drape = _drape(purpose, imagery, rng)
        self.blur_px = float(rng.uniform(0.45, 0.85))
        texture = baked(drape.levels[0], drape.pixel_m, drape.shift[:2])
        self.pictures = MujocoPictures(self.scene, texture, largest)

    def __call__(
        self, camera: CameraModel, window: Window, sun: Sun, gain: float | None, noise: int
    ) -> Picture:
        """See `Painter`."""
        import cv2

        from studies.common.mujoco_pictures import cast_truth

        cut = camera.window(*window)
        truth = cast_truth(self.scene, cut, sun)
        light = cv2.GaussianBlur(self.pictures.light(cut, sun, self.middle), (0, 0), self.blur_px)
        used = gain_for(light) if gain is None else gain
        return digitised(light, used, np.random.default_rng([self.seed, noise])), truth, used

    def close(self) -> None:
        """See `Painter`."""
        self.pictures.close()


def painter(
    domain: str,
    renderer: Renderer,
    sensor: Sensor,
    purpose: Purpose,
    imagery: Path,
    seed: int,
    middle: Array,
    largest: tuple[int, int] = LARGEST_PX,
) -> Painter:
    """Return who takes the pictures of a domain in one world, round a point `middle` (3,), m.

    `largest` is the width and height, px, of the largest window that it is asked for.
    """
    if domain == "own":
        return OwnPainter(renderer, sensor)
    if domain == "draped":
        return DrapedPainter(renderer, purpose, imagery, seed)
    return MujocoPainter(renderer, purpose, imagery, seed, middle, largest)


def _drape(purpose: Purpose, imagery: Path, rng: np.random.Generator) -> Drape:
    names = GRAIN[purpose]
    return Drape(imagery / names[int(rng.integers(len(names)))], rng)
