"""Hand-off from mast to hazcams: the twelve published methods (Table 1), the cascade, pancam to navcam.

    python -m studies.handoff --out docs                 # all, about 15 min of one core
    python -m studies.handoff --only cascade --draws 3

Uses the rendered approaches of studies/perception.py. Each trial has its own errors: mast tilt (sigma 1
degree), pose (5 % of 3 m and 2 degrees for the far pair), a navcam pair that has come out of calibration
(range off by about 3 %), exposure and contrast of the hazcams off by up to 40 %, and one far picture in six
washed out.
"""

from __future__ import annotations

import argparse
import json
import math
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.model import CameraModel
from rover_iface.frames import Transform
from rover_iface.vision.handoff import METHODS, Handoff, Side, hand_off, scaled_window
from rover_iface.vision.handoff_cascade import cascade
from rover_iface.vision.sift_motion import small_rotation
from rover_iface.vision.tracker import Image, StereoView
from studies.common.mast_error import mast_error
from studies.common.pages import table, write_sections
from studies.common.perception_worlds import TRAINING, Sequence, approach
from studies.common.tracking_worlds import PIVOT, Array

PUBLISHED = {
    "pure kinematic": ("100 %, 13 ± 3", "100 %, 107 ± 58"),
    "alternate kinematic": ("100 %, 22 ± 5", "83 %, 102 ± 27"),
    "refined kinematic": ("55 %, 1 ± 1 / 99 ± 76", "67 %, 2 ± 1 / 83 ± 52"),
    "pure geometric": ("100 %, 9 ± 6", "100 %, 54 ± 21"),
    "refined geometric": ("50 %, 1 ± 1 / 109 ± 77", "17 %, 2 ± 1 / 52 ± 55"),
    "registration": ("100 %, 28 ± 11", "100 %, 124 ± 57"),
}
SUCCESS_PX = 4.0
"""Largest error of a success in the published table, whose threshold is not stated."""


def turned(camera: CameraModel, centre: Array, turn: Array) -> CameraModel:
    """Return a camera turned about a point by a rotation vector, radians."""
    rotation = small_rotation(turn)
    return camera.transformed(Transform(rotation, centre - rotation @ centre))


def exposed(image: Image, rng: np.random.Generator) -> Image:
    """Return a picture with another gain and contrast than its pair expects."""
    gain, power = float(rng.uniform(0.7, 1.4)), float(rng.uniform(0.75, 1.3))
    noisy = gain * image**power + rng.normal(0.0, 0.004, image.shape)
    return np.asarray(np.clip(noisy, 0.0, 1.0), dtype=np.float32)


def washed_out(image: Image) -> Image:
    """Return a badly overexposed picture."""
    return np.asarray(np.clip(2.2 * image + 0.12, 0.0, 1.0), dtype=np.float32)


class World:
    """One approach as hand-off sees it: clouds are made once, trials only move them."""

    def __init__(self, sequence: Sequence, *, miscalibrated: bool) -> None:
        rng = np.random.default_rng([sequence.seed, 0x4A2D])
        self.sequence = sequence
        halts = sequence.halts
        ranges = [float(np.hypot(*h.left.true.C[:2])) for h in halts]
        self.near_halt = halts[-1]
        self.far_halt = halts[int(np.argmin(np.abs(np.array(ranges) - ranges[-1] - 2.0)))]
        self.pivot = np.asarray(self.near_halt.pose.site_from_rover.apply(np.array(PIVOT)))
        self.axis = self.near_halt.left.true.horizontal
        # 0.2 m baseline: a toe-in of this much is 3 % of range at 1.5 m
        toe = float(rng.normal(0.0, 0.004 if miscalibrated else 0.0))
        sides = []
        for halt, wash in ((self.near_halt, False), (self.far_halt, rng.random() < 1 / 6)):
            images = [s.unit for s in (halt.left, halt.right)]
            if wash and miscalibrated:
                images = [washed_out(image) for image in images]
            right = halt.right.true
            down = np.cross(right.A, right.horizontal)
            right = turned(right, right.C, toe * down)
            sides.append(Side(StereoView(images[0], images[1], halt.left.true, right), 0.8))
        self.near, self.far = sides
        left, right_shot = sequence.hazcam
        gains = np.random.default_rng([sequence.seed, 3])
        state = gains.bit_generator.state
        images = []
        for shot in (left, right_shot):
            gains.bit_generator.state = state
            images.append(exposed(shot.unit, gains))
        self.hazcam = Side(StereoView(images[0], images[1], left.true, right_shot.true), 0.3)
        for side in (self.near, self.far, self.hazcam):
            _ = side.cloud

    def trial(self, point: Array, rng: np.random.Generator) -> tuple[Handoff, Array, float]:
        """Return what a hand-off is given, the true pixel in the left hazcam, and the tilt error."""
        tilt = float(rng.normal(0.0, math.radians(1.0)))
        near_error = _about(self.pivot, tilt * self.axis)
        drift = rng.normal(0.0, 1.0, 3) * (1.0, 1.0, 0.3)
        drift *= 0.05 * 3.0 / math.sqrt(2.0)
        heading = float(rng.normal(0.0, math.radians(2.0)))
        far_pivot = np.asarray(self.far_halt.pose.site_from_rover.apply(np.array(PIVOT)))
        far_error = Transform(np.eye(3), drift) * _about(self.pivot, np.array([0.0, 0.0, heading]))
        far_error = far_error * _about(far_pivot, tilt * self.far_halt.left.true.horizontal)
        given = Handoff(
            self.hazcam,
            self.near.moved(near_error),
            np.asarray(self.near.view.left_camera.project(point)),
            self.far.moved(far_error),
            np.asarray(self.far.view.left_camera.project(point)),
        )
        return given, np.asarray(self.hazcam.view.left_camera.project(point)), tilt


