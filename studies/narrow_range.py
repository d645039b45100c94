"""A far target by the pancams: how well they range it, and how well their picture finds it again near by.

    .venv/bin/python -m studies.narrow_range --out docs

The approaches are those of `studies.perception`. At the first stop, ten metres off, the pancam pair is
taken too, with a mast noise of its own. Table 1: range of the designated pixels by the navcams' point stereo
and by `narrow_sight`. Table 2: the first picture, the pancams' or the navcams', laid by the cascade over what
the navcams range at stops of 3.4 m and less, from a start that is off as a track may be.
"""

from __future__ import annotations

import argparse
import json
import math
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from rover_iface.cameras.model import CameraModel
from rover_iface.cameras.stereo import point_stereo
from rover_iface.frames import Transform
from rover_iface.simulator.render.picture import AutoExposure, Frame
from rover_iface.vision.handoff import Handoff, Side
from rover_iface.vision.handoff_cascade import cascade
from rover_iface.vision.narrow_range import narrow_sight
from rover_iface.vision.shape_tracker import RECALL_M
from rover_iface.vision.tracker import StereoView
from studies.common.pages import write_section
from studies.common.perception_worlds import TRAINING, Halt, approach, rock_scene
from studies.common.tracking_worlds import Array
from studies.perception import axes, say

HALF = 230
TARGETS = 4
"""Targets of a world that are looked for again; all are ranged."""
MAST_RAD, ASTRAY_M = math.radians(0.07), 0.02


def pancams(seed: int, halt: Halt, look: Array) -> StereoView:
    """Return the pancam pair of a halt, pointed at a believed point (3,), cameras as believed."""
    renderer, _, _, rig, _ = rock_scene(seed)
    rng = np.random.default_rng([seed, 0x9A7])
    pan, tilt = rig.point_at(halt.told.inverse().apply(look), "pancam_left")
    noise = rng.normal(0.0, MAST_RAD, 2)
    frames: list[Frame] = []
    cameras: list[CameraModel] = []
    exposure = AutoExposure()
    for name in ("pancam_left", "pancam_right"):
        told = rig.camera(name, pan, tilt).transformed(halt.told)
        left, top = (round(float(v)) - HALF for v in told.project(look))
        window = (max(0, left), max(0, top), 2 * HALF + 1, 2 * HALF + 1)
        frames.append(
            renderer.render(
                rig.camera(name, pan + noise[0], tilt + noise[1]),
                halt.pose,
                halt.sun,
                window=window,
                sensor=rig.mounted(name).sensor,
                exposure=frames[0].exposure if frames else exposure,
                seed=int(rng.integers(1 << 30)),
            )
        )
        cameras.append(told.window(*window))
    return StereoView(frames[0].unit, frames[1].unit, cameras[0], cameras[1])


def study(worlds: list[int], folder: Path) -> dict[str, Any]:
    """Return range errors and places found again, metres."""
    ranged: list[dict[str, float | None]] = []
    found: list[dict[str, Any]] = []
    for seed in worlds:
        sequence = approach(seed, folder)
        first, points = sequence.halts[0], [point for _, point in sequence.targets]
        wide = first.view()
        narrow = pancams(seed, first, _believed(first, np.mean(points, axis=0)))
        picked = set(np.linspace(0, len(points) - 1, TARGETS).round().astype(int).tolist())
        for number, point in enumerate(points):
            pixel = np.asarray(first.left.true.project(point))
            true = float(np.linalg.norm(point - first.left.true.C))
            # the map that the target was picked on has its place to a decimetre or two
            sight = narrow_sight(wide, pixel, narrow, true + 0.15)
            match = point_stereo(wide.left, wide.right, wide.left_camera, wide.right_camera, pixel)
            ranged.append(
                {
                    "navcam": None if match is None else _range(match.point, wide) - true,
                    "pancam": None if sight is None else sight.known.range_m - true,
                    "sigma": None if sight is None else sight.known.sigma_m,
                }
            )
            if sight is None or number not in picked:
                continue
            for kind, side, at in (
                ("pancam", Side(narrow, 0.6), sight.pixel),
                ("navcam", Side(wide, 0.6), pixel),
            ):
                found += [{"kind": kind, **r} for r in _again(sequence.halts, first, point, side, at)]
        say(f"  narrow, world {seed}")
    return {"worlds": worlds, "ranged": ranged, "found": found}


