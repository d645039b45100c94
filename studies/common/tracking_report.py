"""Writes what the tracking studies found into docs/results/tracking.md and docs/img."""

from __future__ import annotations

import math
import statistics
from pathlib import Path
from typing import Any

from studies.common.pages import table, write_sections

ORDER = ("plain NCC", "NCC + scale", "NCC + scale + roll (as flown)", "+ plane", "shipped")
PUBLISHED_1 = {
    "magnification": [1.04, 1.03, 1.03, 1.01, 1.00, 0.97, 1.04],
    "roll_deg": [2.46, 2.46, 2.92, 3.27, 3.27, 0.06, 6.25],
    "azimuth_deg": [6.01, 6.38, 8.53, 8.58, 8.62, 0.00, 15.44],
    "ncc": [0.88, 0.88, 0.85, 0.87, 0.87, 0.94, 0.79],
}
"""Table III."""

PUBLISHED_2 = {"correction_m": 0.36, "largest_px": 11.0, "odometry": 0.02, "rock_m": 0.12, "ncc": 0.85}
"""Section 7.2; the odometry is that of eq. 3."""


def write_report(results: dict[str, Any], docs: Path) -> None:
    """Replace the generated sections of docs/results/tracking.md and draw the plots."""
    write_sections(
        docs,
        "tracking",
        results,
        {
            "steps": lambda r: _steps(r["steps"]),
            "orbit": lambda r: _by_angle(r["orbit"], "70 degrees round each", "azimuth step"),
            "turn": lambda r: _by_angle(r["turn"], "90 degrees turned in all", "turn per step"),
            "wedges": lambda r: _wedges(r["wedges"]),
            "accuracy": lambda r: _accuracy(r["accuracy"]),
            "flight": lambda r: (
                _first_checkout(r["flight"]["checkout_1"]) + _second_checkout(r["flight"]["checkout_2"])
            ),
            "nominal": lambda r: _nominal(r["nominal"]),
            "losses": lambda r: _losses(r["losses"]),
        },
    )
    _plots(results, docs / "img")


def _cell(entry: dict[str, Any]) -> str:
    median = "" if entry["median_px"] is None else f" ({entry['median_px']:.1f})"
    return f"{entry['percent']:.0f}{median}"


def _steps(found: dict[str, Any]) -> str:
    by_name = found["table"]
    sizes = list(next(iter(by_name.values())))
    rows = [[name, *(_cell(by_name[name][s]) for s in sizes)] for name in ORDER if name in by_name]
    return f"{found['targets']} targets in {found['worlds']} worlds.\n\n" + table(
        ["step, % of the range", *sizes], rows
    )


def _by_angle(found: dict[str, Any], what: str, head: str) -> str:
    by_name = found["table"]
    steps = list(next(iter(by_name.values())))
    rows = [[name, *(_cell(by[s]) for s in steps)] for name, by in by_name.items()]
    return f"{found['targets']} targets, {what}.\n\n" + table([head, *(f"{s}°" for s in steps)], rows)


def _wedges(found: dict[str, Any]) -> str:
    rows = [
        [
            name,
            f"{by['correct_percent']:.1f}",
            f"{by['correct_at_roll_15_percent']:.1f}",
            f"{by['passed_percent']:.1f}",
            f"{by['false_accepts_percent']:.1f}",
        ]
        for name, by in found["table"].items()
    ]
    low, high = found["roll_deg"]
    return f"{found['targets']} targets, roll {low:.0f} to {high:.0f} degrees.\n\n" + table(
        ["", "correct, %", "at roll ≥ 15°, %", "score ≥ 0.7, %", "false accepts, %"], rows
    )


def _accuracy(found: dict[str, Any]) -> str:
    rows = []
    for name, by in found.items():
        for kind in ("published", "formula", "simulated"):
            v = by[f"{kind}_cm"]
            rows.append([name if kind == "published" else "", kind, *(f"{x:.2f}" for x in v)])
    return table(
        ["camera", "", "stereo at 10 m", "untracked at 2 m", "stereo at 2 m", "per pixel of drift"], rows
    )


def _first_checkout(found: dict[str, Any]) -> str:
    rows = []
    for key, label in (
        ("magnification", "magnification"),
        ("roll_deg", "roll, degrees"),
        ("ncc", "NCC score"),
    ):
        rows.append([label, "flight", *(f"{v:.2f}" for v in PUBLISHED_1[key])])
        for name, by in found["rows"].items():
            rows.append(["", name, *(f"{v:.2f}" for v in by[key])])
    fitted = found["fitted"]
    return table(["", "", *(str(n) for n in range(2, 9))], rows) + (
        f"\nFitted to the published azimuths and magnifications: target {fitted['bearing_deg']:.0f}° off the "
        f"first heading, {fitted['heading_change_per_move_deg']:.1f}° of heading change a move, mast recedes "
        f"{100 * fitted['recoil_in_turn_m']:.0f} cm in the turn.\n"
    )


