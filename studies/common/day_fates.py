"""What became of each target of a flown day, told by the run's own records and judged by the truth."""

from __future__ import annotations

import json
import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rover_iface.simulator.truth import TrackRecord

CLAIMED_WRONG_M = 0.02
"""A placement further from the target than this, told as made, is claimed and wrong."""
PLACED, NO_PRODUCT, WRONG = "placed", "placed, no product", "claimed and wrong"
REFUSED = "refused on arrival"


@dataclass(frozen=True, slots=True)
class Fate:
    """What became of a target.

    Attributes
    ----------
    what, why
        One of a few words, and the reason that the rover or the planner gave.
    range_m
        How far away the target was when the tracker last answered; None if it never did.
    off_m
        By truth: how far from the target the tool touched, without a touch how far off the tracker last had
        it (the mast's error is in it); None if it was never tracked.
    """

    target: str
    what: str
    why: str
    range_m: float | None
    off_m: float | None

    @property
    def placed(self) -> bool:
        """Return whether the tool stands on the target, whatever the instrument delivered."""
        return self.what in (PLACED, NO_PRODUCT)

    @property
    def wrong(self) -> bool:
        """Return whether it stands elsewhere and that was told as made."""
        return self.what == WRONG


def fates(
    out: Path,
    targets: Iterable[str],
    refused: Mapping[str, str],
    history: Sequence[TrackRecord],
) -> list[Fate]:
    """Return what became of each target of the run in folder `out`.

    `refused` holds why a target was refused before the day, `history` every answer of the tracker in time.
    """
    ends = _ends(out)
    told = {node_of(row["command"][1]): row for row in results(out)}
    found = []
    for target in targets:
        request = f"R{target.removeprefix('T')}"
        drive, placing = told.get(f"navigate-{target}"), told.get(f"observe-{request}")
        # what is told of it on later drives is of other stops
        left_s = _left_s(ends, f"navigate-{target}", "" if placing is None else f"observe-{request}")
        seen = [r for r in history if r.target == target and r.t_s <= left_s]
        what, why, off_m = "tracked", "", seen[-1].error_m if seen else None
        lost = next((r for r in reversed(seen) if r.reasons), None)
        if target in refused:
            what, why = "not in the plan", refused[target]
        elif f"navigate-{target}" not in ends:
            what, why = "no drive in the plan", ""
        elif placing is not None and placing["values"].get("made") is True:
            off_m = float(placing["values"]["placement_error_m"])
            what, why = (PLACED if placing["success"] else NO_PRODUCT), placing["reason"]
            if off_m > CLAIMED_WRONG_M:
                what = WRONG
        elif placing is not None:
            what, why = REFUSED, placing["reason"]
        elif drive is not None and drive["success"]:
            what, why = "lost on arrival", "; ".join(lost.reasons) if lost else ""
        elif drive is not None:
            what, why = "did not arrive", drive["reason"]
        elif seen and seen[-1].state != "tracked":
            what, why = "lost before its drive", "; ".join(lost.reasons) if lost else ""
        else:
            what, why = "drive not begun", ends[f"navigate-{target}"].how
        found.append(Fate(target, what, why, seen[-1].range_m if seen else None, off_m))
    return found


def failures(out: Path) -> list[str]:
    """Return task and reason of every drive and placement that failed."""
    return [
        f"{event['command'][1]}: {event['reason'].split('; ')[0]}"
        for event in results(out)
        if not event["success"]
    ]


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


@dataclass(frozen=True, slots=True)
class _End:
    """When a node of a run ended, s, and how."""

    t_s: float
    how: str


def _ends(out: Path) -> dict[str, _End]:
    """Return how each node of a run ended that the plan holds; of those in several branches the one taken."""
    found: dict[str, _End] = {}
    for record in (json.loads(line) for line in (out / "trace.jsonl").read_text("utf-8").splitlines()):
        if record[1] == "end":
            node, end = node_of(str(record[2])), " ".join(str(v) for v in record[3:])
            if node not in found or not end.startswith("SKIPPED"):
                found[node] = _End(float(record[0]), end)
    return found


def _left_s(ends: Mapping[str, _End], *nodes: str) -> float:
    """Return when the last of some nodes ended, s; infinity where none of them did.

    A trace has whole milliseconds.
    """
    return max((ends[node].t_s + 0.001 for node in nodes if node in ends), default=math.inf)


def node_of(task: str) -> str:
    """Return the name of a task without the number that tells those of several branches apart."""
    return re.sub(r"-\d+$", "", task)


def results(out: Path) -> Iterator[dict[str, Any]]:
    """Yield the results of a run's tasks, in time."""
    for line in (out / "journal.jsonl").read_text("utf-8").splitlines():
        yield from (e for e in json.loads(line).get("events", ()) if e["e"] == "result")


def fate_table(days: Mapping[int, Sequence[Fate]]) -> str:
    """Return the fates of days by seed as Markdown: how many of each kind, then every target not placed."""
    kinds = Counter(fate.what for day in days.values() for fate in day)
    rows = [("what happened", "targets"), ("---", "---")]
    rows += [(what, str(count)) for what, count in kinds.most_common()]
    each = [("seed", "target", "what happened", "last seen from, m", "off by truth, cm", "why"), ("---",) * 6]
    for seed, day in days.items():
        for fate in day:
            away = "-" if fate.range_m is None else f"{fate.range_m:.1f}"
            off = "-" if fate.off_m is None else f"{100 * fate.off_m:.1f}"
            each.append((str(seed), fate.target, fate.what, away, off, fate.why or "-"))
    return "\n\n".join("\n".join("| " + " | ".join(row) + " |" for row in table) for table in (rows, each))
