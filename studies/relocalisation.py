"""Relocalisation on a map from 10 m and 10 degrees: tables of docs/results/localization.md.

::

    python -m studies.relocalisation --places 100 --folder var/relocalisation      # 25 CPU minutes
    python -m studies.relocalisation --places 3 --rendered 1 --folder var/short    # a short look

A place is a ground (every other one a real one of `--real`, if it is there) with an orbital map and one of
two earlier stops of the rover. On each map there are ten trials: seven stops that lie on it, two beyond the
reach and one of another ground, which must be refused. All of it is drawn from one seed, which is printed.
Each trial is one line of `trials_SEED.jsonl`; a run that is started again with its seed goes on after the
last whole place.
"""

from __future__ import annotations

import argparse
import json
import math
import secrets
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_iface.localization.relief_map import ReliefMap, relief_map_of_views
from rover_iface.localization.relocalisation import Relocalisation, relocalise
from rover_iface.localization.stop_relief import StopView
from rover_iface.simulator.render.renderer import Sun
from rover_iface.terrain import load_terrain
from studies.common.pages import write_section
from studies.common.relocalisation_worlds import (
    Believed,
    Ground,
    OrbitalMap,
    believed,
    generated_ground,
    modelled_view,
    orbital_map,
    real_ground,
    rendered_view,
)

ROOT = Path(__file__).resolve().parent.parent
REAL = ROOT.parent / "shared" / "data" / "terrain" / "msl_onsight"
FALSE_M = 1.0
"""An accepted pose further off is a false lock."""
ON_IT, BEYOND = 7, 2
"""Of the trials on each map: stops that lie on it, and stops further off than the search goes."""


def drawn_sun(rng: np.random.Generator) -> Sun:
    """Return a sun anywhere from 20 to 70 degrees high."""
    return Sun.from_angles(float(rng.uniform(0.0, math.tau)), math.radians(float(rng.uniform(20.0, 70.0))))


def judged(
    kind: str, ground: Ground, grid: ReliefMap, stop: Believed, made_s: float, *, negative: bool = False
) -> dict[str, Any]:
    """Return what came of one trial, `made_s` being the processor time that the stop took to be made."""
    began = time.process_time()
    result = relocalise(grid, stop.view)
    spent = time.process_time() - began
    entry: dict[str, Any] = {
        "kind": kind,
        "ground": ground.name,
        "negative": negative,
        "accepted": result.accepted,
        "faults": [refusal.fault.value for refusal in result.refusals],
        "evidence": round(result.evidence, 1),
        "cpu_s": round(spent, 3),
        "made_s": round(made_s, 3),
    }
    return entry | _errors(result, stop.truth)


def _errors(result: Relocalisation, truth: npt.NDArray[np.float64]) -> dict[str, Any]:
    if result.found is None:
        return {}
    found = result.found
    off = np.array([found.east_m, found.north_m, found.up_m, found.turn_rad]) - truth
    flat = found.covariance[:2, :2]
    return {
        "error_m": float(np.hypot(*off[:2])),
        "up_m": float(off[2]),
        "turn_rad": float(off[3]),
        "sigma_m": math.sqrt(float(np.linalg.eigvalsh(flat)[-1])),
        "sigmas": math.sqrt(float(off[:2] @ np.linalg.solve(flat, off[:2]))),
        "nees": float(off @ np.linalg.solve(found.covariance, off)),
    }


def trials_of(
    ground: Ground, other: StopView | None, rng: np.random.Generator
) -> tuple[list[dict[str, Any]], StopView]:
    """Return the trials of one place, and a view from it that a later place takes for one of its own."""
    entries: list[dict[str, Any]] = []
    posts = float(rng.choice([0.5, 1.0]))
    maps = [orbital_map(ground, OrbitalMap(posts), drawn_sun(rng), rng)]
    names = [f"orbital, {posts:g} m posts", "earlier stops"]
    first = ground.place(rng)
    turn = float(rng.uniform(0.0, math.tau))
    second = ground.eye_at(first[:2] + rng.uniform(8.0, 14.0) * np.array([math.cos(turn), math.sin(turn)]))
    sun = drawn_sun(rng)
    maps.append(relief_map_of_views([modelled_view(ground, eye, sun, rng) for eye in (first, second)]))
    view = None
    for name, grid in zip(names, maps, strict=True):
        for number in range(ON_IT + BEYOND + 1):
            began = time.process_time()
            if number < ON_IT + BEYOND:
                eye = ground.place(rng) if name != names[1] else ground.near(first, 12.0, rng)
                view = modelled_view(ground, eye, drawn_sun(rng), rng)
            else:
                view = other  # the last of each map is of another ground
            if view is None:
                continue
            shift = None
            if ON_IT <= number < ON_IT + BEYOND:
                turn, away = float(rng.uniform(0.0, math.tau)), float(rng.uniform(18.0, 26.0))
                shift = (away * math.cos(turn), away * math.sin(turn))
            stop = believed(_moved_to(view, eye), rng, shift_m=shift)
            made = time.process_time() - began
            entries.append(judged(name, ground, grid, stop, made, negative=number >= ON_IT))
    last = modelled_view(ground, ground.place(rng), drawn_sun(rng), rng)
    return entries, last


