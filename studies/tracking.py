"""Tables and plots of docs/results/tracking.md: what the trackers do on rendered and on real images.

    .venv/bin/python -m studies.tracking --out docs          everything
    .venv/bin/python -m studies.tracking --only steps --worlds 2

Studies follow Kim et al. 2009: steps (Figure 8), orbit (Figure 10), turn, flight (Table III and the 10 m
run), accuracy (Table I), wedges (two real Spirit frames), nominal (runs with slip and odometry error, and
losses).
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.labels import read_product
from rover_iface.cameras.rig import load_cameras
from rover_iface.cameras.stereo import triangulate
from rover_iface.vision.correlation.ncc import NccTracker
from rover_iface.vision.template import NccOptions, Template, TemplateMatcher, template_roll
from studies.common.tracking_report import PUBLISHED_1, PUBLISHED_2, write_report
from studies.common.tracking_worlds import (
    PIVOT,
    Array,
    Disturbance,
    NavigationErrors,
    choose_targets,
    closed_loop,
    designate,
    every,
    flight_checkout_1,
    make_world,
    orbit,
    point_on,
    straight_approach,
    track,
    turn_in_place,
)

Say = Callable[[str], None]
SHARED = Path(__file__).resolve().parents[1].parent / "shared"
SEARCHED: dict[str, NccOptions] = {
    "as flown, +-100 px": replace(NccOptions.as_flown(), search_px=100),
    "as flown, +-300 px": replace(NccOptions.as_flown(), search_px=300),
    "shipped, +-100 px": NccOptions(search_px=100),
    "shipped, +-300 px": NccOptions(search_px=300),
}

CONFIGURATIONS: dict[str, NccOptions] = {
    "plain NCC": NccOptions.as_flown("none"),
    "NCC + scale": NccOptions.as_flown("scale"),
    "NCC + scale + roll (as flown)": NccOptions.as_flown("similarity"),
    "+ plane": NccOptions.as_flown("plane"),
    "shipped": NccOptions(),
}


def step_study(worlds: list[int], targets: int, say: Say) -> Iterator[dict[str, Any]]:
    """Yield success and end error against step size for each configuration (Figure 8), after each world."""
    skips = (1, 2, 3, 4, 5, 7)
    compared = {name: options for name, options in CONFIGURATIONS.items() if name != "+ plane"}
    ends: dict[str, dict[int, list[float]]] = {n: {s: [] for s in skips} for n in compared}
    total = 0
    for done, seed in enumerate(worlds, 1):
        started = time.perf_counter()
        world = make_world(seed)
        stops = straight_approach(world)
        chosen = choose_targets(stops, world, targets)
        total += len(chosen)
        for name, options in compared.items():
            for skip in skips:
                for pixel, point in chosen:
                    ends[name][skip].append(track(every(stops, skip), pixel, point, options).end_px)
        say(
            f"  world {seed}: {len(chosen)} targets, {time.perf_counter() - started:.0f} s; shipped "
            + " ".join(
                f"{100 * np.mean(np.array(ends['shipped'][s][-len(chosen) :]) < 15):.0f}"
                for s in skips
                if chosen
            )
        )
        table = {
            name: {f"{100 * (1 - 0.95**skip):.1f}": _summary(v) for skip, v in by_skip.items()}
            for name, by_skip in ends.items()
        }
        yield {"targets": total, "worlds": done, "table": table}


def orbit_study(worlds: list[int], targets: int, say: Say) -> dict[str, Any]:
    """Return success against the azimuth step of a crab run round the target (Figure 10)."""
    ends: dict[str, dict[int, list[float]]] = {n: {k: [] for k in (1, 2, 3)} for n in SEARCHED}
    for seed in worlds:
        world = make_world(seed)
        stops = orbit(world)
        chosen = choose_targets(stops, world, targets, seen_from_all=True)
        for name, options in SEARCHED.items():
            for skip, found in ends[name].items():
                found += [track(every(stops, skip), px, pt, options).end_px for px, pt in chosen]
        say(f"  orbit, world {seed}: {len(chosen)} targets")
    return {
        "targets": len(ends["shipped, +-100 px"][1]),
        "table": {n: {str(5 * k): _summary(v) for k, v in by.items()} for n, by in ends.items()},
    }


def turn_study(worlds: list[int], targets: int, say: Say) -> dict[str, Any]:
    """Return success against the step of a turn in place, to 45 degrees."""
    chosen_options = {"as flown": NccOptions.as_flown(), "shipped": NccOptions()}
    ends: dict[str, dict[int, list[float]]] = {n: {k: [] for k in (1, 2, 3, 6, 9)} for n in chosen_options}
    for seed in worlds:
        world = make_world(seed)
        stops = turn_in_place(world)
        chosen = choose_targets(stops, world, targets)
        for name, options in chosen_options.items():
            for skip, found in ends[name].items():
                found += [track(every(stops, skip), px, pt, options).end_px for px, pt in chosen]
        say(f"  turn, world {seed}: {len(chosen)} targets")
    return {
        "targets": len(ends["shipped"][1]),
        "table": {n: {str(5 * k): _summary(v) for k, v in by.items()} for n, by in ends.items()},
    }


def _summary(ends: list[float]) -> dict[str, float | None]:
    values = np.array(ends)
    kept = values[values < 15.0]
    return {
        "percent": 100.0 * float(np.mean(values < 15.0)) if len(values) else None,
        "median_px": float(np.median(kept)) if len(kept) else None,
    }


def flight_study(runs: int, say: Say) -> dict[str, Any]:
    """Replay the two flight checkouts: Table III, and the run from 9.65 m to 1.92 m."""
    return {"checkout_1": _first_checkout(say), "checkout_2": _second_checkout(runs, say)}


def _first_checkout(say: Say) -> dict[str, Any]:
    world = make_world(5, preset="mer", largest_m=0.12, target_m=0.12)
    stops, fitted = flight_checkout_1(world, PUBLISHED_1["azimuth_deg"], PUBLISHED_1["magnification"])
    azimuths = np.unwrap([_azimuth(stop.true_left.C) for stop in stops])
    look = np.array([0.0, 0.0, world.rock.z + 0.5 * world.rock.height])
    rows: dict[str, dict[str, list[float]]] = {}
    for name, options in {"as flown": NccOptions.as_flown(), "shipped": NccOptions()}.items():
        tracker = NccTracker(options)
        point = point_on(world, stops[0].true_left.C, look)
        tracker.start("t", None, stops[0].view, pixel=stops[0].true_left.project(point))
        updates = [tracker.update("t", stop.view) for stop in stops[1:]]
        rows[name] = {
            "magnification": [u.scores["scale"] for u in updates],
            "roll_deg": [abs(float(np.degrees(u.scores["roll_rad"]))) for u in updates],
            "ncc": [u.scores.get("ncc", 0.0) for u in updates],
            "error_px": [
                float(np.hypot(*(u.pixel - s.true_left.project(point))))
                for u, s in zip(updates, stops[1:], strict=True)
            ],
        }
    say("  flight checkout 1 replayed")
    turned = [float(v) for v in np.degrees(np.abs(np.diff(azimuths)))]
    return {"fitted": {**fitted, "azimuth_deg": turned}, "rows": rows}


FIRST_M, LAST_M, STEPS_2 = 9.65, 1.92, 15


def second_checkout_errors(focal_px: float, baseline_m: float) -> dict[str, float]:
    """Return the errors that the second flight checkout must have had, from what the paper says of it.

    Section 7.2: 36 cm between the first and the last position of the target, 11 px the largest correction
    at a stop, a pose estimate from wheels and inertial unit on flat ground; eq. 3 takes 2 % of the distance
    for its error. What the pose does not explain of the 36 cm is range error of the first pair (eq. 1).
    """
    way = FIRST_M - LAST_M
    share = (LAST_M / FIRST_M) ** (1.0 / STEPS_2)
    ranges = FIRST_M * share ** np.arange(STEPS_2)
    steps = ranges * (1.0 - share)
    mast_px = math.sqrt(2.0) * math.radians(0.07) * focal_px
    odometry_px = PUBLISHED_2["odometry"] * (1.0 - share) * focal_px
    # the largest of n two-dimensional normal errors is about sqrt(2 ln n) of their standard deviation
    one_px = PUBLISHED_2["largest_px"] / math.sqrt(2.0 * math.log(STEPS_2))
    heading_px = math.sqrt(one_px**2 - mast_px**2 - odometry_px**2)
    heading_sd = heading_px / focal_px / math.sqrt(float(steps.mean()))
    odometry_m = PUBLISHED_2["odometry"] * way
    heading_m = heading_sd * math.sqrt(float((steps * ranges**2).sum()))
    stereo_m = math.sqrt(PUBLISHED_2["correction_m"] ** 2 - odometry_m**2 - heading_m**2)
    return {
        "odometry_m": odometry_m,
        "heading_sd": heading_sd,
        "heading_m": heading_m,
        "stereo_m": stereo_m,
        "disparity_px": stereo_m * focal_px * baseline_m / FIRST_M**2,
    }


def _second_checkout(count: int, say: Say) -> dict[str, Any]:
    """Replay the 10 m approach with the flight's errors; their directions and signs are drawn."""
    left, right = (load_cameras("mer")[f"navcam_{side}"].model for side in ("left", "right"))
    derived = second_checkout_errors(left.hs, float(np.linalg.norm(right.C - left.C)))
    runs = []
    for seed in range(count):
        small = make_world(20 + seed, preset="mer", largest_m=0.12, target_m=PUBLISHED_2["rock_m"])
        rng = np.random.default_rng([seed, 1100])
        sun = small.sun.direction
        bearing = float(np.arctan2(sun[1], sun[0])) + rng.uniform(-0.5, 0.5)
        x, y = FIRST_M * math.cos(bearing), FIRST_M * math.sin(bearing)
        pose = small.pose(x, y, math.remainder(bearing + math.pi, math.tau), rng, 0.5)
        eye = np.asarray(pose.site_from_rover.apply(PIVOT), dtype=np.float64)
        target = point_on(small, eye, np.array([0.0, 0.0, small.rock.z + 0.5 * small.rock.height]))
        aside, sign = rng.uniform(0.0, math.tau), rng.choice((-1.0, 1.0))
        errors = NavigationErrors(
            odometry=0.0,
            bias=(PUBLISHED_2["odometry"] * math.cos(aside), PUBLISHED_2["odometry"] * math.sin(aside)),
            heading_sd=derived["heading_sd"],
            disparity_px=sign * derived["disparity_px"],
        )
        run = closed_loop(small, pose, target, rng, NccOptions(), errors=errors, last_m=LAST_M)
        if run is None:
            continue
        runs.append(
            {
                "steps": len(run.states),
                "tracked": all(s == "tracked" for s in run.states),
                "end_error_m": run.end_error_m,
                "end_position_error_m": run.off_m[-1] if run.off_m else math.inf,
                "total_correction_m": run.corrected_m,
                "largest_correction_px": max(s.get("correction_px", 0.0) for s in run.scores),
                "magnification": [
                    min(s["scale"] for s in run.scores[:-1]),
                    max(s["scale"] for s in run.scores[:-1]),
                ],
                "least_ncc": min(s.get("ncc", 0.0) for s in run.scores),
            }
        )
        say(f"  flight checkout 2, run {seed}: {runs[-1]}")
    return {"derived": derived, "runs": runs}


