"""Random 20-m traverses through rocks: collisions, arrivals, map updates (docs/results/simulator.md).

    .venv/bin/python -m studies.traverses --runs 500 --seed 1 --out docs

About 1.2 CPU seconds a drive. Every drive that did not arrive is printed as it ends.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np

from rover_iface.profile import load_profile
from rover_iface.simulator.traverse import Traverse
from studies.common.pages import write_section
from studies.common.random_drives import counted, random_traverses


def table(found: list[Traverse], seed: int) -> str:
    """Return the table of the drives in Markdown."""
    study = counted(found)
    updates = 1000.0 * np.array([run.update_s for run in found])
    rows = [
        (f"{study.runs} drives, seed {seed}", ""),
        ("---", "---"),
        ("arrived", f"{study.arrived} ({100 * study.arrived / study.runs:.1f} %)"),
        ("collisions", str(study.collided)),
        *((f"ended: {why}", str(n)) for why, n in sorted(study.reasons.items()) if why != "arrived"),
        (
            "map update of four pairs with registration, CPU",
            f"median {np.median(updates):.1f} ms, worst drive {updates.max():.1f} ms",
        ),
        ("looks", f"{study.looks_median:.0f} (median)"),
        ("way driven", f"{study.length_ratio_median:.2f} of the straight line"),
        ("dead reckoning off in the end", f"{100 * study.drift_m_median:.0f} cm (median)"),
        ("place on the map off in the end", f"{100 * study.map_m_median:.0f} cm (median)"),
        ("least clearance under the belly", f"{100 * min(run.worst_gap_m for run in found):.1f} cm"),
    ]
    return "\n".join(f"| {a} | {b} |" for a, b in rows)


def main() -> None:
    """Drive, report, and with --out put the table into the page."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--runs", type=int, default=500)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--rover", default="k9")
    parser.add_argument("--out", type=Path, help="docs folder whose results/simulator.md gets the table")
    arguments = parser.parse_args()
    profile = load_profile(arguments.rover)
    for _ in random_traverses(profile, runs=1, seed=arguments.seed + 1):
        pass  # compiles the kernels, where they are not yet
    started = time.process_time()
    found: list[Traverse] = []
    for run in random_traverses(profile, runs=arguments.runs, seed=arguments.seed):
        found.append(run)
        if not run.arrived:
            print(
                f"drive {len(found)}: {run.reason}; {run.looks} looks, map {run.map_m:.2f} m off", flush=True
            )
        if len(found) % 10 == 0:
            print(f"{len(found)} drives, {time.process_time() - started:.0f} CPU s", flush=True)
    text = table(found, arguments.seed)
    print(text)
    if arguments.out is not None:
        write_section(arguments.out, "simulator", "traverses", text)


if __name__ == "__main__":
    main()
