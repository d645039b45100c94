"""The paper's day on the `full` rover: tracked targets, one track lost on purpose, one target without stereo.

    .venv/bin/python -m studies.full_day --seed 2 --out /tmp/day [--terrain DIR] [--docs docs]
    .venv/bin/python -m studies.full_day --fresh 20 --ground both --out /tmp/days [--docs docs]

Section 8 of the single-cycle instrument placement paper: K9 drove 28 m, approached four targets and took
close-ups of three, the fourth was rejected for missing stereo; faults were injected to see the
contingency branches taken. Here five targets are picked as an operator does (`operator_choice.py`); the
downlink has room for four, so the fifth is what the plan's branches turn to when a track is lost. The plan is
emitted as CRL and flown by the executive. The track of one is made to fail on the way (`lose-target`), dust
lies on the lens of a hazard camera before another (`lens-dust`). On a real DEM (`--terrain`) rocks are strewn
first: its posts hold no detail at the scale of a tool.

Every stage is timed, wall and CPU; the bar is 6 minutes of wall time on two cores.

The second form flies days of seeds drawn now, on generated ground and on Curiosity's in turn, with targets by
the plain rule (`plain_choice`) and no faults, and judges each target by the truth (`full_days`). Seeds and
days are kept in the folder; the command goes on where it was stopped.
"""

from __future__ import annotations

import argparse
import json
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from executive.crl import canonical_text
from ground.day.prepare import PreparedDay, prepare_day
from ground.demo.day import loss_to_inject
from ground.demo.mission import bare_day
from ground.uplink.flight import fly
from mission import Day, Request, Tracked
from planner.emit_crl import emit
from planner.plan_tree import plan_tree_to_dict
from planner.problem import problem_to_dict
from planner.solve import solve
from rover_iface.behaviour.repertoire import FullRepertoire
from rover_iface.profile import RoverProfile, load_profile
from rover_iface.simulator.full_rover import make_rover
from rover_iface.simulator.hardware import designated, mast_bias
from rover_iface.simulator.subframe_rover import body_of
from rover_iface.simulator.terrain_rover import TerrainRover
from rover_iface.simulator.world import load_world
from rover_iface.terrain import Terrain, generate_terrain, load_terrain
from studies.common.day_fates import failures
from studies.common.day_grounds import strewn
from studies.common.full_days import GROUNDS, drawn_days, fly_days, report
from studies.common.operator_choice import Operator, Pick, choose
from studies.common.pages import write_section
from studies.common.plain_day import ENERGY_J, TIME_S, WORLD_ERROR, Stages, travelled, write_day

PLACEMENTS = 4
"""What the downlink of the day has room for: as many as the paper's rover approached."""
BRANCHES = 6


def fly_day(
    seed: int,
    out: Path,
    folder: Path | None = None,
    *,
    faults: bool = True,
) -> dict[str, Any]:
    """Return what the day came to; the run's folder is `out`."""
    stage = Stages()
    with stage("terrain"):
        terrain = generate_terrain(seed) if folder is None else strewn(load_terrain(folder), seed)
    profile = load_profile("k9")
    with stage("targets, observation points, paths"):
        mission = bare_day(terrain, profile, seed=seed)
        seen = Operator(terrain, profile, mission).picks()
        # each alone: ground that is rough far off may close the ways of a network over all of it
        reached = [p for p in seen if _prepared(terrain, profile, mission, [p]).problem.targets]
        picks = choose(mission.start, reached)
        picks = _designated(picks, mission, terrain, seed)
        day = _prepared(terrain, profile, mission, picks)
    with stage("plan and CRL"):
        problem, document = day.problem, problem_to_dict(day.problem)
        plan = solve(problem, max_branches=BRANCHES, time_limit_s=20.0, seed=seed)
        tree = plan_tree_to_dict(plan.tree, problem)
        crl = canonical_text(emit(problem, plan.tree, plan_id="day"))
    injected = _faults(document, tree) if faults else []
    world = write_day(out, mission.name, crl, document, injected)
    with stage("world of the rover: unmapped rocks, scene"):
        rover = make_rover(world, terrain=terrain, seed=seed, out=out)
        triangles = rover.body.renderer.scene.triangle_count
    about = {"rover": "full", "seed": seed, "faults": injected}
    with stage("the day under the executive"):
        flight = fly(crl, rover, out, run_id="day", about=about, sync=False)
    return {
        "terrain": terrain.name,
        "seed": seed,
        "faults": injected,
        "outcome": flight.outcome.outcome,
        "branches_taken": [o for o in flight.options_taken() if not o.startswith("go-on")],
        "branches": plan.branches,
        "hours": (flight.outcome.end_s or 0.0) / 3600,
        "driven_m": travelled(rover)[-1][1],
        "updates": len(rover.truth.history),
        "targets": {t.id: _target(rover, t.id, out) for t in (pick.target for pick in picks)},
        "track": [
            {"target": r.target, "confidence": r.confidence, "state": r.state, "range_m": r.range_m,
             "error_m": r.error_m, "t_s": r.t_s}
            for r in rover.truth.history
        ],
        "driven_at": [[t_s, way_m] for t_s, way_m in travelled(rover)],
        "triangles": triangles,
        "stages": stage.spent,
    }  # fmt: skip


