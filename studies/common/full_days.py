"""Days of fresh seeds on the `full` rover, targets by the plain rule, each judged by the truth.

A day is kept in its own folder, so that a study that was stopped goes on. What a day raises is caught here
and nowhere else, and told as an exception; so is what an action raised, which the rover tells as an internal
error and goes on.
"""

from __future__ import annotations

import json
import secrets
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from multiprocessing import get_context
from pathlib import Path
from statistics import median
from traceback import format_exception
from typing import Any

from rover_iface.simulator.engine import INTERNAL_ERROR
from studies.common.day_fates import failures, not_begun
from studies.common.day_grounds import GENERATED, curiosity_names, ground_of
from studies.common.judged_fates import MEASURED_M, Judged, judged_fates
from studies.common.plain_day import fly_plain_day, processor_s

GROUNDS = (GENERATED, "curiosity", "both")
PROCESSOR_S, ANSWERED, MEASURED = 360.0, 0.85, 0.50
"""Asked of such days: processor time of each; of the targets that were approached, the share that was
measured or rightly refused, and the share that was measured."""
ENDS = ("measured", "refused_rightly", "refused_wrongly", "failed")
"""Of a target that was approached, just one."""
COUNTS = ("asked", "approached", *ENDS, "wrong", "unsafe")

Row = dict[str, Any]


def drawn_days(folder: Path, count: int, ground: str) -> list[tuple[str, int]]:
    """Return the grounds and seeds of the first `count` days of a folder; what it lacks is drawn now."""
    kept = folder / "drawn.json"
    days: list[tuple[str, int]] = []
    if kept.is_file():
        days = [(str(name), int(seed)) for name, seed in json.loads(kept.read_text("utf-8"))]
    names = [GENERATED] if ground == GENERATED else list(curiosity_names())
    if ground == "both":
        names = [each for name in names for each in (GENERATED, name)]
    while len(days) < count:
        days.append((names[len(days) % len(names)], secrets.randbelow(2**30)))
    folder.mkdir(parents=True, exist_ok=True)
    kept.write_text(json.dumps(days) + "\n", encoding="utf-8")
    return days[:count]


def fly_days(folder: Path, days: Sequence[tuple[str, int]]) -> list[Row]:
    """Return what came of each day, flown now or kept from before."""
    rows = []
    for ground, seed in days:
        out = folder / f"{ground}-{seed}"
        kept = out / "day.json"
        if not kept.is_file():
            # a process of its own: what it raises, or how it dies, is an answer, and its time is the day's
            with ProcessPoolExecutor(1, get_context("spawn")) as pool:
                future = pool.submit(_flown, ground, seed, out)
                err = future.exception()
            row = future.result() if err is None else _raised(ground, seed, err)
            out.mkdir(parents=True, exist_ok=True)
            kept.write_text(json.dumps(row, indent=1) + "\n", encoding="utf-8")
        rows.append(json.loads(kept.read_text("utf-8")))
        print(_brief(rows[-1]), flush=True)
    return rows


def _raised(ground: str, seed: int, err: BaseException) -> Row:
    told = f"{type(err).__name__}: {err}"
    return {"ground": ground, "seed": seed, "exception": told, "traceback": format_exception(err)}


def _flown(ground: str, seed: int, out: Path) -> Row:
    day = fly_plain_day("full", seed, out, lambda: ground_of(ground, seed))
    judged, failed = judged_fates(day, out), failures(out)
    return {
        **row_of(ground, seed, judged),
        "stages": day.spent,
        "hours": (day.flight.outcome.end_s or 0.0) / 3600,
        "driven_m": day.driven_m,
        "outcome": day.flight.outcome.outcome,
        "internal_errors": sum(INTERNAL_ERROR in why for why in failed),
        "failures": failed + not_begun(out, day.rover.truth.history),
    }


def row_of(ground: str, seed: int, judged: Sequence[Judged]) -> Row:
    """Return how many targets of a day came to each end, and what each came to."""
    approached = [one for one in judged if one.approached]
    ends = Counter(_end(one) for one in approached)
    return {
        "ground": ground,
        "seed": seed,
        "exception": "",
        "internal_errors": 0,
        "asked": len(judged),
        "approached": len(approached),
        **{name: ends[name] for name in ENDS},
        "wrong": sum(one.fate.wrong for one in judged),
        "unsafe": sum(bool(one.unsafe) for one in judged),
        "untold": sum(not one.told for one in judged),
        "targets": [
            {**asdict(one), "end": _end(one) if one.approached else "not approached"} for one in judged
        ],
    }


