"""Rocks found in rendered stereo pairs against the renderer's truth.

`python -m studies.segmentation --worlds 6 --sensor navcam --out studies/results/segmentation.json`

A rock's overlap (intersection over union) is that of the pixels of the left image that show it with the
pixels of the mask that fits them best; pixels without stereo count like all others. Counted are rocks of at
least 15 cm whose median range from the camera is at most 4 m and that both images show whole. Beside it
stands the overlap of the bare cloud, over the pixels that have a point.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.linear import warp
from rover_iface.cameras.model import CameraModel
from rover_iface.cameras.stereo import Cloud, dense_stereo
from rover_iface.placement.cloud import DISPARITY_RAD, SurfaceCloud, cloud_of_stereo
from rover_iface.placement.ground_plane import GroundOptions
from rover_iface.placement.segmentation import Segmentation, SegmentationOptions, segment
from studies.common.placement_worlds import VIEWS_PER_WORLD, StereoView, views
from studies.common.rock_masks import MaskOptions, rock_masks

Array = npt.NDArray[np.float64]
Labels = npt.NDArray[np.int64]

LEAST_M, FARTHEST_M, FIELD_RAD = 0.15, 4.0, math.radians(50.0)
BORDER_PX = 2
BINS_M = ((0.0, 1.2), (1.2, 2.0), (2.0, 3.0), (3.0, 4.0))


@dataclass(frozen=True)
class SensorSettings:
    """How a pair is matched and segmented; set on worlds 900 and 901."""

    nearest_m: float
    scale: float
    disparity_rad: float
    block_px: int = 5
    least_contrast: float = 1.5
    segmentation: SegmentationOptions = field(default_factory=SegmentationOptions)
    masks: MaskOptions = field(default_factory=MaskOptions)


SETTINGS = {
    "hazcam": SensorSettings(0.35, 1.5, DISPARITY_RAD, block_px=7, least_contrast=2.5),
    "navcam": SensorSettings(
        1.3,
        1.0,
        0.0003,
        segmentation=SegmentationOptions(thinning=2, roughness_m=0.006, ground=GroundOptions(post_m=0.15)),
    ),
}


def cloud_of_view(view: StereoView) -> tuple[Cloud, SurfaceCloud]:
    """Return the dense stereo of a view and the cloud of it, rover frame."""
    chosen = SETTINGS[view.sensor]
    stereo = dense_stereo(
        *view.images,
        view.left_camera,
        view.right_camera,
        nearest_m=chosen.nearest_m,
        scale=chosen.scale,
        block_px=chosen.block_px,
        least_contrast=chosen.least_contrast,
    )
    return stereo, cloud_of_stereo(
        stereo, farthest_m=FARTHEST_M + 1.0, field_rad=FIELD_RAD, disparity_rad=chosen.disparity_rad
    )


def segmented(view: StereoView) -> tuple[Labels, Labels, Segmentation]:
    """Return for each pixel of the left image the rock by its mask (-1: none) and by the cloud alone (-2: no
    point), and the segmentation.
    """
    chosen = SETTINGS[view.sensor]
    stereo, cloud = cloud_of_view(view)
    found = segment(cloud, chosen.segmentation)
    image = warp(view.images[0], view.left_camera, stereo.camera, fill=0.0)
    masks = rock_masks(image, cloud, found, chosen.masks)
    bare = np.full(masks.shape, -2, np.int64)
    assert cloud.pixels is not None
    bare[cloud.pixels[:, 1], cloud.pixels[:, 0]] = found.labels
    return (
        _in_left(view, stereo.camera, masks, -1),
        _in_left(view, stereo.camera, bare, -2),
        found,
    )


def _in_left(view: StereoView, camera: CameraModel, labels: Labels, none: int) -> Labels:
    """Return labels of the aligned frame's pixels for those of the left image, the nearest pixel each."""
    lines, samples = np.indices(view.body.shape)
    pixels = np.stack((samples, lines), axis=-1).reshape(-1, 2).astype(float)
    eye, rays = view.left_camera.back_project(pixels)
    # a fisheye's rays do not start in one point: what matters lies at 2 m
    found = np.round(camera.project(eye + 2.0 * rays))
    with np.errstate(invalid="ignore"):
        inside = ((found >= 0) & (found < (labels.shape[1], labels.shape[0]))).all(axis=1)
    x, y = np.where(inside[:, None], found, 0).astype(np.int64).T
    return np.where(inside, labels[y, x], none).reshape(view.body.shape).astype(np.int64)


