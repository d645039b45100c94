"""Rocks found in rendered hazcam clouds against the renderer's truth.

`python -m benchmarks.segmentation --worlds 12 --out benchmarks/results/segmentation.json`

A view's cloud is dense stereo of the whole hazcam pair. Counted are rocks of at least 15 cm whose visible
face lies within 4 m and within the field that the cloud keeps; a rock's overlap is that of its points with
the segment that fits it best. Points are judged by the body that the ray of their pixel meets, so what
stereo draws over an edge counts as an error.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from benchmarks.placement_worlds import VIEWS_PER_WORLD, StereoView, views
from rover_iface.cameras.stereo import dense_stereo
from rover_iface.placement.cloud import SurfaceCloud, cloud_of_stereo
from rover_iface.placement.segmentation import SegmentationOptions, segment

Array = npt.NDArray[np.float64]

SCALE, NEAREST_M, FARTHEST_M, FIELD_RAD = 1.5, 0.35, 5.0, math.radians(50.0)
BINS_M = ((0.0, 1.2), (1.2, 2.0), (2.0, 3.0), (3.0, 4.0))


def cloud_of_view(view: StereoView) -> SurfaceCloud:
    """Return the cloud of a view, rover frame."""
    stereo = dense_stereo(*view.images, view.left_camera, view.right_camera, nearest_m=NEAREST_M, scale=SCALE)
    return cloud_of_stereo(stereo, farthest_m=FARTHEST_M, field_rad=FIELD_RAD)


def bodies_of_points(view: StereoView, cloud: SurfaceCloud) -> npt.NDArray[np.int64]:
    """Return (n,) the rock that the ray of each point meets, -1 for none."""
    pixels = np.round(view.left_camera.project(cloud.points))
    with np.errstate(invalid="ignore"):
        size = np.array([view.left_camera.width, view.left_camera.height])
        inside = np.asarray(((pixels >= 0) & (pixels < size)).all(axis=1))
    x, y = np.where(inside[:, None], pixels, 0).astype(np.int64).T
    return np.where(inside, view.body[y, x], -1).astype(np.int64)


def rocks_of_view(
    view: StereoView,
    *,
    least_m: float = 0.15,
    farthest_m: float = 4.0,
    options: SegmentationOptions | None = None,
) -> dict[str, Any]:
    """Return the rocks of a view with their overlap, how many segments are none, and the time it took."""
    cloud = cloud_of_view(view)
    body = bodies_of_points(view, cloud)
    began = time.process_time()
    found = segment(cloud, options)
    spent = time.process_time() - began
    rows = []
    for number in np.unique(body[body >= 0]):
        own, seen = body == number, view.body == number
        far = float(np.median(view.range_m[seen]))
        rays = view.left_camera.back_project(np.argwhere(seen)[:, ::-1].astype(float))[1]
        axis, row = view.left_camera.A, view.left_camera.horizontal
        within = np.arctan2(np.abs(rays @ row), rays @ axis) < FIELD_RAD
        if view.rocks[number][1] < least_m or far > farthest_m or within.mean() < 0.9 or own.sum() < 20:
            continue
        labels = np.unique(found.labels[own])
        shares = [
            float((own & (found.labels == k)).sum() / (own | (found.labels == k)).sum())
            for k in labels[labels >= 0]
        ]
        rows.append(
            {
                "diameter_m": view.rocks[number][1],
                "range_m": far,
                "points": int(own.sum()),
                "iou": max(shares, default=0.0),
            }
        )
    assert cloud.eye is not None
    false = 0
    for rock in found.rocks:
        own = found.labels == rock.label
        near = float(np.linalg.norm(rock.centroid - cloud.eye)) < farthest_m
        false += near and max(rock.extent_m) >= least_m and float((body[own] >= 0).mean()) < 0.3
    return {"rocks": rows, "false": int(false), "segments": len(found.rocks), "segment_s": spent}


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
        "segment_cpu_s_median": float(np.median([view["segment_s"] for view in found])),
    }


def _overlap(rows: list[dict[str, Any]]) -> dict[str, float]:
    if not rows:
        return {"rocks": 0}
    iou, points = (np.array([row[key] for row in rows], dtype=float) for key in ("iou", "points"))
    return {
        "rocks": len(rows),
        "mean": round(float(iou.mean()), 3),
        "median": round(float(np.median(iou)), 3),
        "weighted_by_points": round(float((iou * points).sum() / points.sum()), 3),
        "share_above_085": round(float((iou >= 0.85).mean()), 3),
        "found": round(float((iou >= 0.5).mean()), 3),
    }


def main() -> None:
    """Run over the worlds and print the table after each."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--worlds", type=int, default=12, help=f"of {VIEWS_PER_WORLD} views each")
    parser.add_argument("--first-seed", type=int, default=0, help="900 and 901 are for setting limits")
    parser.add_argument("--folder", type=Path, default=Path("/tmp/outcrop-placement"), help="of kept views")
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    found: list[dict[str, Any]] = []
    for seed in range(options.first_seed, options.first_seed + options.worlds):
        found += [rocks_of_view(view) for view in views(seed, options.folder)]
        result = summary(found)
        print(json.dumps(result), flush=True)
        if options.out is not None:
            options.out.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
