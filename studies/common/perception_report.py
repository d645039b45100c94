"""Writes what the perception studies found into docs/results/tracking.md."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from studies.common.pages import table, write_sections


def write_report(results: dict[str, Any], docs: Path) -> None:
    """Replace the generated sections of the page."""
    write_sections(
        docs,
        "tracking",
        results,
        {"approach": _approach, "coverage": _coverage, "faults": _faults, "registration": _registration},
    )


def _end(entry: dict[str, float]) -> str:
    return f"{entry['median']:.2f} / {entry['p95']:.2f} / {entry['max']:.2f}"


def _approach(results: dict[str, Any]) -> str:
    found = results["approach"]["table"]
    names = list(found["shipped"]["ends"])
    rows = [
        [f"{kind}, in all", *(_end(found[kind]["ends"][n]) for n in names)]
        for kind in ("shipped", "published")
    ]
    rows += [[f"{kind}, across", *(_end(entry["aside"][n]) for n in names)] for kind, entry in found.items()]
    runs = sum(int(e["runs"]) for e in found["shipped"]["ends"].values())
    worlds = len(results["approach"]["worlds"])
    return f"{runs} approaches in {worlds} worlds.\n\n" + table(["end error, cm", *names], rows)


def _coverage(results: dict[str, Any]) -> str:
    found = results["approach"]["table"]
    rows = []
    for kind in ("shipped", "published"):
        entry = found[kind]
        by = [f"{part['covered_percent']:.0f} ({part['median_cm']:.1f})" for part in entry["by_range"]]
        rows.append([kind, str(entry["updates"]), f"{entry['covered_percent']:.1f}", *by])
    spans = [
        f"{low:.0f} to {high:.0f} m" for low, high in (p["range_m"] for p in found["shipped"]["by_range"])
    ]
    return table(["method", "updates", "inside, %", *spans], rows)


def _faults(results: dict[str, Any]) -> str:
    found = results["faults"]
    rows = [
        [kind, str(e["runs"]), str(e["lost"]), str(e["recovered"]), str(e["failed"]), _end(e["ends"])]
        for kind, e in found["kinds"].items()
    ]
    auc = "none was" if found["auc"] is None else f"area under the curve {found['auc']:.3f}"
    return (
        table(["what", "runs", "lost for a time", "found again", "failed", "end error, cm"], rows)
        + f"\n{found['updates']} updates, {found['wrong']} of them more than 5 cm off across the line of "
        f"sight: {auc}; {found['told_percent']:.1f} % of them were told as lost, alarms more than two "
        f"updates late: {found['late_alarms']}. At stops where nothing was wrong "
        f"{found['false_alarms_percent']:.2f} % of the answers were false alarms.\n"
    )


TESTED = ("shipped", "surfaces alone", "published")
"""Engines that say which of their registrations are to be believed."""


def _registration(results: dict[str, Any]) -> str:
    found = results["registration"]
    engines = found["engines"]
    pairs = list(engines["shipped"])
    rows = []
    for engine, by in engines.items():
        for pair in pairs:
            e = by[pair]
            kept = "-"
            if e["accepted_median_cm"] is not None:
                kept = " / ".join(f"{e[f'accepted_{q}_cm']:.2f}" for q in ("median", "p95", "max"))
            share = f"{e['accepted_percent']:.0f}" if engine in TESTED else "all, untold"
            rows.append(
                [
                    engine,
                    pair,
                    str(e["trials"]),
                    f"{e['within_1_percent']:.0f}",
                    share,
                    kept,
                    f"{e['cpu_s']:.2f} / {e['cpu_max_s']:.2f}",
                ]
            )
    worlds = f"{len(found['worlds'])} worlds ({found['worlds'][0]} to {found['worlds'][-1]})"
    made = f"{found['surface_cpu_s']:.2f} and {found['features_cpu_s']:.2f} CPU s"
    head = ["engine", "surfaces", "trials", "within 1 cm, %", "accepted, %", "accepted: error cm", "CPU s"]
    return (
        f"{worlds}. Errors: median / 95 % / worst; CPU s: median / worst. What a view is asked for once, its "
        f"surface and its features, takes {made} (median) and is not in them.\n\n"
    ) + table(head, rows)