def _moved_to(view: StopView, eye: npt.NDArray[np.float64]) -> StopView:
    """Return a view as if it had been seen from `eye` (3,): that of another ground has to lie on this one."""
    from rover_iface.localization.ground_points import GroundPoints

    seen = view.seen
    return StopView(GroundPoints(seen.points - seen.eye + eye, eye, seen.range_factor), view.brightness)


def grounds(real: Path, places: range, seed: int) -> Iterator[tuple[int, Ground]]:
    """Return a ground for each place: a real one in turn if they are there, and a generated one between."""
    names = sorted(path.name for path in real.iterdir() if path.is_dir()) if real.is_dir() else []
    kept: dict[str, Ground] = {}
    for place in places:
        if names and place % 2 == 1:
            name = names[(place // 2) % len(names)]
            if name not in kept:
                kept[name] = real_ground(load_terrain(real / name), seed % 10_000)
            yield place, kept[name]
        else:
            yield place, generated_ground(int(np.random.default_rng([seed, place]).integers(1 << 30)))


def run(places: int, folder: Path, seed: int, real: Path) -> list[dict[str, Any]]:
    """Return the entries of all places, those of an earlier run with this seed first."""
    path = folder / f"trials_{seed}.jsonl"
    entries: list[dict[str, Any]] = []
    if path.exists():
        entries = [json.loads(line) for line in path.read_text().splitlines()]
    done = 1 + max((entry["place"] for entry in entries), default=-1)
    other: StopView | None = None
    for place, ground in grounds(real, range(done, places), seed):
        found, other = trials_of(ground, other, np.random.default_rng([seed, place, 1]))
        for entry in found:
            entry["place"] = place
        with path.open("a") as file:
            file.writelines(json.dumps(entry) + "\n" for entry in found)
        entries += found
        good = sum(e["accepted"] and not e["negative"] for e in found)
        wrong = sum(is_false(e) for e in found)
        print(f"place {place} {ground.name}: {good} of {2 * ON_IT} found, {wrong} false", flush=True)
    return entries


def run_rendered(count: int, seed: int, real: Path) -> list[dict[str, Any]]:
    """Return trials whose stops are rendered navcam panoramas and their stereo."""
    entries = []
    for place, ground in grounds(real, range(count), seed + 1):
        rng = np.random.default_rng([seed, place, 2])
        grid = orbital_map(ground, OrbitalMap(1.0), drawn_sun(rng), rng)
        began = time.process_time()
        eye = ground.place(rng)
        stop = believed(rendered_view(ground, eye, drawn_sun(rng), int(rng.integers(1 << 30))), rng)
        entry = judged("rendered", ground, grid, stop, time.process_time() - began)
        entries.append(entry)
        told = entry["faults"] or f"{entry['error_m']:.3f} m"
        print(f"rendered {place} {ground.name}: {told}", flush=True)
    return entries


def is_false(entry: dict[str, Any]) -> bool:
    """Return whether a trial is a false lock."""
    return bool(entry["accepted"] and (entry["negative"] or entry["error_m"] > FALSE_M))


def figures(entries: list[dict[str, Any]]) -> dict[str, Any]:
    """Return what the tables show of some trials."""
    there = [e for e in entries if not e["negative"]]
    found = [e for e in there if e["accepted"]]
    faults: dict[str, int] = {}
    for entry in there:
        for fault in entry["faults"]:
            faults[fault] = faults.get(fault, 0) + 1
    table: dict[str, Any] = {
        "trials": len(entries),
        "there": len(there),
        "within": sum(e["error_m"] <= 0.3 for e in found),
        "refused": len(there) - len(found),
        "negatives": len(entries) - len(there),
        "negatives_refused": sum(e["negative"] and not e["accepted"] for e in entries),
        "false": sum(is_false(e) for e in entries),
        "faults": faults,
        "cpu_s": float(np.median([e["cpu_s"] for e in entries])),
        "made_s": float(np.median([e["made_s"] for e in entries])),
    }
    if found:
        table |= {
            "median_m": float(np.median([e["error_m"] for e in found])),
            "p95_m": float(np.percentile([e["error_m"] for e in found], 95)),
            "worst_m": max(e["error_m"] for e in found),
            "turn_deg": math.degrees(float(np.percentile(np.abs([e["turn_rad"] for e in found]), 95))),
            "up_m": float(np.percentile(np.abs([e["up_m"] for e in found]), 95)),
            "nees": float(np.mean([e["nees"] for e in found])),
            "beyond": sum(e["sigmas"] > 3.0 for e in found),
        }
    return table


def rows_of(entries: list[dict[str, Any]]) -> list[list[str]]:
    """Return the rows of the table: by map and ground, and all."""
    groups: dict[str, list[dict[str, Any]]] = {}
    for entry in entries:
        where = "generated" if entry["ground"].startswith("generated") else "real"
        groups.setdefault(f"{entry['kind']}; {where}", []).append(entry)
    rows = []
    for name, part in [*sorted(groups.items()), ("all", entries)]:
        f = figures(part)
        if "p95_m" not in f:
            continue
        rows.append(
            [
                name,
                str(f["there"]),
                f"{100 * f['within'] / f['there']:.1f} %",
                f"{100 * f['refused'] / f['there']:.1f} %",
                f"{f['median_m']:.3f}, {f['p95_m']:.3f}, {f['worst_m']:.2f} m",
                f"{f['turn_deg']:.2f}",
                f"{f['nees']:.1f}",
                str(f["beyond"]),
                f"{f['negatives_refused']} of {f['negatives']}",
                str(f["false"]),
            ]
        )
    return rows


HEAD = [
    "map; ground",
    "stops on it",
    "within 0.3 m",
    "refused",
    "error: median, 95 %, worst",
    "turn, 95 %, degrees",
    "mean NEES (4)",
    "beyond 3 sigma",
    "elsewhere, refused",
    "false locks",
]


def report(entries: list[dict[str, Any]], seed: int) -> str:
    """Return the section of the page."""
    table = "\n".join(
        "| " + " | ".join(cells) + " |" for cells in [HEAD, ["---"] * len(HEAD), *rows_of(entries)]
    )
    f = figures(entries)
    faults = ", ".join(f"{name} {count}" for name, count in sorted(f["faults"].items()))
    return (
        f"{table}\n\nSeed {seed}; {f['trials']} trials. Processor time, medians: {f['cpu_s']:.2f} s to "
        f"relocalise, {f['made_s']:.2f} s to make a stop. Rules that refused stops that were there: "
        f"{faults or 'none'}."
    )


def main() -> None:
    """Run the study and write its tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--places", type=int, default=100)
    parser.add_argument("--rendered", type=int, default=0)
    parser.add_argument("--folder", type=Path, default=ROOT / "var" / "relocalisation")
    parser.add_argument("--seed", type=int, default=None, help="drawn if absent")
    parser.add_argument("--real", type=Path, default=REAL, help="folder of real grounds")
    parser.add_argument("--write-docs", action="store_true", help="put the tables into docs/results")
    chosen = parser.parse_args()
    seed = secrets.randbits(31) if chosen.seed is None else chosen.seed
    print(f"seed {seed}", flush=True)
    chosen.folder.mkdir(parents=True, exist_ok=True)
    sections = {}
    if chosen.places:
        entries = run(chosen.places, chosen.folder, seed, chosen.real)
        sections["relocalisation"] = report(entries, seed)
    if chosen.rendered:
        rendered = run_rendered(chosen.rendered, seed, chosen.real)
        (chosen.folder / f"rendered_{seed}.json").write_text(json.dumps(rendered, indent=1) + "\n")
        sections["relocalisation_rendered"] = report(rendered, seed)
    for name, text in sections.items():
        print(f"\n{text}")
        if chosen.write_docs:
            write_section(ROOT / "docs", "localization", name, text)


if __name__ == "__main__":
    main()