def _end(one: Judged) -> str:
    if one.measured:
        return "measured"
    if one.refused_rightly:
        return "refused_rightly"
    return "refused_wrongly" if one.refused else "failed"


def _brief(row: Row) -> str:
    day = f"{row['ground']} {row['seed']}"
    if row["exception"]:
        return f"{day}: {row['exception']}"
    counts = ", ".join(f"{row[name]} {name.replace('_', ' ')}" for name in COUNTS)
    return f"{day}: {counts}; {processor_s(row['stages']):.0f} s of a processor"


def report(rows: Sequence[Row]) -> str:
    """Return as Markdown what days come to beside what is asked, each day, and each target's fate."""
    return "\n\n".join((line(rows), days_table(rows), targets_table(rows)))


def line(rows: Sequence[Row]) -> str:
    """Return what the days come to, beside what is asked for."""
    flown = [row for row in rows if not row["exception"]]
    total = {name: sum(row[name] for row in flown) for name in (*COUNTS, "untold", "internal_errors")}
    raised = len(rows) - len(flown) + total["internal_errors"]
    near = total["approached"]
    if not near:
        return f"{len(rows)} days, {raised} exceptions; no target was approached."
    answered = total["measured"] + total["refused_rightly"]
    used_s = [processor_s(row["stages"]) for row in flown]
    return " ".join(
        (
            f"{len(rows)} days, {raised} exceptions, {total['untold']} failures without a reason.",
            f"Of {total['asked']} targets {near} were approached.",
            f"Measured within {100 * MEASURED_M:.0f} cm: {total['measured']}",
            f"({100 * total['measured'] / near:.0f} %; {100 * MEASURED:.0f} asked).",
            f"Refused where the truth says unsafe or out of reach: {total['refused_rightly']}; both together",
            f"{100 * answered / near:.0f} % ({100 * ANSWERED:.0f} asked).",
            f"Refused where it says safe and in reach: {total['refused_wrongly']}; failed otherwise:",
            f"{total['failed']}. Claimed and wrong: {total['wrong']}; put where the surface is truly unsafe:",
            f"{total['unsafe']}. A day took {median(used_s):.0f} s of a processor in the median,",
            f"{max(used_s):.0f} at most ({PROCESSOR_S:.0f} asked).",
        )
    )


def days_table(rows: Sequence[Row]) -> str:
    """Return a row a day as Markdown."""
    head = ("ground", "seed", "processor", "driven", "asked", "approached", "measured within 1 cm",
            "refused, truth agrees", "refused, truth: safe and in reach", "failed otherwise",
            "claimed and wrong", "what failed and why")  # fmt: skip
    cells = [head, ("---",) * len(head)]
    for row in rows:
        day = (row["ground"], str(row["seed"]))
        if row["exception"]:
            cells.append((*day, *("-",) * (len(head) - 3), f"**exception** {row['exception']}"))
            continue
        counts = ("asked", "approached", "measured", "refused_rightly", "refused_wrongly", "failed", "wrong")
        used_s, driven_m = processor_s(row["stages"]), row["driven_m"]
        why = "; ".join(row["failures"]) or "nothing"
        cells.append((*day, f"{used_s:.0f} s", f"{driven_m:.0f} m", *(str(row[n]) for n in counts), why))
    return _markdown(cells)


def targets_table(rows: Sequence[Row]) -> str:
    """Return every target that was not measured as Markdown, and how far off the others are."""
    head = ("ground", "seed", "target", "what happened", "off by truth, cm", "truth", "why")
    cells = [head, ("---",) * len(head)]
    off: list[float] = []
    for row in rows:
        for one in row.get("targets", ()):
            fate, truth = one["fate"], one["truth"]
            if one["end"] == "measured":
                off.append(100 * fate["off_m"])
                continue
            away = "-" if fate["off_m"] is None else f"{100 * fate['off_m']:.1f}"
            told = "not approached"
            if truth is not None:
                told = truth["answer"] + (f": {truth['why']}" if truth["why"] else "")
            cells.append(
                (
                    row["ground"],
                    str(row["seed"]),
                    fate["target"],
                    fate["what"],
                    away,
                    told,
                    fate["why"] or "-",
                )
            )
    middle = f"{median(off):.2f} cm off in the median, {max(off):.2f} at most" if off else "none"
    return f"Measured: {middle}. All others:\n\n{_markdown(cells)}"


def _markdown(cells: Sequence[Sequence[str]]) -> str:
    return "\n".join("| " + " | ".join(row) + " |" for row in cells)
