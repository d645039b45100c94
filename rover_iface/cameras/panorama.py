"""Where the rover has been looking: a stereo panorama in which a person picks targets.

A panorama is a set of stereo wedges whose camera models share one frame (the site frame). It is rendered
(`rover_iface.simulator.render.panorama`) or imported from images with models, kept as a folder of PNG
images and `panorama.json`, and shown as one cylindrical mosaic. A pick is a pixel of a wedge or of the
mosaic; point stereo gives the surface point, its covariance and its normal from the geometry in which it
was seen.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NotRequired, TypedDict

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.model import Array, CameraModel, ModelKind
from rover_iface.cameras.stereo import PointMatch, PointStereo, point_stereo
from rover_iface.errors import CameraError
from rover_iface.frames import wrap_angle

FORMAT = "panorama/1"
Grey = npt.NDArray[np.uint8]


@dataclass(frozen=True)
class StereoWedge:
    """One stereo pair of a panorama: 8-bit images and their cameras, site frame."""

    name: str
    left: Grey
    right: Grey
    left_camera: CameraModel
    right_camera: CameraModel

    def __post_init__(self) -> None:
        for side, image, camera in (
            ("left", self.left, self.left_camera),
            ("right", self.right, self.right_camera),
        ):
            if image.shape != (camera.height, camera.width):
                raise CameraError(
                    f"wedge {self.name}: {side} image is {image.shape}, its camera "
                    f"{camera.height} x {camera.width}"
                )

    def pick(self, pixel: npt.ArrayLike, options: PointStereo | None = None) -> PointMatch:
        """Return the surface point under a pixel [2], (sample, line), of the left image.

        Raises
        ------
        CameraError
            If the right image does not show it, or not clearly.
        """
        at = np.asarray(pixel, dtype=np.float64)
        one, two = (image.astype(np.float32) / np.float32(255.0) for image in (self.left, self.right))
        match = point_stereo(one, two, self.left_camera, self.right_camera, at, options=options)
        if match is None or match.score < 0.7:
            score = "none" if match is None else f"{match.score:.2f}"
            raise CameraError(
                f"wedge {self.name}: no stereo at pixel ({at[0]:.0f}, {at[1]:.0f}): score {score}, limit 0.7"
            )
        return match


@dataclass(frozen=True)
class Panorama:
    """Wedges seen from one place."""

    wedges: Sequence[StereoWedge]
    name: str = ""
    t_s: float = 0.0

    def __post_init__(self) -> None:
        if not self.wedges:
            raise CameraError("a panorama needs at least one wedge")

    @cached_property
    def eye(self) -> Array:
        """Return the mean of the left cameras' centres (3,): the middle of the mosaic."""
        return np.asarray(np.mean([w.left_camera.C for w in self.wedges], axis=0))

    def find(self, azimuth_rad: float, elevation_rad: float) -> tuple[StereoWedge, Array]:
        """Return the wedge that sees a direction (azimuth clockwise from north) best, and the pixel.

        Raises
        ------
        CameraError
            If no wedge sees it.
        """
        level = math.cos(elevation_rad)
        ray = np.array(
            [level * math.sin(azimuth_rad), level * math.cos(azimuth_rad), math.sin(elevation_rad)]
        )
        best: tuple[float, StereoWedge, Array] | None = None
        for wedge in self.wedges:
            camera = wedge.left_camera
            pixel = camera.project(camera.C + 1e3 * ray)
            if not np.isfinite(pixel).all():
                continue
            inside = min(pixel[0], pixel[1], camera.width - 1 - pixel[0], camera.height - 1 - pixel[1])
            if inside >= 0 and (best is None or inside > best[0]):
                best = float(inside), wedge, pixel
        if best is None:
            raise CameraError(
                f"the panorama does not show azimuth {math.degrees(azimuth_rad):.1f}, "
                f"elevation {math.degrees(elevation_rad):.1f} degrees"
            )
        return best[1], best[2]

    def pick(self, azimuth_rad: float, elevation_rad: float) -> PointMatch:
        """Return the surface point in a direction seen in the mosaic."""
        wedge, pixel = self.find(azimuth_rad, elevation_rad)
        return wedge.pick(pixel)

    def mosaic(self, width_px: int = 2048) -> tuple[Grey, Mapping[str, float]]:
        """Return a cylindrical mosaic and what its edges are.

        Columns are azimuths, north to north over east, rows elevations; the mapping holds `left_azimuth_rad`,
        `top_elevation_rad` and `rad_per_px`. Pixels that no wedge sees are 0.
        """
        import cv2

        step = 2.0 * math.pi / width_px
        heights = []
        for wedge in self.wedges:
            border = _border(wedge.left_camera)
            heights.append(np.arcsin(np.clip(wedge.left_camera.back_project(border)[1][:, 2], -1, 1)))
        low, high = float(np.min(heights)), float(np.max(heights))
        rows = max(1, math.ceil((high - low) / step))
        azimuth = np.arange(width_px) * step
        elevation = high - np.arange(rows) * step
        level = np.cos(elevation)[:, None]
        rays = np.stack(
            (
                level * np.sin(azimuth),
                level * np.cos(azimuth),
                np.broadcast_to(np.sin(elevation)[:, None], (rows, width_px)),
            ),
            axis=-1,
        )
        out = np.zeros((rows, width_px), np.uint8)
        margin = np.full((rows, width_px), -1.0)
        for wedge in self.wedges:
            camera = wedge.left_camera
            pixels = camera.project(camera.C + 1e3 * rays).astype(np.float32)
            u, v = pixels[..., 0], pixels[..., 1]
            with np.errstate(invalid="ignore"):
                inside = np.minimum(np.minimum(u, camera.width - 1 - u), np.minimum(v, camera.height - 1 - v))
            inside = np.where(np.isfinite(inside), inside, -1.0)
            better = inside > margin
            if not better.any():
                continue
            seen = cv2.remap(
                wedge.left, np.nan_to_num(u, nan=-1.0), np.nan_to_num(v, nan=-1.0), cv2.INTER_LINEAR
            )
            out[better] = seen[better]
            margin = np.where(better, inside, margin)
        return out, {"left_azimuth_rad": 0.0, "top_elevation_rad": high, "rad_per_px": step}

    def cut_mosaic(self, width_px: int) -> tuple[Grey, dict[str, float]]:
        """Return the mosaic without the widest gap that no wedge fills, and its edges; a full circle would
        have `width_px`.
        """
        mosaic, edges = self.mosaic(width_px)
        seen = np.flatnonzero(mosaic.any(axis=0))
        if len(seen) == 0:
            seen = np.arange(mosaic.shape[1])
        gaps = np.diff(np.append(seen, seen[0] + mosaic.shape[1]))
        widest = int(gaps.argmax())
        first = int(seen[(widest + 1) % len(seen)])
        width = mosaic.shape[1] - int(gaps[widest]) + 1
        left = (edges["left_azimuth_rad"] + first * edges["rad_per_px"]) % math.tau
        return np.roll(mosaic, -first, axis=1)[:, :width], {**edges, "left_azimuth_rad": left}

    def save(self, folder: Path | str) -> Path:
        """Write the panorama to a folder and return it."""
        from PIL import Image

        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        entries = []
        for number, wedge in enumerate(self.wedges):
            entry: dict[str, Any] = {"name": wedge.name}
            for side, image, camera in (
                ("left", wedge.left, wedge.left_camera),
                ("right", wedge.right, wedge.right_camera),
            ):
                path = f"wedge{number:02d}_{side}.png"
                Image.fromarray(image).save(folder / path)
                entry[side] = {"image": path, "camera": camera_document(camera)}
            entries.append(entry)
        document = {"format": FORMAT, "name": self.name, "t_s": self.t_s, "frame": "site", "wedges": entries}
        (folder / "panorama.json").write_text(json.dumps(document, indent=1) + "\n")
        return folder