def some(sequence: Sequence, count: int) -> list[Array]:
    """Return up to `count` of a sequence's targets, from top to bottom."""
    points = [point for _, point in sequence.targets]
    if len(points) <= count:
        return points
    return [points[n] for n in np.linspace(0, len(points) - 1, count).round().astype(int)]


def _about(centre: npt.ArrayLike, turn: npt.ArrayLike) -> Transform:
    middle, rotation = np.asarray(centre), small_rotation(np.asarray(turn, dtype=np.float64))
    return Transform(rotation, middle - rotation @ middle)


Say = Callable[[str], None]


def methods_study(
    worlds: list[int], folder: Path, say: Say, keep: Callable[[dict[str, Any]], None]
) -> dict[str, Any]:
    """Return Table 1: each published method from near and far.

    `keep` gets what is known after each world.
    """
    found: dict[str, Any] = {}
    errors: dict[str, dict[str, list[float | None]]] = {name: {"near": [], "far": []} for name in METHODS}
    for seed in worlds:
        world = World(approach(seed, folder), miscalibrated=True)
        for number, point in enumerate(some(world.sequence, 6)):
            rng = np.random.default_rng([seed, number, 1])
            given, true, _ = world.trial(point, rng)
            for which in ("near", "far"):
                for name in METHODS:
                    answer = hand_off(name, which, given)
                    errors[name][which].append(
                        None if answer is None else float(np.hypot(*(answer.pixel - true)))
                    )
        say(f"  methods, world {seed}")
        found = {
            "trials": len(errors["pure kinematic"]["near"]),
            "table": {n: {w: _summary(e) for w, e in by.items()} for n, by in errors.items()},
        }
        keep(found)
    return found


def _summary(errors: list[float | None]) -> dict[str, float | None]:
    known = np.array([e for e in errors if e is not None])
    good, bad = known[known <= SUCCESS_PX], known[known > SUCCESS_PX]

    def mean(values: Array) -> float | None:
        return float(values.mean()) if len(values) else None

    return {
        "trials": len(errors),
        "answered_percent": 100.0 * len(known) / len(errors),
        "mean_px": mean(known),
        "sd_px": float(known.std()) if len(known) else None,
        "low_px": float(known.min()) if len(known) else None,
        "high_px": float(known.max()) if len(known) else None,
        "success_percent": 100.0 * len(good) / len(errors),
        "success_px": mean(good),
        "failure_px": mean(bad),
        "failure_sd_px": float(bad.std()) if len(bad) else None,
    }


