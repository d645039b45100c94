"""One error budget: from the surface point under the designated pixel to the tool at contact.

    python -m studies.error_budget --worlds 10 --draws 4 --out docs

Every chain is real: a pixel is designated at 10 m and followed to the arm's reach by the feature tracker, the
pixel that the tracker ends on goes through the cascade into the hazcams under a trial's mast, calibration and
exposure errors, the hazcams range it, and the tool goes there with the arm's error. Each part's own error is
measured on the way against the rendered truth. Worlds and pictures are those of studies/perception.py.
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

from rover_iface.errors import TrackerError
from rover_iface.profile import load_profile
from rover_iface.vision.handoff_cascade import cascade
from rover_iface.vision.sift import SiftTracker
from rover_iface.vision.tracker import TrackState
from studies.common.pages import table, write_sections
from studies.common.perception_worlds import TRAINING, Sequence, Shot, approach
from studies.common.tracking_worlds import Array
from studies.handoff import World

PARTS = {
    "stereo at designation": "point stereo of the designated pixel at 10 m, before anything is tracked",
    "tracking": "across the line of sight, 10 m to the arm's reach",
    "hand-off": "in the hazcam image, at the target's range",
    "hazcam stereo": "along the hazcam's line of sight",
    "arm": "accuracy of the profile, cut normal as the simulated arm has it",
    "whole chain": "tool at contact from the designated surface point",
}


def chains(sequence: Sequence, draws: int) -> list[dict[str, float]]:
    """Return the error of each part and of the whole, metres, of every chain that the rover believed in.

    A chain that was told as lost or refused is a row with `refused` 1 and nothing else.
    """
    halts = sequence.halts
    views = [halt.view() for halt in halts]
    first, last = halts[0].left, halts[-1].left
    world = World(sequence, miscalibrated=True)
    accuracy_m = load_profile("k9").arm.accuracy_m
    tracker = SiftTracker()
    meant: dict[int, Array] = {}
    ranged: dict[int, float] = {}
    rng = np.random.default_rng([sequence.seed, 0xB0D6])
    for number, (pixel, _) in enumerate(sequence.targets):
        at = pixel + rng.uniform(-0.5, 0.5, 2)
        try:
            update = tracker.start(str(number), None, views[0], pixel=at)
        except TrackerError:
            continue
        meant[number] = first.at(at)
        told = np.linalg.norm(update.position - views[0].left_camera.C)
        ranged[number] = abs(float(told - np.linalg.norm(meant[number] - first.true.C)))
    answers = {}
    for view in views[1:]:
        answers = {number: tracker.update(str(number), view) for number in meant}
    out = []
    for number, point in meant.items():
        answer = answers[number]
        for draw in range(draws):
            lot = np.random.default_rng([sequence.seed, number, 300 + draw])
            given, _, _ = world.trial(point, lot)
            if answer.state is not TrackState.TRACKED:
                out.append({"refused": 1.0})
                continue
            handed = cascade(replace(given, near_pixel=answer.pixel), "near")
            if not handed.accepted:
                out.append({"refused": 1.0})
                continue
            arm = np.clip(0.5 * lot.standard_normal(3), -1.0, 1.0) * accuracy_m
            out.append(
                {"stereo at designation": ranged[number]}
                | _parts(last, sequence.hazcam[0], point, answer.pixel, handed.pixel, handed.position, arm)
            )
    return out


def _parts(
    last: Shot, hazcam: Shot, meant: Array, tracked_px: Array, handed_px: Array, position: Array, arm: Array
) -> dict[str, float]:
    """Return what each part adds, metres, against the true surface under the pixels it was given and gave."""
    tracked = last.at(tracked_px)
    ray = meant - last.true.C
    ray = ray / np.linalg.norm(ray)
    off = tracked - meant
    handed = hazcam.at(handed_px)
    away = float(np.linalg.norm(tracked - hazcam.true.C))
    gap_px = float(np.hypot(*(handed_px - hazcam.true.project(tracked))))
    return {
        "tracking": float(np.linalg.norm(off - ray * (ray @ off))),
        "hand-off": gap_px * away / hazcam.true.hs,
        "hazcam stereo": float(np.linalg.norm(position - handed)),
        "arm": float(np.linalg.norm(arm)),
        "whole chain": float(np.linalg.norm(position + arm - meant)),
    }


def study(worlds: list[int], draws: int, folder: Path, keep: Callable[[dict[str, Any]], None]) -> None:
    """Run the chains of all worlds; `keep` gets what is known after each."""
    rows: list[dict[str, float]] = []
    for seed in worlds:
        began = time.process_time()
        rows += chains(approach(seed, folder), draws)
        done = [r for r in rows if "refused" not in r]
        parts = {name: np.array([r[name] for r in done]) for name in PARTS}
        keep(
            {
                "worlds": worlds[: worlds.index(seed) + 1],
                "chains": len(rows),
                "refused": len(rows) - len(done),
                "parts": {
                    name: {
                        "rms_cm": 100.0 * float(np.sqrt(np.mean(v**2))),
                        **{f"p{q}_cm": 100.0 * float(np.percentile(v, q)) for q in (50, 95, 100)},
                    }
                    for name, v in parts.items()
                },
                "whole_cm": [round(100.0 * float(v), 3) for v in parts["whole chain"]],
            }
        )
        print(f"  world {seed}: {time.process_time() - began:.0f} CPU s", flush=True)


def _budget(results: dict[str, Any]) -> str:
    found = results["budget"]
    rows = []
    for name, what in PARTS.items():
        e = found["parts"][name]
        rows.append([name, what, *(f"{e[k]:.2f}" for k in ("p50_cm", "p95_cm", "p100_cm", "rms_cm"))])
    share = 100.0 * found["refused"] / found["chains"]
    added = ("tracking", "hand-off", "hazcam stereo", "arm")
    root = float(np.sqrt(sum(found["parts"][name]["rms_cm"] ** 2 for name in added)))
    return (
        f"{found['chains']} chains in {len(found['worlds'])} worlds, {found['refused']} ({share:.1f} %) "
        "of them ended with a refusal instead.\n\n"
        + table(["part", "what is measured", "median cm", "95 %", "worst", "rms"], rows)
        + f"\nThe last four parts add up to {root:.2f} cm (root of the sum of squares); the whole chain has "
        f"{found['parts']['whole chain']['rms_cm']:.2f} cm.\n"
    )


def draw(found: dict[str, Any], path: Path) -> None:
    """Draw what each part adds, and how the whole is spread."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.6), layout="constrained")
    names = ["tracking", "hand-off", "hazcam stereo", "arm", "whole chain"]
    for n, name in enumerate(reversed(names)):
        e = found["parts"][name]
        colour = "tab:orange" if name == "whole chain" else "tab:blue"
        left.barh(n, e["p50_cm"], color=colour)
        left.plot([e["p50_cm"], e["p95_cm"]], [n, n], color="black", lw=1)
        left.plot(e["p100_cm"], n, "x", color="black")
    left.set_yticks(range(len(names)), list(reversed(names)))
    left.set(xlabel="error, cm: median, line to 95 %, cross at worst")
    whole = np.sort(found["whole_cm"])
    right.plot(whole, np.linspace(0, 100, len(whole)), color="tab:orange")
    for limit in (1.0, 2.0):
        right.axvline(limit, color="grey", lw=0.8, ls=":")
    right.set(
        xlabel="tool from the designated point, cm", ylabel="% of chains", ylim=(0, 100), xlim=(0, None)
    )
    figure.savefig(path, dpi=100)
    plt.close(figure)


def main() -> None:
    """Run the chains and write table and plot."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--worlds", type=int, default=10)
    parser.add_argument("--draws", type=int, default=4, help="trials of mast and calibration per target")
    parser.add_argument("--pictures", type=Path, default=Path(tempfile.gettempdir()) / "outcrop_perception")
    parser.add_argument("--results", type=Path, default=Path("studies/results/error_budget.json"))
    parser.add_argument(
        "--out", type=Path, help="docs folder whose page of tracking results gets table and plot"
    )
    parser.add_argument("--report-only", action="store_true", help="write the table of the kept figures")
    arguments = parser.parse_args()

    def keep(found: dict[str, Any]) -> None:
        arguments.results.parent.mkdir(parents=True, exist_ok=True)
        arguments.results.write_text(json.dumps({"budget": found}, indent=1) + "\n")

    if not arguments.report_only:
        study(list(range(TRAINING, arguments.worlds)), arguments.draws, arguments.pictures, keep)
    if arguments.out:
        results = json.loads(arguments.results.read_text())
        write_sections(arguments.out, "tracking", results, {"budget": _budget})
        draw(results["budget"], arguments.out / "img" / "error_budget.png")


if __name__ == "__main__":
    main()
