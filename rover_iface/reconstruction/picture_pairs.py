"""The stereo pairs of a folder: of labelled products by time and camera, or of plain pictures as described.

A folder of plain pictures holds `pairs.toml` of form `image-pairs/1`; `docs/how-to/real-pictures.md` says
what stands in it. Otherwise every product of the folder is read, and each left eye is given the right eye of
the same instrument that was taken nearest to it in time, from the same place.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rover_iface.cameras.model import Array, CameraModel
from rover_iface.frames import Transform
from rover_iface.reconstruction.frames_of_labels import EyeFrame, frame_of_product, grey_of
from rover_iface.reconstruction.outcomes import Reason, Refusal, RefusedError

PointErrors = Callable[[Array], Array]
"""Gives covariances (n, 3, 3), m^2, of points (n, 3), m, site frame: what a calibration alone lets them
err."""

APART_S = 120.0
"""Longest time between the two pictures of a pair. Shadows turn by half a degree in it, which moves the end
of a 3 m shadow by 3 cm."""

PRODUCTS = (".img", ".lbl", ".vic", ".json")
"""Endings of labelled products, each also with `.gz`."""

MOST_LOST = 0.9
"""Share of a picture that may be missing; what is left of it has to show ground with its neighbourhood."""

LEAST_BLOCK_PX = 64
"""Fewest joined pixels of the lost value that count as lost: a single dark pixel is one of a shadow."""


@dataclass(frozen=True, slots=True, eq=False)
class PicturePair:
    """Two pictures of one moment, their cameras in the site frame.

    Attributes
    ----------
    left, right
        (height, width) brightness, 0 to 1, stretched alike; 0 exactly where pixels are lost.
    colour
        (height, width, 3) of 8 bits, of the left eye, if it has colour.
    lost
        Share of pixels that are lost, left and right.
    site_from_rover
        Pose of the rover that took it.
    errors
        What the calibration of the two cameras may be off, where that is known.
    """

    name: str
    left: Array
    right: Array
    left_camera: CameraModel
    right_camera: CameraModel
    site_from_rover: Transform
    place: tuple[int, int] = (0, 0)
    colour: np.ndarray[tuple[int, int, int], np.dtype[np.uint8]] | None = None
    lost: tuple[float, float] = (0.0, 0.0)
    errors: PointErrors | None = None


def labelled_pairs(folder: Path, refused: list[Refusal]) -> list[PicturePair]:
    """Return the pairs among the labelled products of a folder; what is not used is added to `refused`."""
    frames: list[EyeFrame] = []
    for path in _products(folder):
        try:
            frames.append(frame_of_product(path))
        except RefusedError as err:
            refused.append(err.refusal)
    frames = _of_one_site(_newest_versions(frames), refused)
    pairs = []
    for left, right in _partners(frames, refused):
        try:
            pairs.append(
                pair_of(
                    left.name,
                    (left.samples, right.samples),
                    (left.camera, right.camera),
                    left.site_from_rover,
                    place=left.place,
                    lost_values=(left.lost_value, right.lost_value),
                )
            )
        except RefusedError as err:
            refused.append(err.refusal)
    return pairs


def _products(folder: Path) -> list[Path]:
    """Return the products of a folder, one file each: a label stands for its image."""
    found = sorted(
        p for p in folder.iterdir() if p.is_file() and p.name.lower().removesuffix(".gz").endswith(PRODUCTS)
    )
    labels = {_stem(p) for p in found if p.name.lower().removesuffix(".gz").endswith(".lbl")}
    return [
        p for p in found if not (p.name.lower().removesuffix(".gz").endswith(".img") and _stem(p) in labels)
    ]


def _stem(path: Path) -> str:
    return path.name.lower().removesuffix(".gz").rpartition(".")[0]


def _newest_versions(frames: Sequence[EyeFrame]) -> list[EyeFrame]:
    """Return each picture once: one exposure may lie in the folder raw, corrected and linearised.

    A linearised product is the better known one (the archive's own), then the last by name.
    """
    chosen: dict[object, EyeFrame] = {}
    for frame in sorted(frames, key=lambda f: (f.camera.kind == "CAHV", f.name)):
        key = (frame.instrument, frame.eye, frame.taken, frame.place) if frame.taken else frame.name
        chosen[key] = frame
    return sorted(chosen.values(), key=lambda f: f.name)


def _of_one_site(frames: Sequence[EyeFrame], refused: list[Refusal]) -> list[EyeFrame]:
    """Return the frames of the site that most are of: labels do not tie one site's frame to another's."""
    sites = [f.place[0] for f in frames]
    if not sites:
        return []
    most = max(sorted(set(sites)), key=sites.count)
    refused += [
        Refusal(Reason.OTHER_SITE, f.name, f"it is of site {f.place[0]}, most of the folder of site {most}")
        for f in frames
        if f.place[0] != most
    ]
    return [f for f in frames if f.place[0] == most]


def _partners(frames: Sequence[EyeFrame], refused: list[Refusal]) -> list[tuple[EyeFrame, EyeFrame]]:
    """Return left and right frames that belong together; a frame belongs to one pair at most."""
    free = [f for f in frames if f.eye == "right"]
    pairs = []
    for left in (f for f in frames if f.eye == "left"):
        fit = sorted((r for r in free if _belong(left, r)), key=lambda r: (_seconds(left, r), r.name))
        if not fit:
            refused.append(Refusal(Reason.NO_PARTNER, left.name, _why_alone(left, free, "right")))
            continue
        free.remove(fit[0])
        pairs.append((left, fit[0]))
    lefts = [f for f in frames if f.eye == "left"]
    refused += [Refusal(Reason.NO_PARTNER, f.name, _why_alone(f, lefts, "left")) for f in free]
    return pairs


def _seconds(one: EyeFrame, two: EyeFrame) -> float:
    if one.taken is None or two.taken is None:
        return math.inf
    return abs((one.taken - two.taken).total_seconds())


def _belong(left: EyeFrame, right: EyeFrame) -> bool:
    return (
        left.instrument == right.instrument
        and left.place == right.place
        and _seconds(left, right) <= APART_S
        and bool(float(left.camera.A @ right.camera.A) > math.cos(_half_width(left.camera)))
    )


def _half_width(camera: CameraModel) -> float:
    """Return half of a camera's field along its rows, rad."""
    ends = camera.back_project([[0.0, camera.height / 2], [camera.width - 1.0, camera.height / 2]])[1]
    return math.acos(max(-1.0, min(1.0, float(ends[0] @ ends[1])))) / 2


def _why_alone(frame: EyeFrame, others: Sequence[EyeFrame], side: str) -> str:
    same = [o for o in others if o.instrument == frame.instrument]
    if not same:
        return f"no {side} picture of {frame.instrument} in the folder"
    there = [o for o in same if o.place == frame.place]
    if not there:
        return f"no {side} picture of {frame.instrument} from the same place (site, drive) {frame.place}"
    nearest = min(there, key=lambda o: _seconds(frame, o))
    seconds = _seconds(frame, nearest)
    if not math.isfinite(seconds):
        return f"the label of it or of {nearest.name} does not tell when it was taken"
    if seconds > APART_S:
        return (
            f"the nearest in time, {nearest.name}, was taken {seconds:.0f} s apart; the limit is {APART_S:g}"
        )
    return f"{nearest.name}, {seconds:.0f} s apart, looks elsewhere or belongs to another picture"


def pair_of(
    name: str,
    samples: tuple[np.ndarray[tuple[int, ...], np.dtype[np.generic]], ...],
    cameras: tuple[CameraModel, CameraModel],
    site_from_rover: Transform,
    *,
    place: tuple[int, int] = (0, 0),
    lost_values: tuple[float, float] = (0.0, 0.0),
    errors: PointErrors | None = None,
) -> PicturePair:
    """Return a pair from samples (height, width) or (height, width, 3) and cameras in the site frame.

    Raises
    ------
    RefusedError
        If the pictures differ in size, or hardly anything of one arrived.
    """
    sizes = [s.shape[1::-1] for s in samples]
    if sizes[0] != sizes[1]:
        raise RefusedError(
            Reason.SIZE_DIFFERS, name, f"the left picture has {sizes[0]} pixels, the right one {sizes[1]}"
        )
    grey = [grey_of(s) for s in samples]
    lost = [_lost(g, value) for g, value in zip(grey, lost_values, strict=True)]
    shares = [float(mask.mean()) for mask in lost]
    for side, share in zip(("left", "right"), shares, strict=True):
        if share > MOST_LOST:
            raise RefusedError(
                Reason.PICTURE_LOST,
                name,
                f"{100 * share:.0f} % of its {side} picture never arrived; the limit is {100 * MOST_LOST:g}",
            )
    there = np.concatenate([g[~mask] for g, mask in zip(grey, lost, strict=True)])
    # hot pixels and the sky do not set the contrast
    low, high = np.percentile(there, (0.5, 99.5))
    if not high > low:
        raise RefusedError(Reason.PICTURE_LOST, name, f"every pixel of it has the value {low:g}")
    # 0 is kept for what is lost: dense stereo takes it for outside the frame
    stretched = [
        np.where(mask, 0.0, np.clip((g - low) / (high - low), 2.0 / 255.0, 1.0))
        for g, mask in zip(grey, lost, strict=True)
    ]
    colour = None
    if samples[0].ndim == 3:
        tint = np.clip((np.asarray(samples[0], dtype=np.float64)[..., :3] - low) / (high - low), 0.0, 1.0)
        colour = np.round(255.0 * tint).astype(np.uint8)
    return PicturePair(
        name,
        stretched[0],
        stretched[1],
        cameras[0],
        cameras[1],
        site_from_rover,
        place,
        colour,
        (shares[0], shares[1]),
        errors,
    )


def _lost(grey: Array, value: float) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """Return which pixels (height, width) never arrived: joined blocks of the value that stands for them."""
    from scipy import ndimage

    labels, count = ndimage.label(grey == value)
    if count == 0:
        return np.zeros(grey.shape, dtype=bool)
    sizes = np.bincount(labels.ravel())
    sizes[0] = 0
    return np.asarray((sizes >= LEAST_BLOCK_PX)[labels])
