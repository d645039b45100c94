"""Trackers and odometry where their pictures come from elsewhere: one table, the same constants everywhere.

    python -m studies.domains --out docs                        # fresh seeds, printed; writes the table
    python -m studies.domains --out docs --seed 734112          # the same seeds again
    python -m studies.domains --tuning                          # seeds that constants were set on;
    writes nothing
    python -m studies.domains --out docs --trackers             # odometry alone
    python -m studies.domains --out docs --seed 734112 --resume # go on after a stop, at the same commit

Domains: (a) the own renderer, (b) its geometry under the grain, albedo and blur of real Mars frames, (c) real
stereo pairs turned and zoomed by known geometry and compressed to 1 to 4 bits a pixel, (d) MuJoCo's renderer
on the same triangles. Targets follow a plain rule: any visible point of a rock of 25 to 70 cm, 3 px inside
its outline. A run with a fault is counted on its own lines: an unknown jump of the heading by 7 degrees, a
board in front for two stops, the sun gone round.

Domain (d) needs what `studies/common/mujoco_pictures.py` names: `pip install -r studies/offscreen.txt` and a
driver that draws without a screen. The table is written anew after each seed, with the counts that it has by
then; the answers on each approach are kept beside its pictures, and `--resume` takes those of this commit.
"""

from __future__ import annotations

import argparse
import itertools
import math
import pickle
import subprocess
import tempfile
import time
from collections import defaultdict
from dataclasses import dataclass, field
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
from studies.common.domain_runs import FAULTS, Fault, kept_run
from studies.common.domain_split import PAIRS, Seeds, reporting, tuning
from studies.common.pages import table, write_section
from studies.common.warped import warped_run

SHARED = Path(__file__).resolve().parents[1].parent / "shared"
TRACKERS = {
    "correlation": "ncc",
    "correlation and narrow pair": "ncc-narrow",
    "features": "sift",
    "features and shape": "sift-shape",
}
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


@dataclass(slots=True)
class Answers:
    """What came of one approach: by tracker what `follow` has found, and the steps of odometry."""

    found: dict[str, tuple[list[Row], int]] = field(default_factory=dict)
    steps: list[OdometryRow] = field(default_factory=list)


class Figures:
    """Rows of all runs, by tracker, domain and kind; the seeds of each kind, the commit of the code."""

    def __init__(self) -> None:
        self.rows: dict[Key, list[Row]] = defaultdict(list)
        self.refused: dict[Key, int] = defaultdict(int)
        self.steps: dict[str, list[OdometryRow]] = defaultdict(list)
        self.seeds: dict[str, list[int]] = {"nominal": [], "faults": []}
        head = ["git", "rev-parse", "--short", "HEAD"]
        self.commit = subprocess.run(head, capture_output=True, text=True, check=True).stdout.strip()

    def add(self, domain: str, kind: str, answers: Answers) -> None:
        """Take the answers on one approach."""
        for name, (rows, refused) in answers.found.items():
            self.rows[(name, domain, kind)] += rows
            self.refused[(name, domain, kind)] += refused
        self.steps[domain] += answers.steps


def answered(
    figures: Figures, seed: int, domain: str, fault: Fault, arguments: argparse.Namespace
) -> Answers:
    """Return what every tracker answers on one approach, with `--resume` as it was kept."""
    folder: Path = arguments.pictures
    kept = (
        folder / f"answers_{figures.commit}_{domain}_{arguments.purpose}_{seed}_{fault or 'nominal'}.pickle"
    )
    answers = Answers()
    if arguments.resume and kept.is_file():
        with kept.open("rb") as stream:
            answers = pickle.load(stream)
    missing = [name for name in arguments.trackers if name not in answers.found]
    if missing or not (answers.steps or fault):
        started = time.process_time()
        run = kept_run(domain, seed, arguments.purpose, arguments.imagery, folder, fault)
        for name in missing:
            answers.found[name] = follow(run, TRACKERS[name])
        if not fault and not answers.steps:
            answers.steps = odometry(run)
        with kept.open("wb") as stream:
            pickle.dump(answers, stream)
        spent = time.process_time() - started
        print(f"  {domain} {seed} {fault or 'nominal'}: {spent:.0f} s of processor", flush=True)
    return Answers({name: answers.found[name] for name in arguments.trackers}, answers.steps)