def _azimuth(eye: Array) -> float:
    return float(np.arctan2(-eye[1], -eye[0]))


def accuracy_study() -> dict[str, Any]:
    """Return Table I by its formulas and by drawing pixel errors through the camera models."""
    cameras = load_cameras("marsyard")
    rng = np.random.default_rng(1)
    one_px = np.array([1.0, 0.0])
    rows: dict[str, Any] = {}
    for name, baseline, published in (
        ("pancam", 0.30, (9.7, 18.7, 0.4, 0.06)),
        ("navcam", 0.20, (38.8, 42.0, 1.6, 0.16)),
    ):
        left, right = (cameras[f"{name}_{side}"].model for side in ("left", "right"))
        focal = left.hs

        def simulate(range_m: float, left: Any = left, right: Any = right) -> tuple[float, float]:
            """Return 3 sigma of range, and of sideways position per pixel of drift, metres."""
            point = left.C + range_m * left.A + 0.5 * (right.C - left.C)
            a, b = left.project(point), right.project(point)
            noise = rng.normal(0, 1.0 / 3.0, 4000)
            b_all = np.column_stack((b[0] + noise, np.full(4000, b[1])))
            points = triangulate(left, right, np.broadcast_to(a, (4000, 2)), b_all)[0]
            aside = triangulate(left, right, (a + one_px)[None], (b + one_px)[None])[0][0]
            return 3.0 * float(np.std((points - point) @ left.A)), float(np.linalg.norm(aside - point))

        far, _ = simulate(10.0)
        near, per_px = simulate(2.0)
        far_formula, near_formula = (r**2 / (focal * baseline) for r in (10.0, 2.0))
        rows[name] = {
            "published_cm": list(published),
            "formula_cm": [
                100 * far_formula,
                100 * float(np.hypot(far_formula, 0.16)),
                100 * near_formula,
                100 * 2.0 / focal,
            ],
            "simulated_cm": [100 * far, 100 * float(np.hypot(far, 0.16)), 100 * near, 100 * per_px],
        }
    return rows


