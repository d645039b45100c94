"""Feature tracker, shape tracker and what people use today, side by side on the same rendered approaches.

    python -m studies.perception --out docs                    # all studies, about 25 min of one core
    python -m studies.perception --only approach --worlds 12

Pictures are rendered once into a folder (`--pictures`, by default in the temporary folder). Figures are kept
in studies/results/perception.json, tables go into docs/results/tracking.md.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.model import CameraModel
from rover_iface.errors import TrackerError
from rover_iface.vision.sift import SiftOptions, SiftTracker
from rover_iface.vision.sift_features import Features
from rover_iface.vision.tracker import StereoView
from studies.common.perception_faults import KINDS, disturbed
from studies.common.perception_report import write_report
from studies.common.perception_shape import registration_study
from studies.common.perception_worlds import TRAINING, Halt, Sequence, approach
from studies.common.tracking_worlds import Array

Say = Callable[[str], None]
STARTS = {"10 m": 10.0, "7.5 m": 7.5, "5 m": 5.0}


class Remembering(SiftTracker):
    """A tracker that shares the features of each view with others of a study."""

    def __init__(self, options: SiftOptions, memory: dict[int, Features]) -> None:
        super().__init__(options)
        self.memory = memory

    def find(self, view: StereoView) -> Features:
        """Return the features of a view, found once a study."""
        if id(view) not in self.memory:
            self.memory[id(view)] = super().find(view)
        return self.memory[id(view)]


def axes(camera: CameraModel) -> Array:
    """Return rows, columns and axis of a camera as the rows of a rotation."""
    return np.stack((camera.horizontal, np.cross(camera.A, camera.horizontal), camera.A))


def follow(
    halts: list[Halt],
    views: list[StereoView],
    points: list[Array],
    options: SiftOptions,
    memory: dict[int, Features],
) -> list[dict[str, Any]]:
    """Return a row for every update of every target: errors relative to the cameras, as they really stood."""
    tracker = Remembering(options, memory)
    live = []
    for number, point in enumerate(points):
        try:
            tracker.start(str(number), None, views[0], pixel=halts[0].left.true.project(point))
            live.append(number)
        except TrackerError:
            continue
    rows = []
    for stop, (halt, view) in enumerate(zip(halts[1:], views[1:], strict=True), start=1):
        for number in live:
            update = tracker.update(str(number), view)
            told, true = axes(view.left_camera), axes(halt.left.true)
            ray = true @ (points[number] - halt.left.true.C)
            off = told @ (update.position - view.left_camera.C) - ray
            covariance = told @ update.covariance @ told.T
            distance = float(np.linalg.norm(ray))
            ray = ray / distance
            rows.append(
                {
                    "target": number,
                    "stop": stop,
                    "range_m": distance,
                    "state": str(update.state),
                    "error_m": float(np.linalg.norm(off)),
                    "aside_m": float(np.linalg.norm(off - ray * (ray @ off))),
                    "nees": float(off @ np.linalg.solve(covariance, off)),
                    "confidence": update.confidence,
                    "inliers": update.scores["inliers"],
                    "end": halt is halts[-1],
                }
            )
    return rows


def begin_at(sequence: Sequence, range_m: float) -> int:
    """Return the stop nearest to a range from the rock."""
    ranges = [float(np.hypot(*h.left.true.C[:2])) for h in sequence.halts]
    return int(np.argmin(np.abs(np.array(ranges) - range_m)))


def approach_study(worlds: list[int], folder: Path, say: Say) -> dict[str, Any]:
    """Return end errors and covariance of both methods, end errors of OpenCV's tools, from three ranges."""
    kinds = {"shipped": SiftOptions(), "published": SiftOptions(method="published", sigma_px=0.5)}
    rows: dict[str, dict[str, list[dict[str, Any]]]] = {k: {s: [] for s in STARTS} for k in kinds}
    others: dict[str, dict[str, list[float]]] = {k: {s: [] for s in STARTS} for k in PEERS}
    for seed in worlds:
        sequence = approach(seed, folder)
        views = [h.view() for h in sequence.halts]
        memory: dict[int, Features] = {}
        points = [point for _, point in sequence.targets]
        for name, range_m in STARTS.items():
            first = begin_at(sequence, range_m)
            halts, seen = sequence.halts[first:], views[first:]
            for kind, options in kinds.items():
                rows[kind][name] += follow(halts, seen, points, options, memory)
            for peer, match in PEERS.items():
                others[peer][name] += [follow_pixel(halts, seen, p, match) for p in points]
        say(f"  approach, world {seed}")
    table: dict[str, Any] = {}
    for kind, by in rows.items():
        every = [r for rs in by.values() for r in rs]
        inside = [r["nees"] < 7.815 for r in every if r["state"] == "tracked"]
        table[kind] = {
            "ends": {name: _centimetres([r["error_m"] for r in rs if r["end"]]) for name, rs in by.items()},
            "aside": {name: _centimetres([r["aside_m"] for r in rs if r["end"]]) for name, rs in by.items()},
            "updates": len(every),
            "covered_percent": 100.0 * float(np.mean(inside)),
            "false_alarms_percent": 100.0
            * float(np.mean([r["state"] != "tracked" and r["aside_m"] < 0.05 for r in every])),
            "by_range": [
                {
                    "range_m": [low, high],
                    "updates": len(part),
                    "covered_percent": 100.0 * float(np.mean([r["nees"] < 7.815 for r in part])),
                    "median_cm": 100.0 * float(np.median([r["error_m"] for r in part])),
                }
                for low, high in ((1.0, 2.0), (2.0, 3.0), (3.0, 5.0), (5.0, 10.0))
                if (part := [r for r in every if low <= r["range_m"] < high])
            ],
        }
    for peer, ends in others.items():
        table[peer] = {"aside": {name: _centimetres(values) for name, values in ends.items()}}
    return {"worlds": worlds, "table": table}


