"""All tables and plots of docs/results/localization.md.

::

    python -m studies.localization --cache var/localization          # about 15 CPU minutes the first time
    python -m studies.localization --trials 20 --kilometre-legs 40 --rendered 0   # a short look
    python -m studies.localization --only rendered --rendered 8 # legs from rendered panoramas, fresh terrains
    python -m studies.localization --only noise                 # what the modelled stereo's noise is set by
    python -m studies.localization --only drives                # rendered steps and their kilometre
    python -m studies.localization --only drives --seed 734112  # the same seeds again; goes on after a stop
    python -m studies.localization --only drives --tuning       # seeds that may set constants; writes nothing

Rendered drives (half a CPU hour) run only when asked for. Extracted legs and rendered steps are kept in the
cache folder; matching and all that follows runs anew each time.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from rover_iface.localization.leg import LegResult, localise_leg
from studies.common.domain_split import reporting, tuning
from studies.common.localization_drive import (
    feature_steps,
    kilometre,
    modelled_draw,
    speed_summary,
    step_figures,
    tied_leg,
)
from studies.common.localization_legs import LegRecord, leg_record, noise_name, wheel_prior
from studies.common.localization_noise import noise_figures
from studies.common.localization_plots import draw_kilometre, draw_leg, draw_trials
from studies.common.odometry_drives import Drive, Flown, flown, ground_of, stops_of
from studies.common.odometry_figures import (
    draw_steps,
    flown_kilometre,
    kilometre_table,
    long_figures,
    long_table,
    steps_table,
    steps_told,
)
from studies.common.pages import write_section
from studies.common.published_matching import PublishedOptions, match_as_published
from studies.common.rock_solids import table_one, whole_solids

ROOT = Path(__file__).resolve().parent.parent
FIRST_SEED = 20300
KILOMETRE_SEED = 2000
NOISE_SEEDS = range(10000, 10008)
"""Terrains of the rendered stops that the noise of modelled stereo is measured on; no result is of these."""
SHORT_M = 20.0
"""Way of a drive that is one of several."""
TURNS = tuple(np.radians(np.arange(-5.0, 5.5, 1.0)).tolist())


def judged(record: LegRecord, *, with_turns: bool = False) -> tuple[LegResult, dict[str, Any]]:
    """Return the verdict on a leg with wheels off by 5 % and heading by up to 5 degrees, and counts."""
    prior = wheel_prior(record, np.random.default_rng([record.seed, 7]))
    first, second = record.ends
    result = localise_leg(first.rocks, second.rocks, prior)
    pairs = [] if result.match is None else [(p.first, p.second) for p in result.match.pairs]

    def right(found: list[tuple[int, int]]) -> int:
        return sum(bool(first.bodies[i] & second.bodies[j]) for i, j in found)

    published = match_as_published(first.rocks, second.rocks, prior)
    options = PublishedOptions(turns_rad=TURNS)
    turned = match_as_published(first.rocks, second.rocks, prior, options) if with_turns else None
    entry: dict[str, Any] = {
        "seed": record.seed,
        "rocks": [len(first.rocks), len(second.rocks)],
        "common": len(first.visible & second.visible),
        "accepted": result.accepted,
        "faults": [refusal.fault.value for refusal in result.refusals],
        "pairs": len(pairs),
        "right": right(pairs),
        "right_windowed": sum(bool(first.windowed[i] & second.windowed[j]) for i, j in pairs)
        if record.rendered
        else None,
        "published": [len(published), right(published)],
        "published_turned": None if turned is None else [len(turned), right(turned)],
    }
    if result.match is not None and result.accepted:
        m, true = result.match, record.eyes[1] - record.eyes[0]
        off = np.array([m.x_m, m.y_m, m.z_m, m.heading_rad]) - np.array([*true, 0.0])
        entry |= {
            "error_m": float(np.hypot(*off[:2])),
            "error_rad": abs(float(off[3])),
            "nees": float(off @ np.linalg.solve(m.covariance, off)),
        }
    return result, entry


def kept_entry(seed: int, cache: Path, *, modelled: bool, turned: bool) -> dict[str, Any]:
    """Return the counts of one leg, from the cache if neither its stereo nor matching has changed since.

    `modelled` fits its rocks as solids, `turned` runs the published scheme with headings too.
    """
    folder = ROOT / "rover_iface" / "localization"
    files = [folder / f"{name}.py" for name in ("rock_matching", "matching_kernels", "leg")]
    files.insert(2, ROOT / "studies" / "common" / "published_matching.py")
    digest = hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()[:12]
    path = cache / f"entry_{seed}_{noise_name()}_{digest}.json"
    if path.exists():
        kept: dict[str, Any] = json.loads(path.read_text())
        return kept
    record = leg_record(seed, 26.0, models=modelled, cache=cache)
    result, entry = judged(record, with_turns=turned)
    path.write_text(json.dumps(entry))
    print(f"leg {seed}: {entry['right']} of {entry['pairs']} pairs right, {result.verdict}", flush=True)
    return entry


def matching_figures(entries: list[dict[str, Any]]) -> dict[str, Any]:
    """Return precision, and how the legs with at least six rocks seen from both ends end."""
    accepted = [e for e in entries if e["accepted"]]
    six = [e for e in entries if e["common"] >= 6]
    figures: dict[str, Any] = {
        "legs": len(entries),
        "accepted": len(accepted),
        "pairs": sum(e["pairs"] for e in accepted),
        "precision": sum(e["right"] for e in accepted) / max(1, sum(e["pairs"] for e in accepted)),
        "six": len(six),
        "four_right": sum(e["accepted"] and e["right"] >= 4 for e in six) / max(1, len(six)),
        "refused": sum(not e["accepted"] for e in six) / max(1, len(six)),
        "median_right": float(np.median([e["right"] for e in accepted])) if accepted else 0.0,
        "median_rocks": float(np.median([n for e in entries for n in e["rocks"]])),
        "wrong_poses": sum(e["error_m"] > 1.0 or e["error_rad"] > math.radians(2.0) for e in accepted),
        "error_m": float(np.median([e["error_m"] for e in accepted])) if accepted else math.nan,
        "error_deg": math.degrees(float(np.median([e["error_rad"] for e in accepted])))
        if accepted
        else math.nan,
        "nees": float(np.mean([e["nees"] for e in accepted])) if accepted else math.nan,
    }
    for name in ("published", "published_turned"):
        tried = [e for e in entries if e[name] is not None]
        if tried:
            found, right = (sum(e[name][k] for e in tried) for k in (0, 1))
            tried_six = [e for e in tried if e["common"] >= 6]
            figures[name] = {
                "legs": len(tried),
                "precision": right / max(1, found),
                "mean_right": right / len(tried),
                "four_right": sum(e[name][1] >= 4 for e in tried_six) / max(1, len(tried_six)),
            }
    by_common = []
    for low, high in ((0, 6), (6, 12), (12, 24), (24, 48), (48, 999)):
        part = [e for e in entries if low <= e["common"] < high]
        if part:
            by_common.append(
                {
                    "common": f"{low} to {high - 1}" if high < 999 else f"{low} and more",
                    "legs": len(part),
                    "accepted": sum(e["accepted"] for e in part),
                    "right": float(np.mean([e["right"] if e["accepted"] else 0 for e in part])),
                    "published": float(np.mean([e["published"][1] for e in part])),
                }
            )
    figures["by_common"] = by_common
    faults: dict[str, int] = {}
    for e in entries:
        for fault in e["faults"]:
            faults[fault] = faults.get(fault, 0) + 1
    figures["faults"] = faults
    return figures


def rendered_figures(seeds: list[int], cache: Path) -> dict[str, Any]:
    """Return what comes of legs from rendered panoramas, and of the same legs from modelled stereo."""
    entries: list[dict[str, Any]] = []
    modelled: list[dict[str, Any]] = []
    for seed in seeds:
        for rendered, found in ((True, entries), (False, modelled)):
            record = leg_record(seed, 26.0, rendered=rendered, models=False, cache=cache)
            found.append(judged(record)[1])
        one = entries[-1]
        print(
            f"rendered leg {seed}: {one['right']} and {one['right_windowed']} of {one['pairs']}", flush=True
        )
    accepted = [e for e in entries if e["accepted"]]
    pairs = max(1, sum(e["pairs"] for e in accepted))
    return matching_figures(entries) | {
        "precision_windowed": sum(e["right_windowed"] for e in accepted) / pairs,
        "seeds": [seeds[0], seeds[-1]],
        "same_modelled": matching_figures(modelled),
    }


def model_figures(records: list[LegRecord]) -> dict[str, Any]:
    """Return mean relative errors of height, radius and area of significant rocks up to 20 m away.

    `mean` and `median` are of patches that are more probably a rock than not, `mean_all` of all.
    """
    rows, sure = [], []
    for record in records:
        for end in record.ends:
            for seen, bodies in zip(end.rocks, end.bodies, strict=True):
                if seen.model is None or len(bodies) != 1 or seen.range_m > 20.0 or len(seen.cells) < 20:
                    continue
                height, radius, area = record.shapes[next(iter(bodies))]
                if height >= 0.15:
                    m = seen.model
                    rows.append((m.height_m / height - 1, m.radius_m / radius - 1, m.area_m2 / area - 1))
                    sure.append(seen.probability > 0.5)
    errors = np.abs(np.array(rows).reshape(-1, 3))
    rock = errors[np.array(sure, dtype=bool)]
    return {
        "rocks": len(rock),
        "all": len(rows),
        "mean": rock.mean(axis=0).tolist(),
        "median": np.median(rock, axis=0).tolist(),
        "mean_all": errors.mean(axis=0).tolist(),
    }


def kilometre_figures(records: list[LegRecord], runs: int) -> tuple[dict[str, Any], Any]:
    """Return errors at the end of a kilometre over several runs, and the first run to draw."""
    legs = [tied_leg(record) for record in records]
    steps = feature_steps(150, 77)
    draw = modelled_draw(steps)
    done = [kilometre(legs, seed, draw) for seed in range(runs)]
    shares = {
        name: [100 * run.error_share(getattr(run, name)) for run in done]
        for name in ("wheels", "odometry", "adjusted")
    }
    twice = [kilometre(legs, seed, draw, sightings=2) for seed in range(runs)]
    shares["adjusted_twice"] = [100 * run.error_share(run.adjusted) for run in twice]
    return {
        "runs": runs,
        "legs": len(legs),
        "accepted": sum(leg.accepted for leg in legs),
        "ties": float(np.mean([run.ties for run in done])),
        "steps": step_figures(steps),
        "share": {
            name: {
                "mean": float(np.mean(values)),
                "p95": float(np.percentile(values, 95)),
                "worst": float(np.max(values)),
            }
            for name, values in shares.items()
        },
        "nees": float(np.mean([run.nees for run in done])),
        "within_95": float(np.mean([run.nees < 12.592 for run in done])),
    }, done[0]


def drive_figures(chosen: argparse.Namespace) -> dict[str, Any]:
    """Return what rendered drives tell, by the section of the page.

    Drives of 20 m over grounds of their own, each third one by the own renderer, the others with the grain of
    real frames; two of `--long` metres over one more ground by the own renderer, under different suns.
    """
    count = chosen.worlds + 1
    seeds = tuning(count) if chosen.tuning else reporting(count, chosen.seed)
    print(f"{seeds.purpose} seeds {seeds.values}", flush=True)
    folder = chosen.cache / "drives"
    *short, last = seeds.values
    drives = [
        Drive(seed, 1, "draped" if k % 3 else "own", SHORT_M, seeds.purpose) for k, seed in enumerate(short)
    ]
    flights = [flown(drive, chosen.imagery, folder) for drive in drives]
    pair = [Drive(last, run, "own", chosen.long, seeds.purpose) for run in (1, 2)]
    runs = [flown(drive, chosen.imagery, folder, chosen.parts) for drive in pair]
    ground = ground_of(last, chosen.long)
    starts = [stops_of(ground, drive)[0].pose.site_from_rover for drive in pair]
    by_domain: dict[str, list[Flown]] = {"own": [], "draped": [], "all": []}
    for flight in [*flights, *runs]:
        by_domain[flight.drive.domain].append(flight)
        by_domain["all"].append(flight)
    legs = []
    for seed in range(last + 1, last + 1 + chosen.kilometre_legs):
        length = float(np.random.default_rng([seed, 0x1E7]).uniform(20, 30))
        legs.append(tied_leg(leg_record(seed, length, models=False, cache=chosen.cache)))
    told = {name: [s for flight in some for s in flight.steps] for name, some in by_domain.items()}
    if not chosen.tuning:
        draw_steps(told["all"], ROOT / "docs" / "img" / "localization_steps.png")
    return {
        "rendered_steps": {
            "seeds": [short[0], last],
            "domains": {name: steps_told(steps) for name, steps in told.items() if steps},
        },
        "rendered_kilometre": flown_kilometre([*flights, *runs], legs, chosen.runs),
        "long_runs": long_figures(runs, starts),
    }


def main() -> None:
    """Run the studies, write the results and the docs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=200)
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED, help="terrain of the first leg")
    parser.add_argument("--rendered", type=int, default=10)
    parser.add_argument("--kilometre-legs", type=int, default=40)
    parser.add_argument("--runs", type=int, default=40)
    parser.add_argument("--modelled", type=int, default=40, help="legs whose rocks are fitted as solids")
    parser.add_argument("--turned", type=int, default=16, help="legs for the published scheme with headings")
    parser.add_argument("--cache", type=Path, default=ROOT / "var" / "localization")
    parser.add_argument(
        "--only", choices=["matching", "kilometre", "rest", "drives", "rendered", "noise"], action="append"
    )
    parser.add_argument("--worlds", type=int, default=5, help="rendered drives of 20 m")
    parser.add_argument("--long", type=float, default=200.0, help="way of the two long drives, m")
    parser.add_argument("--parts", type=int, help="only the first parts of 8 m of each long drive")
    parser.add_argument("--seed", type=int, help="first seed of rendered drives; drawn without")
    parser.add_argument("--tuning", action="store_true", help="rendered drives of tuning seeds, not reported")
    parser.add_argument("--imagery", type=Path, default=ROOT.parent / "shared" / "data" / "imagery")
    chosen = parser.parse_args()
    # rendered drives take half an hour: only when asked for
    wanted = chosen.only or ["matching", "kilometre", "rest"]
    target = ROOT / "studies" / "results" / "localization.json"
    results: dict[str, Any] = json.loads(target.read_text()) if target.exists() else {}
    images = ROOT / "docs" / "img"
    if "matching" in wanted:
        seeds = range(chosen.first_seed, chosen.first_seed + chosen.trials)
        entries = [
            kept_entry(seed, chosen.cache, modelled=k < chosen.modelled, turned=k < chosen.turned)
            for k, seed in enumerate(seeds)
        ]
        records = [leg_record(seed, 26.0, cache=chosen.cache) for seed in seeds[: chosen.modelled]]
        drawn = records[min(7, len(records) - 1)]
        draw_leg(drawn, judged(drawn)[0], images / "localization_leg.png")
        results["matching"] = matching_figures(entries)
        results["matching"]["seeds"] = [seeds[0], seeds[-1]]
        results["models"] = model_figures(records)
        if chosen.rendered:
            results["rendered"] = rendered_figures(list(seeds[: chosen.rendered]), chosen.cache)
        draw_trials(entries, images / "localization_trials.png")
    if "kilometre" in wanted:
        lengths = {
            seed: float(np.random.default_rng([seed, 0x1E7]).uniform(20, 30))
            for seed in range(KILOMETRE_SEED, KILOMETRE_SEED + chosen.kilometre_legs)
        }
        legs = [leg_record(s, length, models=False, cache=chosen.cache) for s, length in lengths.items()]
        results["kilometre"], run = kilometre_figures(legs, chosen.runs)
        draw_kilometre(run, images / "localization_kilometre.png")
    if "rest" in wanted:
        results["speed"] = speed_summary(5)
        results["solids"] = whole_solids()
        results["table_one"] = table_one()
        results["slip"] = step_figures(feature_steps(40, 9, slip=0.3))
        results["no_slip"] = step_figures(feature_steps(100, 10))
    if "noise" in wanted:
        results["noise"] = noise_figures(NOISE_SEEDS)
    if "rendered" in wanted:
        fresh = reporting(chosen.rendered, chosen.seed)
        print(f"{fresh.purpose} terrains {fresh.values}", flush=True)
        results["rendered"] = rendered_figures(list(fresh.values), chosen.cache)
    if "drives" in wanted:
        told = drive_figures(chosen)
        if chosen.tuning:
            print(json.dumps(told, indent=1))
            return
        results |= told
    target.parent.mkdir(exist_ok=True)
    target.write_text(json.dumps(results, indent=1) + "\n")
    write_report(results, ROOT / "docs")
    print(json.dumps({k: v for k, v in results.items() if k != "table_one"}, indent=1))


