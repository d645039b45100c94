"""Vector pictures of the guides, and the figures of their running example.

    .venv/bin/python -m studies.docs_pictures --out docs        half a minute of one core

Writes `docs/img/*.svg` and the table of `docs/results/three-rocks.md`. The plans are made by the planner from
`examples/first_plan/three-rocks.json`, the coverage is what `studies.perception` kept in `studies/results`.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING, Any

import grimp
import matplotlib.pyplot as plt
from matplotlib.patches import FancyBboxPatch

from planner.plan_tree import plan_tree_to_dict
from planner.problem import load_problem
from planner.solve import solve
from studies.common.drawing import BLUE, GREY, INK, ORANGE, PAPER, save
from studies.common.pages import table, write_section

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from planner.problem import Problem
    from planner.solve import PlanResult

ROOT = Path(__file__).resolve().parents[1]
PROBLEM = ROOT / "examples" / "first_plan" / "three-rocks.json"
TINTS = {
    "ground": "#fff3e0",
    "planner": "#e3f2fd",
    "rover": "#e8f5e9",
    "executive": "#f3e5f5",
    "plain": "#eceff1",
}
MOST = 4
"""Branches of the largest plan: those of the first tutorial."""


def main() -> None:
    """Draw all pictures; with --out into the docs."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--out", type=Path, default=Path("docs"))
    docs = parser.parse_args().out
    problem = load_problem(PROBLEM)
    results = [solve(problem, max_branches=count, time_limit_s=20) for count in range(MOST + 1)]
    images = docs / "img"
    architecture(images / "architecture.svg")
    rooms(images / "rooms.svg")
    day(images / "day-in-the-life.svg")
    growing(problem, [results[k] for k in (0, 2, MOST)], images / "plan-growing.svg")
    closing(results, images / "certificate-closing.svg")
    coverage(images / "confidence-against-truth.svg")
    write_section(docs, "three-rocks", "values", figures(results))
    write_section(docs, "three-rocks", "made", machine())


def machine() -> str:
    """Return one line with machine and commit."""
    commit = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.strip()
    return (
        f"Made on {platform.system()} {platform.machine()}, {os.cpu_count()} cores, from commit `{commit}`."
    )


def figures(results: list[PlanResult]) -> str:
    """Return the table of what plans with ever more branches earn."""
    rows = [
        [str(r.branches), f"{r.expected_utility:.2f}", f"{r.lower:.2f}", f"{r.upper:.2f}"] for r in results
    ]
    return table(["branches", "expected utility", "lower", "upper"], rows)


def canvas(width: float, height: float) -> Axes:
    """Return axes without frame, in units of a tenth of an inch."""
    axes: Axes = plt.subplots(figsize=(width / 10, height / 10))[1]
    axes.set_xlim(0, width)
    axes.set_ylim(0, height)
    axes.axis("off")
    return axes


def box(axes: Axes, at: tuple[float, float], size: tuple[float, float], text: str, tint: str) -> None:
    """Draw a box with a heading in its first line, and smaller text below."""
    (x, y), (w, h) = at, size
    shape = FancyBboxPatch(at, w, h, boxstyle="round,pad=0.2,rounding_size=1", fc=TINTS[tint], ec=INK, lw=0.8)
    axes.add_patch(shape)
    head, _, rest = text.partition("\n")
    middle = y + h / 2
    axes.text(
        x + w / 2,
        middle + (h * 0.2 if rest else 0),
        head,
        ha="center",
        va="center",
        fontsize=9,
        color=INK,
        weight="bold",
    )
    if rest:
        axes.text(x + w / 2, middle - h * 0.16, rest, ha="center", va="center", fontsize=7, color=INK)


def arrow(axes: Axes, start: tuple[float, float], end: tuple[float, float], text: str = "") -> None:
    """Draw an arrow with a small text at its middle."""
    axes.annotate("", end, start, arrowprops={"arrowstyle": "-|>", "color": INK, "lw": 0.9}, zorder=0)
    if text:
        middle = ((start[0] + end[0]) / 2, (start[1] + end[1]) / 2)
        axes.text(
            *middle,
            text,
            ha="center",
            va="center",
            fontsize=7,
            color=INK,
            bbox={"fc": PAPER, "ec": "none", "pad": 1},
        )