def rocks_of_view(view: StereoView) -> dict[str, Any]:
    """Return the rocks of a view with their overlap, how many segments are none, and the time it took."""
    began = time.process_time()
    masks, bare, found = segmented(view)
    spent = time.process_time() - began
    rows = []
    for number in np.unique(view.body[view.body >= 0]):
        seen = view.body == number
        far = float(np.median(view.range_m[seen]))
        if view.rocks[number][1] < LEAST_M or far > FARTHEST_M or not _whole(view, seen):
            continue
        known = bare >= -1
        rows.append(
            {
                "diameter_m": view.rocks[number][1],
                "range_m": far,
                "pixels": int(seen.sum()),
                "lit": float(view.lit[seen].mean()),
                "iou": _best(masks, seen),
                "cloud_iou": _best(np.where(known, bare, -1), seen & known),
            }
        )
    false = 0
    for rock in found.rocks:
        own = masks == rock.label
        if own.any() and max(rock.extent_m) >= LEAST_M:
            near = float(np.median(view.range_m[own])) < FARTHEST_M
            false += near and float((view.body[own] >= 0).mean()) < 0.3
    return {"rocks": rows, "false": int(false), "segments": len(found.rocks), "cpu_s": spent}


def _whole(view: StereoView, seen: npt.NDArray[np.bool_]) -> bool:
    """Return whether a rock lies within both frames and the field, and is more than a speck."""
    lines, samples = np.nonzero(seen)
    height, width = seen.shape
    if len(lines) < 20 or min(lines.min(), samples.min()) < BORDER_PX:
        return False
    if lines.max() >= height - BORDER_PX or samples.max() >= width - BORDER_PX:
        return False
    eyes, rays = view.left_camera.back_project(np.column_stack((samples, lines)).astype(float))
    right = view.right_camera.project(eyes + view.range_m[seen].astype(float)[:, None] * rays)
    size = np.array([view.right_camera.width, view.right_camera.height])
    if not ((right >= BORDER_PX) & (right < size - BORDER_PX)).all():
        return False
    aside = np.arctan2(np.abs(rays @ view.left_camera.horizontal), rays @ view.left_camera.A)
    return bool((aside < FIELD_RAD).all())


def _best(labels: Labels, seen: npt.NDArray[np.bool_]) -> float:
    """Return the overlap of pixels with the label that fits them best."""
    found = np.unique(labels[seen])
    shares = [float((seen & (labels == k)).sum() / (seen | (labels == k)).sum()) for k in found[found >= 0]]
    return max(shares, default=0.0)


def summary(found: list[dict[str, Any]]) -> dict[str, Any]:
    """Return overlap over all rocks and by range."""
    rows = [row for view in found for row in view["rocks"]]
    table = {"all": _overlap(rows)}
    for low, high in BINS_M:
        table[f"{low}-{high} m"] = _overlap([r for r in rows if low <= r["range_m"] < high])
    return {
        "views": len(found),
        "overlap": table,
        "false_segments": sum(view["false"] for view in found),
        "cpu_s_median": round(float(np.median([view["cpu_s"] for view in found])), 2),
    }


def _overlap(rows: list[dict[str, Any]]) -> dict[str, float]:
    if not rows:
        return {"rocks": 0}
    iou, pixels, cloud = (
        np.array([row[key] for row in rows], dtype=float) for key in ("iou", "pixels", "cloud_iou")
    )
    return {
        "rocks": len(rows),
        "mean": round(float(iou.mean()), 3),
        "median": round(float(np.median(iou)), 3),
        "weighted_by_pixels": round(float((iou * pixels).sum() / pixels.sum()), 3),
        "share_above_085": round(float((iou >= 0.85).mean()), 3),
        "found": round(float((iou >= 0.5).mean()), 3),
        "cloud_mean": round(float(cloud.mean()), 3),
    }


def main() -> None:
    """Run over the worlds and print the table after each."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--worlds", type=int, default=6, help=f"of {VIEWS_PER_WORLD} views each")
    parser.add_argument("--sensor", choices=sorted(SETTINGS), default="navcam")
    parser.add_argument("--first-seed", type=int, default=0, help="900 and 901 are for setting limits")
    parser.add_argument("--folder", type=Path, default=Path("/tmp/outcrop-placement"), help="of kept views")
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    found: list[dict[str, Any]] = []
    for seed in range(options.first_seed, options.first_seed + options.worlds):
        found += [rocks_of_view(view) for view in views(seed, options.folder, sensor=options.sensor)]
        result = {"sensor": options.sensor, **summary(found)}
        print(json.dumps(result), flush=True)
        if options.out is not None:
            options.out.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