def _again(halts: list[Halt], first: Halt, point: Array, side: Side, pixel: Array) -> list[dict[str, Any]]:
    """Return what the cascade makes of a first picture at two near stops."""
    near = [h for h in halts if np.linalg.norm(point - h.left.true.C) < RECALL_M]
    rows: list[dict[str, Any]] = []
    for halt in (near[0], near[len(near) // 2]):
        rng = np.random.default_rng([len(rows), round(1e6 * abs(float(point[0])))])
        start = _believed(halt, point) + rng.normal(0.0, ASTRAY_M, 3)
        guess = Transform(np.eye(3), start - _believed(first, point))
        answer = cascade(Handoff(Side(halt.view(), 0.6), side.moved(guess), pixel), "near")
        off = float(np.linalg.norm(answer.position - _believed(halt, point))) if answer.accepted else None
        rows.append({"range_m": float(np.linalg.norm(point - halt.left.true.C)), "error_m": off})
    return rows


def _believed(halt: Halt, point: Array) -> Array:
    """Return where a true point (3,) lies in the believed frame, as the left camera stands in both."""
    told, true = halt.left.told, halt.left.true
    return np.asarray(axes(told).T @ (axes(true) @ (point - true.C)) + told.C)


def _range(point: Array, view: StereoView) -> float:
    return float(np.linalg.norm(point - view.left_camera.C))


def table(result: dict[str, Any]) -> str:
    """Return both tables as Markdown."""
    lines = [
        f"{len(result['ranged'])} targets in {len(result['worlds'])} worlds, 10 m off.",
        "",
        "| range by | told, % | error cm, median / 95 % / worst | within 2 sigma, % |",
        "| --- | --- | --- | --- |",
    ]
    for kind in ("navcam", "pancam"):
        rows = [r for r in result["ranged"] if r[kind] is not None]
        sure = [abs(r[kind]) < 2 * r["sigma"] for r in rows] if kind == "pancam" else []
        share = 100 * len(rows) / len(result["ranged"])
        inside = f"{100 * np.mean(sure):.0f}" if sure else "-"
        lines.append(f"| {kind}s | {share:.0f} | {_three([abs(r[kind]) for r in rows])} | {inside} |")
    lines += [
        "",
        "| first picture | found again from | tries | accepted, % | error cm, median / 95 % / worst |",
        "| --- | --- | --- | --- | --- |",
    ]
    for kind in ("pancam", "navcam"):
        for low, high in ((2.4, RECALL_M), (1.0, 2.4)):
            rows = [r for r in result["found"] if r["kind"] == kind and low <= r["range_m"] < high]
            good = [r["error_m"] for r in rows if r["error_m"] is not None]
            share = 100 * len(good) / max(1, len(rows))
            told = _three(good) if good else "-"
            lines.append(f"| {kind} at 10 m | {low:g} to {high:g} m | {len(rows)} | {share:.0f} | {told} |")
    return "\n".join(lines)


def _three(values: list[float]) -> str:
    v = 100 * np.array(values)
    return f"{np.median(v):.2f} / {np.percentile(v, 95):.2f} / {v.max():.2f}"


def main() -> None:
    """Run the study and print its tables; `--out` puts them into docs/results/tracking.md."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--worlds", type=int, default=12)
    parser.add_argument("--pictures", type=Path, default=Path(tempfile.gettempdir()) / "outcrop_perception")
    parser.add_argument("--results", type=Path, default=Path("studies/results/narrow_range.json"))
    parser.add_argument("--out", type=Path, help="docs folder whose page of tracking results gets the tables")
    arguments = parser.parse_args()
    started = time.process_time()
    result = study(list(range(TRAINING, arguments.worlds)), arguments.pictures)
    say(f"{time.process_time() - started:.0f} CPU s")
    arguments.results.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    text = table(result)
    print(text)
    if arguments.out is not None:
        write_section(arguments.out, "tracking", "narrow", text)


if __name__ == "__main__":
    main()
