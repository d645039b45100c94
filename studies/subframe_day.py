"""A day with five tracked targets, planned, emitted as CRL, flown by the executive on the `subframe` rover.

    .venv/bin/python -m studies.subframe_day --seed 1 --out /tmp/day [--docs docs]
    .venv/bin/python -m studies.subframe_day --fresh 5 --out /tmp/days [--docs docs]

Targets are any five rocks of at least 20 cm in sight, as the seed draws them (`plain_choice`). The second
form compares days of seeds drawn now: what was placed, lost and refused on each, and why; then what became of
every target, and how far off the truth has it. Every stage is timed, in wall and in CPU seconds; the bar is
60 s of a processor from terrain to products. The rover's world has rocks that the map lacks and softer soil.
For the same day with ten targets and a planner that chooses among them: `outcrop demo --rover subframe`.
"""

from __future__ import annotations

import argparse
import json
import math
import secrets
from pathlib import Path
from typing import Any

from rover_iface.terrain import generate_terrain
from studies.common.day_fates import failures, fate_table, fates, not_begun
from studies.common.pages import write_section
from studies.common.plain_day import TARGETS, fly_plain_day, processor_s


def fly_day(seed: int, out: Path, targets: int = TARGETS) -> dict[str, Any]:
    """Return what the day came to; the run's folder is `out`."""
    day = fly_plain_day("subframe", seed, out, lambda: generate_terrain(seed), targets)
    history = day.rover.truth.history
    rows = [json.loads(line) for line in (out / "products.jsonl").read_text("utf-8").splitlines()]
    refused = {r.target_id: r.reason for r in day.prepared.refused}
    became = fates(out, [t.id for t in day.targets], refused, history)
    return {
        "seed": seed,
        "targets": len(day.targets),
        "outcome": day.flight.outcome.outcome,
        "hours": (day.flight.outcome.end_s or 0.0) / 3600,
        "driven_m": day.driven_m,
        "updates": len(history),
        "fates": became,
        "placed": sum(fate.placed for fate in became),
        "tracked_error_m": [r.error_m for r in history if r.state == "tracked"],
        "lost": sorted({r.target for r in history if r.state == "failed"}),
        "images": sum(row["path"].endswith(".png") for row in rows),
        "images_of_requests": sum(row["path"].endswith(".png") and "request" in row["label"] for row in rows),
        "products": len(rows),
        "triangles": day.triangles,
        "failures": failures(out) + not_begun(out, history),
        "refused": [f"{name}: {reason}" for name, reason in refused.items()],
        "wrong": [fate.target for fate in became if fate.wrong],
        "stages": day.spent,
    }


def comparison(results: list[dict[str, Any]]) -> str:
    """Return days of several seeds as a Markdown table."""
    rows = [
        (
            "seed",
            "processor",
            "driven",
            "updates",
            "median error",
            "asked",
            "refused before the day",
            "placed",
            "claimed and wrong",
            "tracks lost",
            "what failed",
        ),
        ("---",) * 11,
    ]
    for r in results:
        errors = sorted(r["tracked_error_m"])
        rows.append(
            (
                str(r["seed"]),
                f"{processor_s(r['stages']):.0f} s",
                f"{r['driven_m']:.0f} m",
                str(r["updates"]),
                f"{100 * errors[len(errors) // 2]:.1f} cm" if errors else "-",
                str(r["targets"]),
                str(len(r["refused"])),
                str(r["placed"]),
                ", ".join(r["wrong"]) or "none",
                ", ".join(r["lost"]) or "none",
                "; ".join(r["failures"]) or "nothing",
            )
        )
    return "\n".join("| " + " | ".join(row) + " |" for row in rows)


def table(result: dict[str, Any]) -> str:
    """Return the day as a Markdown table."""
    rows = [
        (f"{result['targets']} tracked targets, seed {result['seed']}", "wall s", "CPU s"),
        ("---", "---", "---"),
        *((name, f"{wall:.1f}", f"{cpu:.1f}") for name, (wall, cpu) in result["stages"].items()),
        (
            "**all**",
            f"**{sum(w for w, _ in result['stages'].values()):.0f}**",
            f"**{processor_s(result['stages']):.0f}**",
        ),
    ]
    text = "\n".join("| " + " | ".join(row) + " |" for row in rows)
    errors = sorted(result["tracked_error_m"])
    middle, worst = (100 * errors[len(errors) // 2], 100 * errors[-1]) if errors else (math.nan, math.nan)
    return (
        f"{text}\n\nDriven {result['driven_m']:.1f} m in {result['hours']:.2f} h of plan time, "
        f"{result['updates']} updates of trackers ({middle:.1f} cm off in the median, {worst:.0f} cm at most "
        "for targets far away), "
        f"{result['placed']} of {result['targets']} placements made, lost for good: "
        f"{', '.join(result['lost']) or 'none'}; {result['products']} products, {result['images']} of them "
        f"images, {result['images_of_requests']} of those tied to their observation request."
    )


def main() -> None:
    """Fly the day or days, print the table, and with --docs put it into docs/results/simulator.md."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seeds", type=int, nargs="+", help="compare the days of these seeds")
    parser.add_argument("--fresh", type=int, help="compare the days of so many seeds, drawn now and printed")
    parser.add_argument("--targets", type=int, default=TARGETS)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--docs", type=Path)
    arguments = parser.parse_args()
    if arguments.fresh:
        first = secrets.randbelow(2**30)
        arguments.seeds = list(range(first, first + arguments.fresh))
    if arguments.seeds:
        results = []
        for seed in arguments.seeds:
            results.append(fly_day(seed, arguments.out / str(seed), arguments.targets))
            day = results[-1]
            print(
                f"seed {seed}: {day['placed']} placed, {processor_s(day['stages']):.0f} s of a processor",
                flush=True,
            )
        text, section = comparison(results), "days"
    else:
        text = table(fly_day(arguments.seed, arguments.out, arguments.targets))
        section = "day"
    print(text)
    if arguments.seeds:
        print(fate_table({r["seed"]: r["fates"] for r in results}))
    if arguments.docs is not None:
        write_section(arguments.docs, "simulator", section, text)


if __name__ == "__main__":
    main()