def warped(seed: int, arguments: argparse.Namespace) -> Answers:
    """Return what trackers answer on the real pairs of domain (c): there is no narrow pair, no arrival."""
    answers = Answers()
    for pair in PAIRS[arguments.purpose]:
        sights = warped_run(pair, seed, arguments.imagery)
        for name in (n for n in arguments.trackers if TRACKERS[n] in ("ncc", "sift")):
            rows, refused = follow_warped(sights, TRACKERS[name])
            before = answers.found.get(name, ([], 0))
            answers.found[name] = before[0] + rows, before[1] + refused
        answers.steps += odometry_warped(sights)
    return answers


def measure(figures: Figures, seed: int, arguments: argparse.Namespace, *, faulty: bool) -> None:
    """Add the answers on the runs of a seed, with and without faults as they are asked for."""
    rendered = [domain for domain in RENDERED if domain in arguments.domains]
    if "nominal" in arguments.kinds:
        for domain in rendered:
            figures.add(domain, "nominal", answered(figures, seed, domain, "", arguments))
        if "warped" in arguments.domains:
            figures.add("warped", "nominal", warped(seed, arguments))
        figures.seeds["nominal"].append(seed)
    if faulty:
        for domain, fault in itertools.product(rendered, FAULTS):
            figures.add(domain, "faults", answered(figures, seed, domain, fault, arguments))
        figures.seeds["faults"].append(seed)


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
    seeds.require_reporting()
    told = [f"{kind}: {_span(done)}" for kind, done in figures.seeds.items() if done]
    note = f"Seeds, drawn when the command ran: {'; '.join(told)}. Commit {figures.commit}."
    if figures.rows:
        write_section(docs, "tracking", "domains", f"{note}\n\n{tracker_table(figures)}")
    write_section(docs, "tracking", "odometry", f"{note}\n\n{odometry_table(figures)}")


def _span(seeds: list[int]) -> str:
    """Return consecutive seeds in words."""
    return str(seeds[0]) if len(seeds) == 1 else f"{seeds[0]} to {seeds[-1]} ({len(seeds)} worlds)"


def main() -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--worlds", type=int, default=10)
    parser.add_argument("--faults", type=int, default=4)
    parser.add_argument("--seed", type=int)
    parser.add_argument("--tuning", action="store_true")
    parser.add_argument("--resume", action="store_true")
    parser.add_argument("--trackers", nargs="*", choices=list(TRACKERS), default=list(TRACKERS))
    parser.add_argument("--domains", nargs="+", choices=list(DOMAINS), default=list(DOMAINS))
    parser.add_argument("--kinds", nargs="+", choices=("nominal", "faults"), default=("nominal", "faults"))
    parser.add_argument("--imagery", type=Path, default=SHARED / "data/imagery")
    parser.add_argument("--pictures", type=Path, default=Path(tempfile.gettempdir()) / "domains")
    arguments = parser.parse_args()
    chosen = tuning(arguments.worlds) if arguments.tuning else reporting(arguments.worlds, arguments.seed)
    print(f"{chosen.purpose} seeds {chosen.values}", flush=True)
    arguments.purpose = chosen.purpose
    figures = Figures()
    for number, seed in enumerate(chosen.values):
        faulty = "faults" in arguments.kinds and number < arguments.faults
        measure(figures, seed, arguments, faulty=faulty)
        if arguments.out is not None:
            report(figures, Seeds(chosen.purpose, chosen.values[: number + 1]), arguments.out)
    print(tracker_table(figures))
    print(odometry_table(figures))


if __name__ == "__main__":
    main()