def architecture(path: Path) -> None:
    """Draw who makes what for whom: page, ground, planner, executive and rover."""
    axes = canvas(104, 40)
    box(axes, (2, 28), (24, 10), "Page\ntargets, requests, review", "plain")
    box(axes, (40, 28), (24, 10), "Ground\nrepository, jobs, REST,\nhistory", "ground")
    box(axes, (78, 28), (24, 10), "Planner\nproblem in,\ncontingent plan out", "planner")
    box(axes, (2, 8), (24, 10), "Two people\neach with a key\nof their own", "plain")
    box(axes, (40, 8), (24, 10), "Executive\nruns CRL,\nkeeps a journal", "executive")
    box(axes, (78, 8), (24, 10), "Rover\nsimulated or real,\nbehind one port", "rover")
    arrow(axes, (26.5, 35), (39.5, 35), "REST")
    arrow(axes, (39.5, 31), (26.5, 31), "events")
    arrow(axes, (64.5, 35), (77.5, 35), "problem")
    arrow(axes, (77.5, 31), (64.5, 31), "plan")
    arrow(axes, (14, 27.5), (14, 18.5), "plan to approve")
    arrow(axes, (26.5, 17), (41, 27.5), "signatures")
    arrow(axes, (52, 27.5), (52, 18.5), "signed package")
    arrow(axes, (64.5, 15), (77.5, 15), "commands")
    arrow(axes, (77.5, 11), (64.5, 11), "events")
    arrow(axes, (79, 18.5), (63, 27.5), "data products")
    remark = "The planner and the rover share no code: a dry run is a second opinion on the plan."
    axes.text(52, 3, remark, ha="center", fontsize=8, color=INK, style="italic")
    save(path)


ROOMS = {
    "ground": ((30, 34), (50, 9), "repository, use cases, jobs, REST, command", "ground"),
    "neighbours": ((2, 20), (24, 9), "forms of other tools", "plain"),
    "rover_iface": ((30, 20), (24, 9), "the rover, here simulated", "rover"),
    "planner": ((58, 20), (22, 9), "problem in,\ncontingent plan out", "planner"),
    "web": ((84, 34), (18, 9), "the page", "plain"),
    "executive": ((16, 4), (30, 9), "CRL, engine, runtime, journal", "executive"),
    "mission": ((56, 4), (30, 9), "frozen values of a day", "plain"),
}


def rooms(path: Path) -> None:
    """Draw the rooms and which of them imports which, as the code has it."""
    graph = grimp.build_graph(*ROOMS)
    axes = canvas(104, 46)
    for room, (at, size, text, tint) in ROOMS.items():
        box(axes, at, size, f"{room}\n{text}", tint)
        others = [
            o
            for o in ROOMS
            if o != room and graph.direct_import_exists(importer=room, imported=o, as_packages=True)
        ]
        for number, other in enumerate(sorted(others, key=lambda o: ROOMS[o][0][0])):
            (x, y), (w, _) = at, size
            (to_x, to_y), (to_w, to_h) = ROOMS[other][:2]
            share = (number + 1) / (len(others) + 1)
            if to_y == y:  # beside it
                right = to_x > x
                arrow(
                    axes,
                    (x + w + 0.4 if right else x - 0.4, y + 4.5),
                    (to_x - 0.4 if right else to_x + to_w + 0.4, y + 4.5),
                )
            else:
                there = to_x + to_w * min(0.9, max(0.1, (x + w * share - to_x) / to_w))
                arrow(axes, (x + w * share, y - 0.4), (there, to_y + to_h + 0.4))
    save(path)


def day(path: Path) -> None:
    """Draw a day from terrain to data product and back to the request."""
    axes = canvas(100, 30)
    steps = [
        ("Terrain\ntargets, requests", "ground"),
        ("Odds\nstands, drives", "planner"),
        ("Plan\nmain line, branches", "planner"),
        ("Dry run\nsecond opinion", "rover"),
        ("Approval\ntwo signatures", "ground"),
        ("Sol\nexecutive, rover", "executive"),
        ("Products\nback to requests", "ground"),
    ]
    width, gap = 12.2, 2.0
    for k, (text, tint) in enumerate(steps):
        x = 1 + k * (width + gap)
        box(axes, (x, 16), (width, 9), text, tint)
        if k:
            arrow(axes, (x - gap - 0.1, 20.5), (x - 0.1, 20.5))
    axes.plot([93, 93, 7, 7], [15.6, 9, 9, 12], color=INK, lw=0.9)
    arrow(axes, (7, 11), (7, 15.6))
    axes.text(
        50,
        10.2,
        "the next sol begins where the rover stands, with the requests that are left",
        ha="center",
        fontsize=8,
        color=INK,
    )
    save(path)