def _second_checkout(found: dict[str, Any]) -> str:
    errors, replays = found["derived"], found["runs"]
    runs = [r for r in replays if r["tracked"]]
    rows = []
    for label, key, unit, form, flight in (
        ("target corrected in all, cm", "total_correction_m", 100, ".0f", "36"),
        ("end error: matched point on the rock, cm", "end_error_m", 100, ".1f", ""),
        ("end error: position from the camera, cm", "end_position_error_m", 100, ".1f", ""),
        ("largest correction at a stop, px", "largest_correction_px", 1, ".0f", "11"),
        ("least NCC score", "least_ncc", 1, ".2f", "0.85"),
    ):
        values = sorted(unit * r[key] for r in runs)
        middle = (statistics.median(values), values[0], values[-1])
        rows.append([label, flight, *(format(v, form) for v in middle)])
    steps = sorted({r["steps"] for r in runs})
    low, high = (f([r["magnification"][n] for r in runs]) for n, f in enumerate((min, max)))
    return (
        f"\nSecond checkout, {len(replays)} replays to a rock of 12 cm. {len(runs)} were tracked at every "
        f"one of {' or '.join(map(str, steps))} stops, of which the table tells; {len(replays) - len(runs)} "
        f"was told as lost on the way. Magnification {low:.2f} to {high:.2f} "
        f"(flight: 1.09 to 1.13). Injected: 2 % of odometry ({100 * errors['odometry_m']:.1f} cm), heading "
        f"drift of {math.degrees(errors['heading_sd']):.2f}° per √m ({100 * errors['heading_m']:.1f} cm), "
        f"{errors['disparity_px']:.2f} px of stereo ({100 * errors['stereo_m']:.1f} cm at 9.65 m).\n\n"
    ) + table(["", "flight", "median", "least", "greatest"], rows)


def _nominal(found: dict[str, Any]) -> str:
    ends = found["end_error_cm"]
    return (
        table(
            [
                "runs",
                "updates",
                "arrived",
                "lost answers",
                "undetected failures",
                "end error cm, median / 95 % / worst",
            ],
            [
                [
                    str(found["runs"]),
                    str(found["updates"]),
                    str(found["arrived"]),
                    str(found["lost answers"]),
                    str(found["undetected"]),
                    " / ".join(f"{v:.1f}" for v in ends),
                ]
            ],
        )
        + f"\nThe 95 % ellipsoid holds {found['covered_percent']:.0f} % of the true errors.\n"
    )


def _losses(found: dict[str, Any]) -> str:
    rows = [
        [
            {"light": "sun jumps to the other side, 12° high", "azimuth": "65° round the target"}[kind],
            str(by["runs"]),
            str(by["followed rightly"]),
            str(by["lost within two"]),
            str(by["undetected"]),
        ]
        for kind, by in found.items()
    ]
    return table(
        [
            "what happens",
            "runs",
            "followed rightly",
            "told as lost within two updates",
            "undetected failures",
        ],
        rows,
    )


def _plots(results: dict[str, Any], folder: Path) -> None:
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    folder.mkdir(parents=True, exist_ok=True)
    if results.get("steps"):
        figure, (a, b) = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
        for name in ORDER:
            by = results["steps"]["table"].get(name)
            if not by:
                continue
            x = [float(s) for s in by]
            a.plot(x, [v["percent"] for v in by.values()], "o-", label=name)
            b.plot(x, [v["median_px"] for v in by.values()], "o-", label=name)
        a.plot([5, 23], [80, 15], "kv", mfc="none", label="published, plain")
        a.plot([5, 23], [100, 95], "k^", mfc="none", label="published, scaled")
        a.set(xlabel="step, % of the range", ylabel="targets kept, %", ylim=(0, 103))
        b.set(xlabel="step, % of the range", ylabel="median end error, px", ylim=(0, None))
        a.legend(fontsize=7)
        figure.savefig(folder / "tracking_steps.png", dpi=110)
        plt.close(figure)
    if results.get("orbit"):
        figure, axis = plt.subplots(figsize=(5, 3.4), layout="constrained")
        for name, by in results["orbit"]["table"].items():
            axis.plot([int(s) for s in by], [v["percent"] for v in by.values()], "o-", label=name)
        axis.set(xlabel="azimuth step, degrees", ylabel="targets kept, %", ylim=(0, 103))
        axis.legend(fontsize=7)
        figure.savefig(folder / "tracking_orbit.png", dpi=110)
        plt.close(figure)