def _table(head: list[str], rows: list[list[str]]) -> str:
    return "\n".join("| " + " | ".join(cells) + " |" for cells in [head, ["---"] * len(head), *rows])


def write_report(results: dict[str, Any], docs: Path) -> None:
    """Replace the generated sections of docs/results/localization.md."""
    for name, make in REPORTS.items():
        if name in results:
            write_section(docs, "localization", name, make(results[name]))


def _matching(f: dict[str, Any]) -> str:
    schemes = [
        [
            "shipped",
            f"{f['precision']:.3f}",
            f"{f['median_right']:.0f} (median of accepted)",
            f"{100 * f['four_right']:.0f} %",
            f"{100 * f['refused']:.0f} %",
        ]
    ]
    for name, label in (
        ("published", "published"),
        ("published_turned", "published, with headings"),
    ):
        if name not in f:
            continue
        p = f[name]
        label += "" if p["legs"] == f["legs"] else f" (first {p['legs']} legs)"
        schemes.append(
            [
                label,
                f"{p['precision']:.3f}",
                f"{p['mean_right']:.1f} (mean)",
                f"{100 * p['four_right']:.0f} %",
                "none",
            ]
        )
    faults = ", ".join(f"{fault} {count}" for fault, count in sorted(f["faults"].items()))
    return "\n\n".join(
        [
            _table(
                [
                    "scheme",
                    "precision of pairs",
                    "right pairs a leg",
                    f"at least 4 right, of {f['six']} legs with 6 rocks seen from both ends",
                    "of these refused",
                ],
                schemes,
            ),
            _table(
                [
                    "rocks seen from both ends",
                    "legs",
                    "accepted",
                    "right pairs, shipped",
                    "right pairs, published",
                ],
                [
                    [
                        b["common"],
                        str(b["legs"]),
                        str(b["accepted"]),
                        f"{b['right']:.1f}",
                        f"{b['published']:.1f}",
                    ]
                    for b in f["by_common"]
                ],
            ),
            f"{f['legs']} legs, {f['median_rocks']:.0f} rocks extracted at a stop (median). "
            f"Of {f['accepted']} accepted legs {f['wrong_poses']} have a wrong pose (over 1 m or 2 degrees); "
            f"median error {f['error_m']:.2f} m and {f['error_deg']:.2f} degrees; "
            f"mean NEES {f['nees']:.1f} (4 expected). Rules that fired: {faults or 'none'}. "
            f"Terrains {f['seeds'][0]} to {f['seeds'][1]}, by which nothing was set.",
        ]
    )