def cascade_study(
    worlds: list[int], draws: int, folder: Path, say: Say, keep: Callable[[dict[str, Any]], None]
) -> dict[str, Any]:
    """Return how often the cascade is right, refuses, and is wrong; and what it makes of the mast; by side.

    `keep` gets what is known after each world.
    """
    found: dict[str, Any] = {}
    rows: list[dict[str, Any]] = []
    for seed in worlds:
        world = World(approach(seed, folder), miscalibrated=True)
        for draw in range(draws):
            for number, point in enumerate(some(world.sequence, 9)):
                given, true, tilt = world.trial(point, np.random.default_rng([seed, number, 100 + draw]))
                for which in ("near", "far"):
                    began = time.process_time()
                    answer = cascade(given, which)
                    spent = time.process_time() - began
                    row: dict[str, Any] = {
                        "which": which,
                        "accepted": answer.accepted,
                        "cpu_s": spent,
                        "error_px": None,
                        "tilt_deg": None,
                    }
                    if answer.accepted:
                        row["error_px"] = float(np.hypot(*(answer.pixel - true)))
                        row["stated_px"] = answer.error_px
                        row["error_cm"] = 100.0 * float(np.linalg.norm(answer.position - point))
                        if which == "near":
                            told = mast_error(
                                given.source(which)[0],
                                given.hazcam,
                                answer,
                                world.pivot,
                                world.axis,
                                (0.0, 0.0, 1.0),
                            )
                            row["tilt_deg"] = None if told is None else math.degrees(told.tilt_rad + tilt)
                    else:
                        row["reason"] = answer.reasons[0]
                    rows.append(row)
        say(f"  cascade, world {seed}")
        found = {
            f"{which}, worlds {worlds[0]} to {seed}": _outcome([r for r in rows if r["which"] == which])
            for which in ("near", "far")
        }
        keep(found)
    return found


def _outcome(rows: list[dict[str, Any]]) -> dict[str, Any]:
    taken = [r for r in rows if r["accepted"]]
    errors = np.array([r["error_px"] for r in taken])
    tilts = np.abs([r["tilt_deg"] for r in taken if r["tilt_deg"] is not None])
    return {
        "trials": len(rows),
        "within_2_percent": 100.0 * float((errors <= 2.0).sum()) / len(rows),
        "refused_percent": 100.0 * (len(rows) - len(taken)) / len(rows),
        "wrong_percent": 100.0 * float((errors > 2.0).sum()) / len(rows),
        "median_px": float(np.median(errors)),
        "p95_px": float(np.percentile(errors, 95)),
        "max_px": float(errors.max()),
        "median_cm": float(np.median([r["error_cm"] for r in taken])),
        "p95_cm": float(np.percentile([r["error_cm"] for r in taken], 95)),
        "stated_ratio": float(np.sqrt(np.mean((errors / [r["stated_px"] for r in taken]) ** 2) / 2.0)),
        "tilt_deg": [float(np.percentile(tilts, q)) for q in (50, 95, 100)] if len(tilts) else None,
        "cpu_s": float(np.median([r["cpu_s"] for r in rows])),
    }


def pancam_study(worlds: list[int], folder: Path, say: Say) -> dict[str, Any]:
    """Return errors of the scaled window from pancam to navcam at about 4.5 m."""
    errors, refused = [], 0
    for seed in worlds:
        sequence = approach(seed, folder)
        pancam = sequence.pancam
        halt = min(sequence.halts, key=lambda h: float(np.linalg.norm(h.left.true.C - pancam.true.C)))
        rng = np.random.default_rng([seed, 0xBA])
        for y in range(40, pancam.image.shape[0] - 40, 24):
            for x in range(40, pancam.image.shape[1] - 40, 24):
                if not pancam.on_rock[y - 8 : y + 9, x - 8 : x + 9].all():
                    continue
                point = pancam.at((x, y))
                true = np.asarray(halt.left.true.project(point))
                hidden = np.linalg.norm(halt.left.at(true) - point) > 0.03
                if hidden or not halt.left.true.sees(point, 40.0):
                    continue
                error = _about(halt.left.true.C, rng.normal(0.0, math.radians(0.3), 3))
                believed = point + 0.03 * float(rng.normal()) * (point - pancam.true.C)
                found = scaled_window(
                    exposed(pancam.unit, rng),
                    pancam.true,
                    (x, y),
                    halt.left.unit,
                    halt.left.true.transformed(error),
                    believed,
                )
                if found is None or found.score < 0.7:
                    refused += 1
                    continue
                errors.append(float(np.hypot(*(found.pixel - true))))
        say(f"  pancam, world {seed}")
    values = np.array(errors)
    return {
        "targets": len(values) + refused,
        "refused": refused,
        "within_half_percent": 100.0 * float((values <= 0.5).mean()),
        "median_px": float(np.median(values)),
        "p99_px": float(np.percentile(values, 99)),
        "max_px": float(values.max()),
    }