def _prepared(terrain: Terrain, profile: RoverProfile, mission: Day, picks: Sequence[Pick]) -> PreparedDay:
    """Return the planning problem of a placement on each target, with room for four in the downlink."""
    requests = tuple(
        Request(f"R{k + 1}", p.target.id, "mi", 20.0, (Tracked(),), observation_point=p.stand)
        for k, p in enumerate(picks)
    )
    volume = PLACEMENTS * 8.0 * profile.instrument("mi").volume_mb
    limits = replace(mission.limits, time_s=TIME_S, energy_j=ENERGY_J, data_mbit=volume)
    targets = tuple(pick.target for pick in picks)
    return prepare_day(terrain, profile, replace(mission, limits=limits, targets=targets, requests=requests))


def _designated(picks: Sequence[Pick], mission: Day, terrain: Terrain, seed: int) -> tuple[Pick, ...]:
    """Return the targets where the rover's first pictures put them: the operator points at them there."""
    start = mission.start
    pose = {"east_m": start.east_m, "north_m": start.north_m, "heading_rad": start.heading_rad}
    world = load_world({"format": "world/1", "name": mission.name, "start": pose, "map_error": WORLD_ERROR})
    body = body_of(world, terrain, seed)
    bias = mast_bias(body)
    found = []
    for pick in picks:
        x, y, z = (float(v) for v in designated(body, bias, np.array(pick.target.point_site)))
        found.append(replace(pick, target=replace(pick.target, point_site=(x, y, z))))
    return tuple(found)