def wedge_pans(
    model: CameraModel, from_azimuth_rad: float, span_rad: float, overlap: float = 0.1
) -> list[float]:
    """Return pan angles of wedges side by side, clockwise from an azimuth (counter-clockwise from the front).

    `overlap` is the share of a frame's width that neighbours have in common at least.
    """
    middle = model.height / 2.0
    edges = model.back_project(np.array([[0.0, middle], [model.width - 1.0, middle]]))[1]
    field = math.acos(float(np.clip(edges[0] @ edges[1], -1, 1))) * (1.0 - overlap)
    count = max(1, math.ceil(span_rad / field))
    return [wrap_angle(from_azimuth_rad - span_rad * (k + 0.5) / count) for k in range(count)]


def load_panorama(folder: Path | str) -> Panorama:
    """Return a panorama from its folder.

    Raises
    ------
    CameraError
        If `panorama.json` or an image is missing or malformed.
    """
    from PIL import Image

    folder = Path(folder)
    try:
        document = json.loads((folder / "panorama.json").read_text())
        if document.get("format") != FORMAT:
            raise CameraError(f'{folder}: "format" is {document.get("format")!r}, not "{FORMAT}"')
        wedges = []
        for entry in document["wedges"]:
            images, cameras = [], []
            for side in ("left", "right"):
                with Image.open(folder / entry[side]["image"]) as opened:
                    images.append(np.asarray(opened.convert("L")))
                cameras.append(camera_from_document(entry[side]["camera"]))
            wedges.append(StereoWedge(entry["name"], images[0], images[1], cameras[0], cameras[1]))
        return Panorama(wedges, document.get("name", ""), float(document.get("t_s", 0.0)))
    except (OSError, ValueError, KeyError, TypeError) as err:
        raise CameraError(f"panorama {folder} cannot be read: {err}") from err


def camera_document(camera: CameraModel) -> dict[str, object]:
    """Return a camera model as JSON."""
    document: dict[str, object] = {"model": str(camera.kind), "width": camera.width, "height": camera.height}
    for letter in camera.kind:
        document[letter] = [float(v) for v in getattr(camera, letter)]
    if camera.kind is ModelKind.CAHVORE:
        document["linearity"] = camera.linearity
    return document


class CameraDocument(TypedDict):
    """A camera model as JSON; each letter of `model` is a member too, a vector."""

    model: str
    width: int
    height: int
    linearity: NotRequired[float]


def camera_from_document(document: CameraDocument) -> CameraModel:
    """Return a camera model from its JSON form."""
    vectors: Mapping[str, object] = document
    try:
        kind = ModelKind(document["model"])
        return CameraModel(
            kind,
            int(document["width"]),
            int(document["height"]),
            **{letter: np.array(vectors[letter], dtype=float) for letter in kind},
            linearity=float(document.get("linearity", 1.0)),
        )
    except (KeyError, TypeError, ValueError) as err:
        raise CameraError(f"camera model cannot be read: {type(err).__name__} {err}") from err


def _border(camera: CameraModel) -> Array:
    x, y = np.linspace(0, camera.width - 1, 9), np.linspace(0, camera.height - 1, 9)
    return np.array([(u, v) for u in x for v in y if u in (x[0], x[-1]) or v in (y[0], y[-1])])
