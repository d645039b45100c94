"""Writes what the tracking studies found into docs/tracking.md and docs/img."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

ORDER = ("plain NCC", "NCC + scale", "NCC + scale + roll (as flown)", "+ plane", "shipped")


def write_report(results: dict[str, Any], docs: Path) -> None:
    """Replace the generated sections of docs/tracking.md and draw the plots."""
    page = docs / "tracking.md"
    text = page.read_text()
    for name, make in {
        "steps": _steps,
        "orbit": _orbit,
        "turn": _turn,
        "wedges": _wedges,
        "accuracy": _accuracy,
        "flight": _flight,
        "nominal": _nominal,
        "losses": _losses,
    }.items():
        if results.get(name):
            body = make(results[name]).strip()
            text = re.sub(
                rf"(<!-- begin:{name} -->).*?(<!-- end:{name} -->)",
                lambda m, body=body: f"{m.group(1)}\n{body}\n{m.group(2)}",
                text,
                flags=re.DOTALL,
            )
    page.write_text(text)
    _plots(results, docs / "img")


def _row(cells: list[str]) -> str:
    return "| " + " | ".join(cells) + " |\n"


def _table(head: list[str], rows: list[list[str]]) -> str:
    return _row(head) + _row(["---"] * len(head)) + "".join(_row(r) for r in rows)


def _cell(entry: dict[str, Any]) -> str:
    median = "" if entry["median_px"] is None else f" ({entry['median_px']:.1f})"
    return f"{entry['percent']:.0f}{median}"


def _steps(found: dict[str, Any]) -> str:
    table = found["table"]
    sizes = list(next(iter(table.values())))
    rows = [[name, *(_cell(table[name][s]) for s in sizes)] for name in ORDER if name in table]
    return f"{found['targets']} targets in {found['worlds']} worlds.\n\n" + _table(
        ["step, % of the range", *sizes], rows
    )


def _orbit(found: dict[str, Any]) -> str:
    table = found["table"]
    steps = list(next(iter(table.values())))
    rows = [[name, *(_cell(by[s]) for s in steps)] for name, by in table.items()]
    return f"{found['targets']} targets, 70 degrees round each.\n\n" + _table(
        ["azimuth step", *(f"{s}°" for s in steps)], rows
    )


def _turn(found: dict[str, Any]) -> str:
    table = found["table"]
    steps = list(next(iter(table.values())))
    rows = [[name, *(_cell(by[s]) for s in steps)] for name, by in table.items()]
    return f"{found['targets']} targets, 90 degrees turned in all.\n\n" + _table(
        ["turn per step", *(f"{s}°" for s in steps)], rows
    )


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
    return f"{found['targets']} targets, roll {low:.0f} to {high:.0f} degrees.\n\n" + _table(
        ["", "correct, %", "at roll ≥ 15°, %", "score ≥ 0.7, %", "false accepts, %"], rows
    )


def _accuracy(found: dict[str, Any]) -> str:
    rows = []
    for name, by in found.items():
        for kind in ("published", "formula", "simulated"):
            v = by[f"{kind}_cm"]
            rows.append([name if kind == "published" else "", kind, *(f"{x:.2f}" for x in v)])
    return _table(
        ["camera", "", "stereo at 10 m", "untracked at 2 m", "stereo at 2 m", "per pixel of drift"], rows
    )


def _flight(found: dict[str, Any]) -> str:
    published = {
        "magnification": [1.04, 1.03, 1.03, 1.01, 1.00, 0.97, 1.04],
        "roll_deg": [2.46, 2.46, 2.92, 3.27, 3.27, 0.06, 6.25],
        "ncc": [0.88, 0.88, 0.85, 0.87, 0.87, 0.94, 0.79],
    }
    one = found["checkout_1"]
    rows = []
    for key, label in (
        ("magnification", "magnification"),
        ("roll_deg", "roll, degrees"),
        ("ncc", "NCC score"),
    ):
        rows.append([label, "flight", *(f"{v:.2f}" for v in published[key])])
        for name, by in one["rows"].items():
            rows.append(["", name, *(f"{v:.2f}" for v in by[key])])
    fitted = one["fitted"]
    text = _table(["", "", *(str(n) for n in range(2, 9))], rows)
    text += (
        f"\nFitted to the published azimuths and magnifications: target {fitted['bearing_deg']:.0f}° off the "
        f"first heading, {fitted['heading_change_per_move_deg']:.1f}° of heading change a move, mast recedes "
        f"{100 * fitted['recoil_in_turn_m']:.0f} cm in the turn.\n"
    )
    runs = found["checkout_2"]
    ends = [100 * r["end_error_m"] for r in runs]
    totals = [100 * r["total_correction_m"] for r in runs]
    pixels = [r["largest_correction_px"] for r in runs]
    scores = [r["least_ncc"] for r in runs]
    text += (
        f"\nFrom 9.65 m to 1.92 m, {len(runs)} runs of {runs[0]['steps']} steps to rocks of 14 cm: end "
        f"error {min(ends):.1f} to {max(ends):.1f} cm, target corrected by {min(totals):.0f} to "
        f"{max(totals):.0f} cm in all (flight: 36 cm), by at most {max(pixels):.0f} px at a stop (11), "
        f"least score {min(scores):.2f} (0.85).\n"
    )
    return text


def _nominal(found: dict[str, Any]) -> str:
    ends = found["end_error_cm"]
    return (
        _table(
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
    return _table(
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
