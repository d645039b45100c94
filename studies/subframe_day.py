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
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from itertools import islice, pairwise
from pathlib import Path
from typing import Any

from executive.crl import canonical_text
from ground.day.prepare import prepare_day
from ground.demo.mission import demo_mission
from ground.uplink.flight import fly
from mission import Day, Request, Target, Tracked
from planner.emit_crl import emit
from planner.problem import problem_to_dict
from planner.solve import solve
from rover_iface.profile import RoverProfile, load_profile
from rover_iface.simulator.subframe_rover import make_rover
from rover_iface.simulator.truth import TrackRecord
from rover_iface.terrain import Terrain, generate_terrain
from studies.common.day_fates import fate_table, fates
from studies.common.pages import write_section
from studies.common.plain_choice import plain_targets

TARGETS = 5
WORLD_ERROR = {"unmapped_rocks_per_m2": 0.01, "softer": 1.2}


def fly_day(seed: int, out: Path, targets: int = TARGETS) -> dict[str, Any]:
    """Return what the day came to; the run's folder is `out`."""
    spent: dict[str, tuple[float, float]] = {}

    @contextmanager
    def stage(name: str) -> Iterator[None]:
        wall, cpu = time.perf_counter(), time.process_time()
        yield
        spent[name] = (time.perf_counter() - wall, time.process_time() - cpu)

    with stage("terrain"):
        terrain = generate_terrain(seed)
    profile = load_profile("k9")
    with stage("targets, observation points, paths"):
        mission = demo_mission(terrain, profile, seed=seed)
        chosen = visible_targets(terrain, profile, mission, targets, seed)
        requests = tuple(Request(f"R{k + 1}", t.id, "mi", 20.0, (Tracked(),)) for k, t in enumerate(chosen))
        limits = replace(mission.limits, time_s=8 * 3600.0, energy_j=3_000_000.0)
        asked = replace(mission, limits=limits, targets=chosen, requests=requests)
        day = prepare_day(terrain, profile, asked)
    with stage("plan and CRL"):
        problem = day.problem
        plan = solve(problem, max_branches=0, time_limit_s=20.0, seed=seed)
        crl = canonical_text(emit(problem, plan.tree, plan_id="day"))
    out.mkdir(parents=True, exist_ok=True)
    (out / "plan.crl").write_text(crl, encoding="utf-8")
    world = {
        "format": "world/1",
        "name": mission.name,
        "problem": problem_to_dict(problem),
        "map_error": WORLD_ERROR,
        "battery_j": 4_000_000,
    }
    (out / "world.json").write_text(json.dumps(world, indent=1) + "\n", encoding="utf-8")
    with stage("world of the rover: unmapped rocks, scene"):
        rover = make_rover(world, terrain=terrain, seed=seed, out=out)
        triangles = rover.body.renderer.scene.triangle_count
    with stage("the day under the executive"):
        flight = fly(crl, rover, out, run_id="day", about={"rover": "subframe", "seed": seed}, sync=False)
    true = [pose for _, pose, _ in rover.truth.odometry]
    rows = [json.loads(line) for line in (out / "products.jsonl").read_text("utf-8").splitlines()]
    refused = {r.target_id: r.reason for r in day.refused}
    became = fates(out, [t.id for t in chosen], refused, rover.truth.history)
    return {
        "seed": seed,
        "targets": len(chosen),
        "outcome": flight.outcome.outcome,
        "hours": (flight.outcome.end_s or 0.0) / 3600,
        "driven_m": sum(math.hypot(b.x - a.x, b.y - a.y) for a, b in pairwise(true)),
        "updates": len(rover.truth.history),
        "fates": became,
        "placed": sum(fate.placed for fate in became),
        "tracked_error_m": [r.error_m for r in rover.truth.history if r.state == "tracked"],
        "lost": sorted({r.target for r in rover.truth.history if r.state == "failed"}),
        "images": sum(row["path"].endswith(".png") for row in rows),
        "images_of_requests": sum(row["path"].endswith(".png") and "request" in row["label"] for row in rows),
        "products": len(rows),
        "triangles": triangles,
        "failures": failures(out) + not_begun(out, rover.truth.history),
        "refused": [f"{name}: {reason}" for name, reason in refused.items()],
        "wrong": [fate.target for fate in became if fate.wrong],
        "stages": spent,
    }


def failures(out: Path) -> list[str]:
    """Return task and reason of every drive and placement that failed."""
    found = []
    for line in (out / "journal.jsonl").read_text("utf-8").splitlines():
        for event in json.loads(line).get("events", ()):
            if event["e"] == "result" and not event["success"]:
                reason = event["reason"].split("; ")[0]
                found.append(f"{event['command'][1]}: {reason}")
    return found


def not_begun(out: Path, history: Sequence[TrackRecord]) -> list[str]:
    """Return each drive to a target that never began, with what the tracker last said of the target.

    `history` is every answer of the tracker, in time.
    """
    found = []
    for record in (json.loads(line) for line in (out / "trace.jsonl").read_text("utf-8").splitlines()):
        if record[1] != "end" or record[3:] != ["FAILED", "start-condition"]:
            continue
        task, _, target = str(record[2]).partition("-")
        if task != "navigate":
            continue
        last = next((r for r in reversed(history) if r.target == target and r.t_s <= record[0]), None)
        why = "never tracked"
        if last is not None:
            why = f"{last.state} {last.range_m:.1f} m away" + "".join(f", {r}" for r in last.reasons[:1])
        found.append(f"{record[2]}: not begun, {target} {why}")
    return found


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
                f"{processor_s(r):.0f} s",
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


def processor_s(result: dict[str, Any]) -> float:
    """Return what a day took of a processor, s, terrain and planning included."""
    return float(sum(cpu for _, cpu in result["stages"].values()))


def visible_targets(
    terrain: Terrain, profile: RoverProfile, mission: Day, count: int, seed: int
) -> tuple[Target, ...]:
    """Return the first `count` targets of the plain rule, fewer where fewer are in sight."""
    return tuple(islice(plain_targets(terrain, profile, mission, seed), count))


def table(result: dict[str, Any]) -> str:
    """Return the day as a Markdown table."""
    rows = [
        (f"{result['targets']} tracked targets, seed {result['seed']}", "wall s", "CPU s"),
        ("---", "---", "---"),
        *((name, f"{wall:.1f}", f"{cpu:.1f}") for name, (wall, cpu) in result["stages"].items()),
        (
            "**all**",
            f"**{sum(w for w, _ in result['stages'].values()):.0f}**",
            f"**{processor_s(result):.0f}**",
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
            print(f"seed {seed}: {day['placed']} placed, {processor_s(day):.0f} s of a processor", flush=True)
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