def wedge_study() -> dict[str, Any] | None:
    """Return template tracking between two neighbouring Spirit Navcam wedges, or None without the frames.

    Range comes from the plane z = 0 of the rover frame. What is right is told by consensus: a quadratic field
    of the offset between prediction and match, fitted robustly to the matches of all trackers together; it
    holds the pointing error and the parallax of ground that is not quite that plane.
    """
    folder = SHARED / "data/imagery/mer"
    names = ("2n292280938effb100p0703l0m1.img.gz", "2n292280989effb100p0703l0m1.img.gz")
    if not all((folder / name).is_file() for name in names):
        return None
    first, second = (read_product(folder / name) for name in names)
    assert first.image is not None
    assert second.image is not None
    images = [np.asarray(p.image, dtype=np.float32) / np.float32(4095.0) for p in (first, second)]
    up = np.array([0.0, 0.0, -1.0])
    targets = []
    for y in range(40, 985, 22):
        for x in range(40, 985, 22):
            origin, ray = second.camera.back_project((x, y))
            if ray[2] < 0.08:
                continue
            point = origin - origin[2] / ray[2] * ray
            there = first.camera.project(point)
            if not np.isfinite(there).all() or not (75 <= there[0] <= 948 and 75 <= there[1] <= 948):
                continue
            targets.append((np.array([x, y], dtype=np.float64), point, there))
    results: dict[str, npt.NDArray[np.float64]] = {}
    for name, given in CONFIGURATIONS.items():
        matcher = TemplateMatcher(replace(given, search_px=40))
        rows = []
        for pixel, point, there in targets:
            distance = float(np.linalg.norm(point - second.camera.C))
            before = Template(images[1], second.camera, pixel, point, up, distance)
            template = matcher.predict(before, first.camera, there, point)
            found = None if template is None else matcher.search(images[0], template, there)
            if found is None:
                rows.append((np.nan, np.nan, -1.0, 99.0))
                continue
            at, score = found.pixel, found.score
            now = Template(
                images[0], first.camera, at, point, up, float(np.linalg.norm(point - first.camera.C))
            )
            rows.append((*(at - there), score, matcher.back_error(now, before)))
        results[name] = np.array(rows)
    place = np.array([t[2] for t in targets]) / 1024.0
    basis = np.column_stack((np.ones(len(place)), place, place**2, place[:, 0] * place[:, 1]))
    offsets = np.concatenate([r[:, :2] for r in results.values()])
    design = np.tile(basis, (len(results), 1))
    good = np.isfinite(offsets).all(axis=1)
    good &= np.hypot(*(offsets - np.nanmedian(offsets[good], axis=0)).T) < 8.0
    field_of = np.zeros((6, 2))
    for _ in range(15):
        field_of = np.linalg.lstsq(design[good], offsets[good], rcond=None)[0]
        residual = np.hypot(*(offsets - design @ field_of).T)
        good = np.isfinite(residual) & (residual < 2.0)
    roll = np.array([abs(np.degrees(template_roll(second.camera, first.camera, t[1]))) for t in targets])
    table = {}
    for name, rows_of in results.items():
        error = np.hypot(*(rows_of[:, :2] - basis @ field_of).T)
        error[~np.isfinite(error)] = 99.0
        passed = rows_of[:, 2] >= 0.7
        if name == "shipped":
            passed &= rows_of[:, 3] <= NccOptions().back_check_px
        table[name] = {
            "correct_percent": 100.0 * float((error < 2.0).mean()),
            "correct_at_roll_15_percent": 100.0 * float((error < 2.0)[roll >= 15].mean()),
            "passed_percent": 100.0 * float(passed.mean()),
            "false_accepts_percent": 100.0 * float((passed & (error > 3.0)).mean()),
        }
    return {"targets": len(targets), "roll_deg": [float(roll.min()), float(roll.max())], "table": table}


