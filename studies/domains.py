"""Trackers and odometry where their pictures come from elsewhere: one table, the same constants everywhere.

    python -m studies.domains --out docs                        # fresh seeds, printed; writes the table
    python -m studies.domains --out docs --seed 734112          # the same seeds again
    python -m studies.domains --tuning                          # seeds that constants were set on;
    writes nothing
    python -m studies.domains --out docs --trackers             # odometry alone

Domains: (a) the own renderer, (b) its geometry under the grain, albedo and blur of real Mars frames, (c) real
stereo pairs turned and zoomed by known geometry and compressed to 1 to 4 bits a pixel, (d) MuJoCo's renderer
on the same triangles. Targets follow a plain rule: any visible point of a rock of 25 to 70 cm, 3 px inside
its outline. A run with a fault is counted on its own lines: an unknown jump of the heading by 7 degrees, a
board in front for two stops, the sun gone round.

Domain (d) needs what `studies/common/mujoco_pictures.py` names: `pip install -r studies/offscreen.txt` and a
driver that draws without a screen. The table is written anew after each seed.
"""

from __future__ import annotations

import argparse
import math
import subprocess
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from studies.common.domain_rows import (
    INSIDE,
    OdometryRow,
    Row,
    follow,
    follow_warped,
    odometry,
    odometry_warped,
    sums,
)
from studies.common.domain_runs import FAULTS, Fault, Run, kept_run
from studies.common.domain_split import PAIRS, Purpose, Seeds, reporting, tuning
from studies.common.pages import table, write_section
from studies.common.warped import warped_run

SHARED = Path(__file__).resolve().parents[1].parent / "shared"
TRACKERS = {"correlation": "ncc", "correlation and narrow pair": "ncc-narrow", "features": "sift"}
"""What is reported, and its name among the trackers of the program."""
DOMAINS = {
    "own": "(a) own renderer",
    "draped": "(b) grain of real frames",
    "warped": "(c) real pairs, warped",
    "mujoco": "(d) MuJoCo's renderer",
}
RENDERED = ("own", "draped", "mujoco")
Key = tuple[str, str, str]
"""Tracker, domain, "nominal" or "faults"."""


class Figures:
    """Rows of all runs, by tracker, domain and kind, and the commit whose code they are of."""

    def __init__(self) -> None:
        self.rows: dict[Key, list[Row]] = defaultdict(list)
        self.refused: dict[Key, int] = defaultdict(int)
        self.steps: dict[str, list[OdometryRow]] = defaultdict(list)
        head = ["git", "rev-parse", "--short", "HEAD"]
        self.commit = subprocess.run(head, capture_output=True, text=True, check=True).stdout.strip()

    def add(self, key: Key, found: tuple[list[Row], int]) -> None:
        """Take what `follow` has found."""
        self.rows[key] += found[0]
        self.refused[key] += found[1]


def runs(
    seed: int, purpose: Purpose, arguments: argparse.Namespace, faults: tuple[Fault, ...]
) -> Iterator[Run]:
    """Yield the approaches of a seed in each domain that is rendered, with each of some faults ("": none)."""
    for domain in (d for d in RENDERED if d in arguments.domains):
        for fault in faults:
            yield kept_run(domain, seed, purpose, arguments.imagery, arguments.pictures, fault)


def measure(
    figures: Figures, seed: int, purpose: Purpose, arguments: argparse.Namespace, faults: tuple[Fault, ...]
) -> None:
    """Add the rows of every tracker on the runs of a seed with each of some faults ("": none)."""
    for run in runs(seed, purpose, arguments, faults):
        started = time.process_time()
        for name in arguments.trackers:
            figures.add((name, run.domain, "faults" if run.fault else "nominal"), follow(run, TRACKERS[name]))
        if not run.fault:
            figures.steps[run.domain] += odometry(run)
        spent = time.process_time() - started
        print(f"  {run.domain} {run.seed} {run.fault or 'nominal'}: {spent:.0f} s", flush=True)
    for pair in PAIRS[purpose] if "warped" in arguments.domains and "" in faults else ():
        sights = warped_run(pair, seed, arguments.imagery)
        for name in (n for n in arguments.trackers if TRACKERS[n] != "ncc-narrow"):  # it has no such pair
            figures.add((name, "warped", "nominal"), follow_warped(sights, TRACKERS[name]))
        figures.steps["warped"] += odometry_warped(sights)