def _centimetres(values: list[float]) -> dict[str, float]:
    array = 100.0 * np.array(values)
    return {
        "runs": len(array),
        "median": float(np.median(array)),
        "p95": float(np.percentile(array, 95)),
        "max": float(array.max()),
        "within_5_percent": 100.0 * float(np.mean(array < 5.0)),
    }


Match = Callable[[npt.NDArray[np.float32], Array, npt.NDArray[np.float32], Array], Array]


def match_template(
    old: npt.NDArray[np.float32], at: Array, new: npt.NDArray[np.float32], guess: Array
) -> Array:
    """Return where matchTemplate finds the 21 x 21 patch of the last stop, +-61 px round the guess."""
    import cv2

    patch = cv2.getRectSubPix(old, (21, 21), (float(at[0]), float(at[1])))
    x, y = (round(float(v)) for v in guess)
    left, top = max(0, x - 71), max(0, y - 71)
    region = new[top : y + 72, left : x + 72]
    if region.shape[0] < 21 or region.shape[1] < 21:
        return guess
    place = cv2.minMaxLoc(cv2.matchTemplate(region, patch, cv2.TM_CCOEFF_NORMED))[3]
    return np.array([left + place[0] + 10.0, top + place[1] + 10.0])


def match_ecc(old: npt.NDArray[np.float32], at: Array, new: npt.NDArray[np.float32], guess: Array) -> Array:
    """Return where OpenCV's findTransformECC (affine, 41 x 41) puts the patch of the last stop."""
    import cv2

    patch = cv2.getRectSubPix(old, (41, 41), (float(at[0]), float(at[1])))
    warp = np.array([[1.0, 0.0, guess[0] - 20.0], [0.0, 1.0, guess[1] - 20.0]], dtype=np.float32)
    stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 60, 1e-4)
    try:
        _, warp = cv2.findTransformECC(patch, new, warp, cv2.MOTION_AFFINE, stop, None, 5)
    except cv2.error:
        return guess
    return np.asarray(warp @ np.array([20.0, 20.0, 1.0]), dtype=np.float64)


PEERS: dict[str, Match] = {"OpenCV matchTemplate": match_template, "OpenCV ECC": match_ecc}


def follow_pixel(halts: list[Halt], views: list[StereoView], point: Array, match: Match) -> float:
    """Return the end error across the line of sight of a tracker of pixels, metres.

    It is given what the others have: prediction through the camera models, with the range (here the true one)
    at which it believes the target.
    """
    pixel = np.asarray(halts[0].left.true.project(point))
    for n in range(1, len(halts)):
        before, now = views[n - 1], views[n]
        origin, ray = before.left_camera.back_project(pixel)
        distance = float(np.linalg.norm(point - halts[n - 1].left.true.C))
        guess = np.asarray(now.left_camera.project(origin + distance * ray))
        if not np.isfinite(guess).all():
            return 1.0
        pixel = match(before.left, pixel, now.left, guess)
    origin, ray = halts[-1].left.true.back_project(pixel)
    away = point - origin
    return float(np.linalg.norm(away - ray * (ray @ away)))