def nominal_study(runs: int, kind: str, say: Say) -> Iterator[dict[str, Any]]:
    """Yield what closed-loop approaches from 10 m came to, after each world of 20.

    Odometry is 5 % off, and the rover slips on slopes to 20 degrees.

    With `kind` something goes wrong at the fifth stop: `light` (the sun jumps), `azimuth` (65 degrees round).
    """
    count: Counter[str] = Counter()
    ends: list[float] = []
    late: list[bool] = []
    inside: list[float] = []
    reasons: Counter[str] = Counter()
    seed = 0
    while count["runs"] < runs:
        world = make_world(300 + seed, largest_m=0.8)
        attempt = here = 0
        while here < min(20, runs - count["runs"] + here) and attempt < 120 and count["runs"] < runs:
            rng = np.random.default_rng([seed, attempt, 79])
            attempt += 1
            picked = designate(world, rng, range_m=8.0 if kind else 10.0)
            if picked is None:
                continue
            run = closed_loop(
                world,
                picked[0],
                picked[1],
                rng,
                NccOptions(),
                slope_deg=float(rng.uniform(0, 20)),
                disturbance=Disturbance(kind, 5),
            )
            if run is None:
                continue
            here += 1
            count["runs"] += 1
            count["updates"] += len(run.states)
            count["undetected"] += run.undetected
            count["arrived"] += bool(np.isfinite(run.end_error_m))
            count["lost answers"] += sum(s != "tracked" for s in run.states)
            if kind:
                wrong = [s == "tracked" and e > 0.05 for s, e in zip(run.states, run.errors_m, strict=True)]
                late.append(any(wrong[6:]))
                count["lost within two"] += any(s != "tracked" for s in run.states[4:6])
                count["followed rightly"] += all(s == "tracked" for s in run.states) and not any(wrong)
            if np.isfinite(run.end_error_m):
                ends.append(run.end_error_m)
            inside += run.nees
            for why in run.reasons:
                if why:
                    reasons[" ".join(w for w in why[0].split() if not any(c.isdigit() for c in w))] += 1
        seed += 1
        say(f"  {kind or 'nominal'}: {count['runs']} runs, {count['undetected']} undetected")
        values = np.array(inside)
        yield {
            **count,
            "end_error_cm": [100 * float(np.percentile(ends, q)) for q in (50, 95, 100)] if ends else None,
            "late_failures": sum(late),
            "covered_percent": 100.0 * float((values < 7.815).mean()) if len(values) else None,
            "reasons": dict(reasons),
        }