def growing(problem: Problem, results: list[PlanResult], path: Path) -> None:
    """Draw plan trees with ever more branches; the main line runs to the right, options go down."""
    axes = canvas(107, 17 * len(results) + 2)
    for k, result in enumerate(results):
        top = 17 * (len(results) - k)
        count = f"{result.branches} branches" if result.branches else "no branch"
        axes.text(
            1,
            top,
            f"{count}: expected utility {result.expected_utility:.2f}",
            fontsize=9,
            color=INK,
            weight="bold",
        )
        axes.plot([3, 3], [top - 4.6, top - 5.4], color=BLUE)
        document = plan_tree_to_dict(result.tree, problem)
        steps_of(axes, document["plan"], 3, top - 5, BLUE)
    save(path)


def steps_of(axes: Axes, steps: list[dict[str, Any]], x: float, y: float, color: str) -> None:
    """Draw the steps of a plan from a place on, and the options that leave it."""
    for step in steps:
        if step["op"] == "track_start":
            continue
        if step["op"] == "branch":
            for number, option in enumerate(step["options"]):
                low = y - 6 - 3.5 * number - (3 if option["plan"] else 0)
                axes.plot([x, x + 2], [y, low], color=ORANGE, lw=1.2)
                axes.text(
                    x + 2.8,
                    low + (4.6 if option["plan"] else 1.6),
                    when(option),
                    fontsize=6,
                    color=ORANGE,
                    va="center",
                )
                if option["plan"]:
                    steps_of(axes, option["plan"], x + 2, low, ORANGE)
                else:
                    axes.plot([x + 2], [low], "s", color=ORANGE, ms=4)
            continue
        drives = step["op"] == "navigate"
        length = 17 if drives else 16
        axes.plot([x, x + length], [y, y], color=color, lw=2.4 if not drives else 1.2)
        axes.plot([x + length], [y], "o", color=color, ms=4)
        text = f"to {step['to']}" if drives else f"observe {step['observation']}"
        axes.text(x + length / 2, y + 1.5, text, fontsize=6, color=INK, ha="center")
        x += length


def when(option: dict[str, Any]) -> str:
    """Return the condition and the odds of an option in short."""
    parts = []
    for test in option["when"]:
        if test["var"] == "time_s":
            parts.append(
                f"from {test['ge'] / 60:.0f} min" if "ge" in test else f"before {test['lt'] / 60:.0f} min"
            )
        else:
            parts.append(str(test["var"]))
    odds = f"{100 * option['p_taken']:.1f} % of days"
    return f"{' and '.join(parts)}{'' if option['plan'] else ': stop'}\n{odds}"


def closing(results: list[PlanResult], path: Path) -> None:
    """Draw the interval between what a plan earns and what any could, by number of branches."""
    _, axes = plt.subplots(figsize=(6, 3.4))
    counts = [r.branches for r in results]
    upper = min(r.upper for r in results)
    lower = [r.lower for r in results]
    axes.fill_between(counts, lower, upper, color="#ffe0b2", lw=0, label="left to win at most")
    axes.plot(counts, lower, "o-", color=BLUE, label="lower: this plan, on fresh futures")
    axes.axhline(upper, color=ORANGE, label="upper: no policy earns more")
    axes.set_xticks(counts)
    axes.set_xlabel("branches")
    axes.set_ylabel("utility")
    axes.set_ylim(min(lower) - 0.6, upper + 0.6)
    axes.legend(frameon=False, fontsize=8, loc="lower right")
    axes.spines[["top", "right"]].set_visible(False)
    save(path)


def coverage(path: Path) -> None:
    """Draw the share of true places inside the told 95 % ellipsoid, by range; from `studies.perception`."""
    kept = json.loads((ROOT / "studies" / "results" / "perception.json").read_text(encoding="utf-8"))
    found = kept["approach"]["table"]
    _, axes = plt.subplots(figsize=(6, 3.4))
    methods = [("shipped", BLUE), ("published", GREY)]
    for name, color in methods:
        rows = found[name]["by_range"]
        shares = [r["covered_percent"] for r in rows]
        axes.plot(range(len(rows)), shares, "o-", color=color, label=f"feature tracker, {name}")
        axes.set_xticks(range(len(rows)), [f"{r['range_m'][0]:g} to {r['range_m'][1]:g} m" for r in rows])
    axes.axhline(95, color=ORANGE, lw=1.2)
    axes.text(0, 95.4, "told: 95 %", fontsize=8, color=ORANGE)
    axes.set_ylim(80, 104)
    axes.set_ylabel("true place inside, %")
    axes.set_xlabel("range to the target")
    axes.legend(frameon=False, fontsize=8, loc="upper center", ncols=2, bbox_to_anchor=(0.5, 1.14))
    axes.spines[["top", "right"]].set_visible(False)
    save(path)


if __name__ == "__main__":
    main()