def _rendered(f: dict[str, Any]) -> str:
    m = f["same_modelled"]
    rows = [
        [
            label,
            str(e["legs"]),
            str(e["accepted"]),
            str(e["pairs"]),
            f"{e['precision']:.3f}",
            f"{e['precision_windowed']:.3f}" if "precision_windowed" in e else "",
            f"{e['error_m']:.2f} m",
            f"{e['nees']:.1f}",
            str(e["wrong_poses"]),
        ]
        for label, e in (("rendered panoramas", f), ("the same legs, modelled stereo", m))
    ]
    head = ["points from", "legs", "accepted", "pairs", "precision", "with stereo's window", "median error"]
    seeds = f"Terrains {f['seeds'][0]} to {f['seeds'][1]}." if "seeds" in f else ""
    return _table([*head, "mean NEES (4)", "wrong poses"], rows) + f"\n\n{seeds}"


def _noise(f: dict[str, Any]) -> str:
    rows = [
        [
            f"{name}, {'15 to 24' if name.startswith('far') else 'to 15'} m",
            f"{k['cells']} in {k['pairs']}",
            f"{k['bias_mean']:+.3f}, {k['bias_rms']:.3f}",
            f"{k['rms']:.3f} ({k['robust']:.3f})",
            ", ".join(f"{c:.2f}" for c in k["correlation"].values()),
            f"{k['together']:.3f}",
            f"{k['white']:.3f}",
        ]
        for name, k in f["kinds"].items()
    ]
    head = ["disparity, px", "cells in pairs", "bias of pairs: mean, rms", "scatter, rms (robust)"]
    head += ["correlation over 1 to 4 cells", "hanging together", "each cell's own"]
    return _table(head, rows) + (
        f"\n\n{len(f['seeds'])} rendered stops, terrains {f['seeds'][0]} to {f['seeds'][-1]}. "
        f"What hangs together does so over {f['width']:.2f} cells; "
        f"beside {100 * f['grown']:.0f} % of the edges the nearer body is seen a cell too wide."
    )