def loss_study(runs: int, say: Say) -> Iterator[dict[str, Any]]:
    """Yield what came of the two published failures, forced at the fifth stop."""
    found: dict[str, Any] = {}
    for kind in ("light", "azimuth"):
        for so_far in nominal_study(runs, kind, say):
            found[kind] = so_far
    yield found


STUDIES = ("accuracy", "wedges", "flight", "steps", "orbit", "turn", "nominal", "losses")


def main() -> None:
    """Run the studies that were asked for and write tables and plots."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", choices=STUDIES, action="append")
    parser.add_argument("--worlds", type=int, default=12)
    parser.add_argument("--targets", type=int, default=24)
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--flights", type=int, default=16, help="replays of the second checkout")
    parser.add_argument("--results", type=Path, default=Path("studies/results/tracking.json"))
    parser.add_argument("--out", type=Path, help="docs folder that gets tracking tables and plots")
    arguments = parser.parse_args()
    worlds = list(range(arguments.worlds))
    results: dict[str, Any] = {}
    if arguments.results.is_file():
        results = json.loads(arguments.results.read_text())
    work: dict[str, Callable[[], Iterator[Any]]] = {
        "accuracy": lambda: iter([accuracy_study()]),
        "wedges": lambda: iter([wedge_study()]),
        "flight": lambda: iter([flight_study(arguments.flights, print)]),
        "steps": lambda: step_study(worlds, arguments.targets, print),
        "orbit": lambda: iter([orbit_study(worlds[:5], 12, print)]),
        "turn": lambda: iter([turn_study(worlds[:2], 10, print)]),
        "nominal": lambda: nominal_study(arguments.runs, "", print),
        "losses": lambda: loss_study(max(10, arguments.runs // 10), print),
    }
    for name in arguments.only or STUDIES:
        started = time.process_time()
        for so_far in work[name]():
            results[name] = so_far
            arguments.results.parent.mkdir(parents=True, exist_ok=True)
            arguments.results.write_text(json.dumps(results, indent=1) + "\n")
        print(f"{name}: {time.process_time() - started:.0f} CPU s", flush=True)
    if arguments.out:
        write_report(results, arguments.out)


if __name__ == "__main__":
    main()