def fault_study(
    worlds: list[int], folder: Path, say: Say, keep: Callable[[dict[str, Any]], None]
) -> dict[str, Any]:
    """Return how the shipped tracker comes through what goes wrong, and what its confidence tells.

    `keep` gets what is known after each world.
    """
    found: dict[str, Any] = {}
    rows: list[dict[str, Any]] = []
    runs: dict[str, list[dict[str, Any]]] = {kind: [] for kind in KINDS}
    options = replace(SiftOptions(), lost_updates=5)
    for seed in worlds:
        sequence = approach(seed, folder)
        clean = _clean_features(sequence, options)
        points = [point for _, point in sequence.targets][::2]
        for kind in KINDS:
            halts, hit = disturbed(sequence, kind, points[len(points) // 2], 1)
            first = max(0, hit.start - 3)
            views = [h.view() for h in halts[first:]]
            memory = {
                id(view): clean[n].moved(halts[n].told * sequence.halts[n].told.inverse())
                for n, view in enumerate(views, start=first)
                if n not in hit
            }
            updates = follow(halts[first:], views, points, options, memory)
            for row in updates:
                row |= {"kind": kind, "hit": row["stop"] + first in hit}
            rows += updates
            for number in {r["target"] for r in updates}:
                runs[kind].append(_run([r for r in updates if r["target"] == number]))
        say(f"  faults, world {seed}")
        found = _faults(worlds[: worlds.index(seed) + 1], rows, runs)
        keep(found)
    return found


def _clean_features(sequence: Sequence, options: SiftOptions) -> list[Features]:
    """Return the features of every stop with nothing wrong: most stops of a disturbed approach are these.

    A slip moves the cameras of a pair together, and their features with them.
    """
    tracker = SiftTracker(options)
    return [tracker.find(halt.view()) for halt in sequence.halts]


def _faults(
    worlds: list[int], rows: list[dict[str, Any]], runs: dict[str, list[dict[str, Any]]]
) -> dict[str, Any]:
    """Return what rows of updates and their runs come to."""
    wrong = np.array([r["aside_m"] > 0.05 for r in rows])
    confidence = np.array([r["confidence"] for r in rows])
    clean = [r for r in rows if not r["hit"] and r["aside_m"] < 0.05]
    return {
        "worlds": worlds,
        "updates": len(rows),
        "wrong": int(wrong.sum()),
        "auc": _auc(confidence[wrong], confidence[~wrong]),
        "told_percent": 100.0
        * float(np.mean([r["state"] != "tracked" for r in rows if r["aside_m"] > 0.05] or [True])),
        "late_alarms": sum(r["alarm"] > 2 for rs in runs.values() for r in rs),
        "false_alarms_percent": 100.0 * float(np.mean([r["state"] != "tracked" for r in clean])),
        "kinds": {
            kind: {
                "runs": len(rs),
                "lost": sum(r["lost"] for r in rs),
                "recovered": sum(r["lost"] and r["state"] == "tracked" for r in rs),
                "failed": sum(r["state"] == "failed" for r in rs),
                "ends": _centimetres([r["error_m"] for r in rs]),
            }
            for kind, rs in runs.items()
        },
    }


def _run(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return what became of one target: end error, state, updates between a large error and the alarm."""
    alarm, waited = 0, 0
    for row in rows:
        waited = waited + 1 if row["aside_m"] > 0.05 and row["state"] == "tracked" else 0
        alarm = max(alarm, waited)
    lost = any(r["state"] != "tracked" for r in rows)
    return {"alarm": alarm, "lost": lost, "error_m": rows[-1]["error_m"], "state": rows[-1]["state"]}


def _auc(wrong: Array, right: Array) -> float | None:
    """Return the chance that a wrong answer has less confidence than a right one; ties count half."""
    if not len(wrong) or not len(right):
        return None
    less = np.searchsorted(np.sort(right), wrong, side="right")
    equal = less - np.searchsorted(np.sort(right), wrong, side="left")
    return float(np.mean((len(right) - less + 0.5 * equal) / len(right)))


STUDIES = ("approach", "faults", "registration")


def say(line: str) -> None:
    """Print progress at once."""
    print(line, flush=True)


def main() -> None:
    """Run the studies that were asked for and write tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", choices=STUDIES, action="append")
    parser.add_argument("--worlds", type=int, default=12)
    parser.add_argument("--pictures", type=Path, default=Path(tempfile.gettempdir()) / "outcrop_perception")
    parser.add_argument("--results", type=Path, default=Path("studies/results/perception.json"))
    parser.add_argument("--out", type=Path, help="docs folder whose tracking page gets the tables")
    arguments = parser.parse_args()
    worlds = list(range(TRAINING, arguments.worlds))

    def keep(name: str, found: dict[str, Any]) -> None:
        # another study may have written meanwhile
        results = json.loads(arguments.results.read_text()) if arguments.results.is_file() else {}
        results[name] = found
        arguments.results.parent.mkdir(parents=True, exist_ok=True)
        arguments.results.write_text(json.dumps(results, indent=1) + "\n")

    work: dict[str, Callable[[], Any]] = {
        "approach": lambda: approach_study(worlds, arguments.pictures, say),
        "faults": lambda: fault_study(
            worlds[:8], arguments.pictures, say, lambda found: keep("faults", found)
        ),
        "registration": lambda: registration_study(
            worlds, arguments.pictures, say, lambda found: keep("registration", found)
        ),
    }
    for name in arguments.only or STUDIES:
        started = time.process_time()
        found = work[name]()
        say(f"{name}: {time.process_time() - started:.0f} CPU s")
        keep(name, found)
    if arguments.out:
        write_report(json.loads(arguments.results.read_text()), arguments.out)


if __name__ == "__main__":
    main()