def _faults(problem: Mapping[str, Any], tree: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the loss of a track, and dust before the target that is visited first of the others."""
    lost = loss_to_inject(problem, tree)
    visits = [s.get("to", s.get("target")) for s in tree["plan"] if s["op"] in ("visit", "navigate")]
    others = [t for t in visits if lost is None or t != lost["target"]]
    found = [] if lost is None else [lost]
    if others:
        found.append({"kind": "lens-dust", "target": others[0], "at_s": 1.0})
    return [{name: f[name] for name in ("kind", "at_s", "target")} for f in found]


def _target(rover: TerrainRover, name: str, out: Path) -> dict[str, Any]:
    """Return what came of one target; errors in centimetres from the point under the operator's pixel."""
    own = rover.repertoire
    found: dict[str, Any] = {"handoff": {}}
    attempt = None
    if isinstance(own, FullRepertoire):
        attempt = own.placing.attempts.get(name)
        found["handoff"] = own.eyes.answers.get(name, {})
    near = [r for r in rover.truth.history if r.target == name and r.range_m < 1.5]
    if near:
        found["tracked_cm"] = 100 * near[-1].error_m
    if attempt is None:
        found["why"] = _failure(out, name) if near else "not approached"
        return found
    found["decision"] = attempt.verdict.decision.value
    found["why"] = attempt.verdict.text
    found["shift_cm"] = 100 * attempt.verdict.distance_m
    found["reason"] = None if attempt.verdict.reason is None else attempt.verdict.reason.value
    if attempt.touch is not None:
        found["contact"] = attempt.touch.made
        found["why"] += f"; {attempt.touch.reason}" if attempt.touch.reason else ""
        if attempt.touch.made:
            found["placement_cm"] = 100 * rover.truth.placement_error_m(name)
    return found


def _failure(out: Path, name: str) -> str:
    """Return why a target that was come near to has no placement: of its observation, else of its drive."""
    reasons = dict(text.split(": ", 1) for text in failures(out))
    for wanted in (f"observe-R{name[1:]}", f"navigate-{name}"):
        for task, why in reasons.items():
            if task == wanted or task.startswith(f"{wanted}-"):
                return why.replace(f"hand-off of target {name} refused", "refused")
    return "not placed on"


def table(result: Mapping[str, Any]) -> str:
    """Return the day as Markdown."""
    total = [sum(v[k] for v in result["stages"].values()) for k in (0, 1)]
    lines = [
        f"| {result['terrain']}, seed {result['seed']} | wall s | CPU s |",
        "| --- | --- | --- |",
        *(f"| {name} | {wall:.1f} | {cpu:.1f} |" for name, (wall, cpu) in result["stages"].items()),
        f"| **all** | **{total[0]:.0f}** | **{total[1]:.0f}** |",
        "",
        "| target | first seen from, m | tracked on arrival, cm off | hand-off, px | decision "
        "| placement, cm off |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    lost = {f["target"] for f in result["faults"] if f["kind"] == "lose-target"}
    dusty = {f["target"] for f in result["faults"] if f["kind"] == "lens-dust"}
    for name, found in result["targets"].items():
        note = " (track lost on purpose)" if name in lost else " (dust on the lens)" if name in dusty else ""
        hand = found["handoff"]
        px = hand.get("error_px")
        told = f"{px:.1f}" if px is not None else "refused" if hand.get("reasons") else "-"
        seen = [r["range_m"] for r in result["track"] if r["target"] == name]
        cells = (
            name + note,
            f"{seen[0]:.1f}" if seen else "-",
            _cm(found.get("tracked_cm")),
            told,
            found["why"],
            _cm(found.get("placement_cm")),
        )
        lines.append(f"| {' | '.join(cells)} |")
    placed = sorted(f["placement_cm"] for f in result["targets"].values() if "placement_cm" in f)
    middle = f"median {np.median(placed):.2f}, worst {placed[-1]:.2f} cm" if placed else "none"
    lines += [
        "",
        f"Driven {result['driven_m']:.1f} m in {result['hours']:.2f} h of plan time, {result['updates']} "
        f"updates of trackers; {len(placed)} placements ({middle}); branches taken: "
        f"{', '.join(result['branches_taken']) or 'none'} of {result['branches']} options; "
        f"the plan ended {result['outcome']}.",
    ]
    return "\n".join(lines)


def _cm(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"


def plot(result: Mapping[str, Any], path: Path) -> None:
    """Draw confidence against the distance driven for each target (Figure 24)."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    times, ways = np.array(result["driven_at"]).T
    figure, axes = plt.subplots(figsize=(8.0, 3.6), dpi=110)
    for name in result["targets"]:
        rows = [r for r in result["track"] if r["target"] == name]
        if rows:
            at = np.interp([r["t_s"] for r in rows], times, ways)
            axes.plot(at, [r["confidence"] for r in rows], marker=".", ms=4, lw=1.2, label=name)
    axes.axhline(0.5, color="0.6", lw=0.8, ls="--")
    axes.set(xlabel="distance driven, m", ylabel="confidence", ylim=(-0.03, 1.05))
    axes.legend(ncols=5, loc="lower right", fontsize=8)
    figure.tight_layout()
    figure.savefig(path)
    plt.close(figure)


def picture(result: Mapping[str, Any], out: Path) -> np.ndarray | None:
    """Return the first placement side by side, BGR (420, n, 3), None without one: what the tracker saw at the
    end of the drive, the hazcam with the decision, the close-up.
    """
    import cv2

    placed = [name for name, found in result["targets"].items() if "placement_cm" in found]
    if not placed:
        return None
    latest: dict[str, Path] = {}
    for line in (out / "products.jsonl").read_text("utf-8").splitlines():
        row = json.loads(line)
        if row["label"].get("target") == placed[0]:
            latest[row["kind"]] = out / row["path"]
    parts = [cv2.imread(str(latest[kind])) for kind in ("trackview", "placement", "microscopic")]
    return np.hstack([cv2.resize(p, (round(420 * p.shape[1] / p.shape[0]), 420)) for p in parts])


def main() -> None:
    """Fly the day, print its table; `--docs` puts table, plot and pictures into the docs."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seed", type=int, default=2)
    parser.add_argument("--terrain", type=Path)
    parser.add_argument("--no-faults", action="store_true")
    parser.add_argument("--fresh", type=int, help="fly so many days of seeds drawn now")
    parser.add_argument("--ground", choices=GROUNDS, default="both", help="of the days of fresh seeds")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--docs", type=Path)
    arguments = parser.parse_args()
    if arguments.fresh:
        days = drawn_days(arguments.out, arguments.fresh, arguments.ground)
        print("days:", ", ".join(f"{ground} {seed}" for ground, seed in days), flush=True)
        text = report(fly_days(arguments.out, days))
        print(text)
        if arguments.docs is not None:
            write_section(arguments.docs, "full-rover", "fresh", text)
        return
    result = fly_day(arguments.seed, arguments.out, arguments.terrain, faults=not arguments.no_faults)
    (arguments.out / "day.json").write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    text = table(result)
    print(text)
    plot(result, arguments.out / "confidence.png")
    if (seen := picture(result, arguments.out)) is not None:
        import cv2

        cv2.imwrite(str(arguments.out / "placement.jpg"), seen, [cv2.IMWRITE_JPEG_QUALITY, 88])
    if arguments.docs is not None:
        _document(
            arguments.docs, "generated" if arguments.terrain is None else "curiosity", text, arguments.out
        )


def _document(docs: Path, key: str, text: str, out: Path) -> None:
    write_section(docs, "full-rover", key, text)
    shutil.copy(out / "confidence.png", docs / "img" / f"full_confidence_{key}.png")
    if (out / "placement.jpg").exists():
        shutil.copy(out / "placement.jpg", docs / "img" / f"full_placement_{key}.jpg")


if __name__ == "__main__":
    main()