def _models(f: dict[str, Any]) -> str:
    rows = [
        [label, f"{100 * mean:.0f} %", f"{100 * median:.0f} %", f"{100 * every:.0f} %", published, bar]
        for label, mean, median, every, published, bar in zip(
            ("height", "radius", "surface"),
            f["mean"],
            f["median"],
            f["mean_all"],
            ("25 %", "44 %", "57 %"),
            ("20 %", "30 %", "40 %"),
            strict=True,
        )
    ]
    head = [
        f"{f['rocks']} rocks",
        "mean error",
        "median",
        f"mean, all {f['all']} patches",
        "published (79 rocks)",
        "bar",
    ]
    return _table(head, rows)


def _solids(f: dict[str, Any]) -> str:
    e = f["one_sided"]
    return (
        f"Exact solids: the right family {f['right']} of {f['solids']} times seen from all round; "
        f"seen from one side with 1 cm of noise, mean errors {100 * e[0]:.1f} % of height, "
        f"{100 * e[1]:.1f} % of radius, {100 * e[2]:.1f} % of surface."
    )


def _table_one(rows: list[dict[str, Any]]) -> str:
    def cm(values: list[float]) -> str:
        return " / ".join(f"{100 * v:.1f}" for v in values)

    return _table(
        [
            "rock",
            "published family",
            "r or a / b / h, cm",
            "found family",
            "found, cm",
            "orientation, rad: published, found",
        ],
        [
            [
                str(k),
                r["family"],
                cm(r["given"]),
                r["found_family"],
                cm(r["found"]),
                f"{r['phi']:.2f}, {r['found_phi']:.2f}",
            ]
            for k, r in enumerate(rows, 1)
        ],
    )