def tracker_table(figures: Figures) -> str:
    """Return the table of the trackers."""
    lines = []
    for (name, domain, kind), rows in sorted(
        figures.rows.items(), key=lambda item: (item[0][0], DOMAINS[item[0][1]], item[0][2] != "nominal")
    ):
        found = sums(rows, figures.refused[(name, domain, kind)])
        unit, scale = ("px", 1.0) if domain == "warped" else ("cm", 100.0)
        lines.append(
            [
                name,
                DOMAINS[domain],
                kind,
                f"{found.runs} + {found.refused}",
                str(found.updates),
                f"{found.covered:.1f}",
                f"{scale * found.median:.2f} / {scale * found.p95:.2f} {unit}",
                f"{scale * found.end_median:.2f} / {scale * found.end_worst:.1f} {unit}",
                _auc(found.auc),
                f"{found.undetected} of {found.tracked}",
                f"{found.false_alarms:.1f}",
            ]
        )
    for name in sorted({key[0] for key in figures.rows}):
        parts = [rows for key, rows in figures.rows.items() if key[0] == name and key[1] != "warped"]
        together = sums([row for rows in parts for row in rows], 0)
        followed = sum(sums(rows, 0).runs for rows in parts)
        covered, told = f"{together.covered:.1f}", f"{together.undetected} of {together.tracked}"
        rest = [covered, "", "", _auc(together.auc), told, f"{together.false_alarms:.1f}"]
        lines.append([name, "all but (c)", "all", str(followed), str(together.updates), *rest])
    head = [
        "tracker",
        "domain",
        "runs",
        "targets + refused",
        "updates",
        "inside 95 %",
        "aside: median / 95 %",
    ]
    return table([*head, "end: median / worst", "AUC", "wrong, not told", "false alarms, %"], lines)


def _auc(value: float) -> str:
    """Return the area under the curve in words that a table can take: NaN is that there were none to tell."""
    return "none wrong" if math.isnan(value) else f"{value:.3f}"


def odometry_table(figures: Figures) -> str:
    """Return the table of visual odometry."""
    lines = []
    for domain, steps in figures.steps.items():
        nees = np.array([s.nees for s in steps])
        lines.append(
            [
                DOMAINS[domain],
                str(len(steps)),
                f"{1e3 * float(np.sqrt(np.mean([s.shift_m**2 for s in steps]))):.2f}",
                f"{1e3 * float(np.sqrt(np.mean([s.turn_rad**2 for s in steps]))):.2f}",
                f"{nees.mean():.1f} ({np.median(nees):.1f})",
                f"{100 * float(np.mean(nees < INSIDE[6])):.0f}",
            ]
        )
    head = ["domain", "steps", "shift, mm rms", "turn, mrad rms", "NEES mean (median), 6 expected"]
    return table([*head, "inside 95 %"], lines)


def report(figures: Figures, seeds: Seeds, docs: Path) -> None:
    """Write both tables into the page of results.

    Raises
    ------
    ValueError
        If the seeds are those that constants were set on.
    """
    if seeds.purpose is not Purpose.REPORTING:
        raise ValueError("figures of tuning seeds are not reported")
    drawn = f"Seeds {seeds.values[0]} to {seeds.values[-1]}"
    note = f"{drawn}, drawn when the command ran; commit {figures.commit}."
    if figures.rows:
        write_section(docs, "tracking", "domains", f"{note}\n\n{tracker_table(figures)}")
    write_section(docs, "tracking", "odometry", f"{note}\n\n{odometry_table(figures)}")


def main() -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--worlds", type=int, default=10)
    parser.add_argument("--faults", type=int, default=4)
    parser.add_argument("--seed", type=int)
    parser.add_argument("--tuning", action="store_true")
    parser.add_argument("--trackers", nargs="*", choices=list(TRACKERS), default=list(TRACKERS))
    parser.add_argument("--domains", nargs="+", choices=list(DOMAINS), default=list(DOMAINS))
    parser.add_argument("--kinds", nargs="+", choices=("nominal", "faults"), default=("nominal", "faults"))
    parser.add_argument("--imagery", type=Path, default=SHARED / "data/imagery")
    parser.add_argument("--pictures", type=Path, default=Path(tempfile.gettempdir()) / "domains")
    arguments = parser.parse_args()
    chosen = tuning(arguments.worlds) if arguments.tuning else reporting(arguments.worlds, arguments.seed)
    print(f"{chosen.purpose} seeds {chosen.values}", flush=True)
    figures = Figures()
    nominal = [(seed, ("",)) for seed in chosen.values if "nominal" in arguments.kinds]
    faulty = [(s, FAULTS) for s in chosen.values[: arguments.faults] if "faults" in arguments.kinds]
    for number, (seed, faults) in enumerate([*nominal, *faulty]):
        measure(figures, seed, chosen.purpose, arguments, faults)
        if arguments.out is not None:
            report(figures, Seeds(chosen.purpose, chosen.values[: number + 1]), arguments.out)
    print(tracker_table(figures))
    print(odometry_table(figures))


if __name__ == "__main__":
    main()