def _methods(results: dict[str, Any]) -> str:
    found = results["methods"]
    rows = []
    for name, by in found["table"].items():
        for which in ("near", "far"):
            e = by[which]
            said = PUBLISHED.get(name)
            matched = name.startswith("refined")
            if e["mean_px"] is None:
                ours = "-"
            elif matched:
                good = "-" if e["success_px"] is None else f"{e['success_px']:.1f}"
                bad = (
                    "none" if e["failure_px"] is None else f"{e['failure_px']:.0f} ± {e['failure_sd_px']:.0f}"
                )
                ours = f"{e['success_percent']:.0f} %, {good} / {bad}"
            else:
                ours = f"{e['answered_percent']:.0f} %, {e['mean_px']:.0f} ± {e['sd_px']:.0f}"
            spread = "-" if e["low_px"] is None else f"{e['low_px']:.1f} to {e['high_px']:.0f}"
            rows.append([name, which, "-" if said is None else said[which == "far"], ours, spread])
    head = ["method", "navcams", "published: success, error px", "here", "range px"]
    return f"{found['trials']} trials a method.\n\n" + table(head, rows)


def _near_first(entry: tuple[str, Any]) -> tuple[bool, int]:
    """Return the place of a row of the cascade's table: `far, worlds 4 to 6` after all near ones."""
    side, worlds = entry[0].split(", worlds ")
    return side == "far", int(worlds.split()[0])


def _cascade(results: dict[str, Any]) -> str:
    rows = []
    for which, e in sorted(results["cascade"].items(), key=_near_first):
        tilt = "-" if e["tilt_deg"] is None else " / ".join(f"{v:.2f}" for v in e["tilt_deg"])
        rows.append(
            [
                which,
                str(e["trials"]),
                f"{e['within_2_percent']:.1f}",
                f"{e['refused_percent']:.1f}",
                f"{e['wrong_percent']:.1f}",
                f"{e['median_px']:.2f} / {e['p95_px']:.2f} / {e['max_px']:.1f}",
                f"{e['median_cm']:.2f} / {e['p95_cm']:.2f}",
                tilt,
                f"{e['cpu_s']:.2f}",
            ]
        )
    head = [
        "navcams",
        "trials",
        "right within 2 px, %",
        "refused, %",
        "wrong but accepted, %",
        "error px",
        "error cm",
        "mast tilt error, deg",
        "CPU s",
    ]
    return table(head, rows)


def _pancam(results: dict[str, Any]) -> str:
    e = results["pancam"]
    return (
        f"{e['targets']} targets on rocks, {e['refused']} refused (alignments apart, correlation below 0.7): "
        f"{e['within_half_percent']:.1f} % of the rest within 0.5 px, median {e['median_px']:.2f}, "
        f"99 % within {e['p99_px']:.2f}, worst {e['max_px']:.2f} px."
    )


STUDIES = ("methods", "cascade", "pancam")


def main() -> None:
    """Run the studies that were asked for and write tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", choices=STUDIES, action="append")
    parser.add_argument("--first", type=int, default=TRAINING, help="first world")
    parser.add_argument("--worlds", type=int, default=16, help="world after the last")
    parser.add_argument("--draws", type=int, default=3, help="trials per target of the cascade study")
    parser.add_argument("--pictures", type=Path, default=Path(tempfile.gettempdir()) / "outcrop_perception")
    parser.add_argument("--results", type=Path, default=Path("studies/results/handoff.json"))
    parser.add_argument("--out", type=Path, help="docs folder whose page of hand-off results gets the tables")
    arguments = parser.parse_args()
    worlds, folder = list(range(arguments.first, arguments.worlds)), arguments.pictures

    def say(line: str) -> None:
        print(line, flush=True)

    def keep(name: str, found: dict[str, Any]) -> None:
        results = json.loads(arguments.results.read_text()) if arguments.results.is_file() else {}
        if name == "cascade":  # beside what other worlds gave, in place of what fewer of these did
            begun = f"worlds {worlds[0]} to "
            others = {k: v for k, v in results.get(name, {}).items() if begun not in k}
            found = others | found
        results[name] = found
        arguments.results.parent.mkdir(parents=True, exist_ok=True)
        arguments.results.write_text(json.dumps(results, indent=1) + "\n")

    work: dict[str, Callable[[], Any]] = {
        "methods": lambda: methods_study(worlds, folder, say, lambda found: keep("methods", found)),
        "cascade": lambda: cascade_study(
            worlds, arguments.draws, folder, say, lambda found: keep("cascade", found)
        ),
        "pancam": lambda: pancam_study(worlds, folder, say),
    }
    for name in arguments.only or STUDIES:
        started = time.process_time()
        found = work[name]()
        say(f"{name}: {time.process_time() - started:.0f} CPU s")
        keep(name, found)
    if arguments.out:
        results = json.loads(arguments.results.read_text())
        makers: dict[str, Callable[[dict[str, Any]], str]] = {
            "methods": _methods,
            "cascade": _cascade,
            "pancam": _pancam,
        }
        write_sections(arguments.out, "handoff", results, makers)


if __name__ == "__main__":
    main()
