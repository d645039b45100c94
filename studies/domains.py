"""Trackers and odometry where their pictures come from elsewhere: one table, the same constants everywhere.

    python -m studies.domains --out docs                        # fresh seeds, printed; writes the table
    python -m studies.domains --out docs --seed 734112          # the same seeds again
    python -m studies.domains --tuning                          # seeds that constants were set on;
    writes nothing
    python -m studies.domains --out docs --trackers             # odometry alone

Domains: (a) the own renderer, (b) its geometry under the grain, albedo and blur of real Mars frames, (c) real
stereo pairs turned and zoomed by known geometry and compressed to 1 to 4 bits a pixel. Targets follow a plain
rule: any visible point of a rock of 25 to 70 cm, 3 px inside its outline. A run with a fault is counted
on its own lines: an unknown jump of the heading by 7 degrees, a board in front for two stops, the sun
gone round.
"""

from __future__ import annotations

import argparse
import subprocess
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from rover_iface.vision.ncc import NccTracker
from rover_iface.vision.sift import SiftTracker
from rover_iface.vision.tracker import Tracker
from studies.common.domain_rows import (
    INSIDE,
    OdometryRow,
    Row,
    auc,
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
MAKE: dict[str, Callable[[], Tracker]] = {"correlation": NccTracker, "features": SiftTracker}
DOMAINS = {
    "own": "(a) own renderer",
    "draped": "(b) grain of real frames",
    "warped": "(c) real pairs, warped",
}
Key = tuple[str, str, str]
"""Tracker, domain, "nominal" or "faults"."""


class Figures:
    """Rows of all runs, by tracker, domain and kind."""

    def __init__(self) -> None:
        self.rows: dict[Key, list[Row]] = defaultdict(list)
        self.refused: dict[Key, int] = defaultdict(int)
        self.steps: dict[str, list[OdometryRow]] = defaultdict(list)

    def add(self, key: Key, found: tuple[list[Row], int]) -> None:
        """Take what `follow` has found."""
        self.rows[key] += found[0]
        self.refused[key] += found[1]


def runs(seeds: Seeds, imagery: Path, folder: Path, faults: int) -> Iterator[Run]:
    """Yield approaches: every seed in both domains, and of the first `faults` of them each fault."""
    for domain in ("own", "draped"):
        for seed in seeds.values:
            yield kept_run(domain, seed, seeds.purpose, imagery, folder)
        for seed in seeds.values[:faults]:
            for fault in FAULTS:
                yield kept_run(domain, seed, seeds.purpose, imagery, folder, fault)


def measure(seeds: Seeds, imagery: Path, folder: Path, faults: int, trackers: list[str]) -> Figures:
    """Return the rows of every tracker on every run."""
    figures = Figures()
    for run in runs(seeds, imagery, folder, faults):
        started = time.process_time()
        fault: Fault = run.fault
        for name in trackers:
            figures.add((name, run.domain, "faults" if fault else "nominal"), follow(run, MAKE[name]()))
        if not fault:
            figures.steps[run.domain] += odometry(run)
        print(
            f"  {run.domain} {run.seed} {fault or 'nominal'}: {time.process_time() - started:.0f} s",
            flush=True,
        )
    for pair in PAIRS[seeds.purpose]:
        for seed in seeds.values:
            sights = warped_run(pair, seed, imagery)
            for name in trackers:
                figures.add((name, "warped", "nominal"), follow_warped(sights, MAKE[name]()))
            figures.steps["warped"] += odometry_warped(sights)
    return figures


def tracker_table(figures: Figures) -> str:
    """Return the table of the trackers."""
    lines = []
    for (name, domain, kind), rows in sorted(figures.rows.items()):
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
                f"{found.auc:.3f}",
                f"{found.undetected} of {found.tracked}",
                f"{found.false_alarms:.1f}",
            ]
        )
    for name in sorted({key[0] for key in figures.rows}):
        every = [
            r for key, rows in figures.rows.items() if key[0] == name and key[1] != "warped" for r in rows
        ]
        right = np.array([r.confidence for r in every if not r.wrong])
        wrong = np.array([r.confidence for r in every if r.wrong])
        tracked = [r for r in every if r.tracked]
        false = sum(r.wrong for r in tracked)
        lines.append(
            [
                name,
                "(a) and (b)",
                "all",
                "",
                str(len(every)),
                "",
                "",
                "",
                f"{auc(right, wrong):.3f}",
                f"{false} of {len(tracked)}",
                "",
            ]
        )
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
    commit = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=True
    ).stdout.strip()
    note = f"Seeds {seeds.values[0]} to {seeds.values[-1]}, drawn when the command ran; commit {commit}."
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
    parser.add_argument("--trackers", nargs="*", choices=list(MAKE), default=list(MAKE))
    parser.add_argument("--imagery", type=Path, default=SHARED / "data/imagery")
    parser.add_argument("--pictures", type=Path, default=Path(tempfile.gettempdir()) / "domains")
    arguments = parser.parse_args()
    chosen = tuning(arguments.worlds) if arguments.tuning else reporting(arguments.worlds, arguments.seed)
    print(f"{chosen.purpose} seeds {chosen.values}", flush=True)
    figures = measure(chosen, arguments.imagery, arguments.pictures, arguments.faults, arguments.trackers)
    print(tracker_table(figures))
    print(odometry_table(figures))
    if arguments.out is not None:
        report(figures, chosen, arguments.out)


if __name__ == "__main__":
    main()
