"""Random traverses: collisions, arrivals, map updates (docs/results/simulator.md).

    .venv/bin/python -m studies.traverses --runs 500 --out docs
    .venv/bin/python -m studies.traverses --ground site --runs 200 --out docs

`rocks` is fractal ground with 5 to 10 % of rocks, drives of 20 m; `site` is generated terrain with crater,
ripples and ledges, drives of 7 to 13 m. About 1.2 CPU seconds a drive, and 7 for each site. The seed is drawn
where none is given, and printed. Every drive that did not arrive is printed as it ends.
"""

from __future__ import annotations

import argparse
import secrets
import time
from pathlib import Path

import numpy as np

from rover_iface.profile import load_profile
from rover_iface.simulator.traverse import Traverse
from studies.common.pages import write_section
from studies.common.random_drives import counted, random_traverses, site_traverses

LENGTH_M = 20.0


def table(found: list[Traverse], seed: int, length_m: float) -> str:
    """Return the table of the drives, `length_m` long or (0) as they tell, in Markdown."""
    study = counted(found, length_m)
    updates = 1000.0 * np.array([run.update_s for run in found])
    rows = [
        (f"{study.runs} drives, seed {seed}", ""),
        ("---", "---"),
        ("arrived", f"{study.arrived} ({100 * study.arrived / study.runs:.1f} %)"),
        ("ended more than 1 m from the goal", str(sum(run.error_m > 1.0 for run in found))),
        ("collisions", str(study.collided)),
        *((f"ended: {why}", str(n)) for why, n in sorted(study.reasons.items()) if why != "arrived"),
        (
            "map update of four pairs with registration, CPU",
            f"median {np.median(updates):.1f} ms, worst drive {updates.max():.1f} ms",
        ),
        ("looks", f"{study.looks_median:.0f} (median)"),
        ("distance driven", f"{study.length_ratio_median:.2f} of the straight line"),
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
    parser.add_argument("--seed", type=int)
    parser.add_argument("--ground", choices=("rocks", "site"), default="rocks")
    parser.add_argument("--rover", default="k9")
    parser.add_argument("--out", type=Path, help="docs folder whose results/simulator.md gets the table")
    arguments = parser.parse_args()
    seed = secrets.randbelow(10**6) if arguments.seed is None else arguments.seed
    print(f"seed {seed}", flush=True)
    profile = load_profile(arguments.rover)
    for _ in random_traverses(profile, runs=1, seed=seed + 1):
        pass  # compiles the kernels, where they are not yet
    started = time.process_time()
    found: list[Traverse] = []
    site = arguments.ground == "site"
    drives = (site_traverses if site else random_traverses)(profile, runs=arguments.runs, seed=seed)
    for run in drives:
        found.append(run)
        if not run.arrived:
            print(
                f"drive {len(found)}: {run.reason}; {run.error_m:.1f} m off, {run.looks} looks",
                flush=True,
            )
        if len(found) % 10 == 0:
            print(f"{len(found)} drives, {time.process_time() - started:.0f} CPU s", flush=True)
    text = table(found, seed, 0.0 if site else LENGTH_M)
    print(text)
    if arguments.out is not None:
        write_section(arguments.out, "simulator", "site-traverses" if site else "traverses", text)


if __name__ == "__main__":
    main()