def _kilometre(f: dict[str, Any]) -> str:
    names = (
        ("wheels", "wheels, 5 %"),
        ("odometry", "+ visual odometry"),
        ("adjusted", "+ adjustment"),
        ("adjusted_twice", "+ adjustment, sun sighted twice at each site"),
    )
    rows = [
        [label, *(f"{f['share'][name][k]:.2f} %" for k in ("mean", "p95", "worst"))] for name, label in names
    ]
    return "\n\n".join(
        [
            _table(["error at the end, share of the distance", "mean", "95 % of runs", "worst"], rows),
            f"{f['runs']} runs of 1 km over {f['legs']} legs of 20 to 30 m in random order, "
            f"{f['accepted']} of them accepted, {f['ties']:.0f} rocks a run. "
            f"NEES of the last pose {f['nees']:.1f} (6 expected), "
            f"{100 * f['within_95']:.0f} % of runs inside their 95 % ellipsoid.",
        ]
    )


def _speed(f: dict[str, Any]) -> str:
    return (
        f"{f['poses']:.0f} poses, {f['points']:.0f} points, {f['observations']:.0f} stereo observations: "
        f"{f['solve_s']:.2f} CPU s to solve ({f['iterations']:.0f} iterations, "
        f"chi2 per degree of freedom {f['chi2_per_freedom']:.2f}), "
        f"{f['build_s']:.2f} CPU s to put together; medians of five."
    )


def _steps(label: str) -> Any:
    def made(f: dict[str, Any]) -> str:
        return (
            f"{label}: {f['steps']} steps, {f['shift_mm']:.1f} mm and {f['heading_mrad']:.2f} mrad rms, "
            f"mean NEES {f['nees_mean']:.1f} (6 expected), slip reported in {100 * f['slip']:.0f} %."
        )

    return made


def _rendered_steps(f: dict[str, Any]) -> str:
    first, last = f["seeds"]
    return f"Seeds {first} to {last}, drawn when the command ran.\n\n{steps_table(f['domains'])}"


REPORTS = {
    "matching": _matching,
    "rendered": _rendered,
    "noise": _noise,
    "models": _models,
    "solids": _solids,
    "table_one": _table_one,
    "kilometre": _kilometre,
    "speed": _speed,
    "slip": _steps("Wheels that slip by 30 %"),
    "no_slip": _steps("Wheels off by 5 %, no slip"),
    "rendered_steps": _rendered_steps,
    "rendered_kilometre": kilometre_table,
    "long_runs": long_table,
}


if __name__ == "__main__":
    main()
