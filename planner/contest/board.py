"""The board: a line of JSON for each plan that was checked, and the table that follows from the lines."""

from __future__ import annotations

import json
import statistics
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from planner.errors import PlannerError


@dataclass(frozen=True, slots=True)
class Entry:
    """One plan of one planner for one instance, valued by the checker; `upper` is proven for every policy.

    A plan that the checker refused, or that never came, has the value 0 and says why in `refused`.
    """

    planner: str
    instance: str
    digest: str
    branches: int
    max_branches: int
    value: float
    standard_error: float
    futures: int
    seed: int
    upper: float
    overruns: float
    cpu_s: float
    version: str
    machine: str
    refused: str = ""

    @property
    def per_cent(self) -> float:
        """Return the value in per cent of what no policy exceeds."""
        return 100.0 * self.value / self.upper if self.upper > 0 else 100.0


def append(path: Path, entry: Entry) -> None:
    """Add an entry to a board, which is made if there is none."""
    with path.open("a", encoding="utf-8") as board:
        board.write(json.dumps(asdict(entry)) + "\n")


def read_board(path: Path) -> list[Entry]:
    """Return the entries of a board, oldest first.

    Raises
    ------
    PlannerError
        If it cannot be read; the message names the line.
    """
    found = []
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as err:
        raise PlannerError(f"{path}: {err}") from err
    for number, line in enumerate(lines, 1):
        try:
            found.append(Entry(**json.loads(line)))
        except (ValueError, TypeError) as err:
            raise PlannerError(f"{path}, line {number}: no entry of a board: {err}") from err
    return found


def newest(entries: Iterable[Entry]) -> list[Entry]:
    """Return the last entry of each planner, instance and number of branches."""
    return list({(e.planner, e.digest, e.max_branches): e for e in entries}.values())


def table(entries: Sequence[Entry]) -> str:
    """Return the board in Markdown: planners by their mean per cent of the bound, on what all of them tried.

    An instance that one of them has no entry for counts for none, and is said.
    """
    by_planner: dict[tuple[str, int], dict[str, Entry]] = defaultdict(dict)
    for entry in newest(entries):
        by_planner[entry.planner, entry.max_branches][entry.digest] = entry
    if not by_planner:
        return "The board is empty."
    shared = set.intersection(*(set(found) for found in by_planner.values()))
    every = set.union(*(set(found) for found in by_planner.values()))
    rows = []
    for (planner, most), found in by_planner.items():
        mine = [found[digest] for digest in shared]
        if not mine:
            continue
        shares = [entry.per_cent for entry in mine]
        used, over, cpu_s = (
            statistics.mean(told)
            for told in zip(*((e.branches, e.overruns, e.cpu_s) for e in mine), strict=True)
        )
        cells = (
            planner,
            str(most),
            f"{statistics.mean(shares):.2f}",
            f"{min(shares):.2f}",
            f"{used:.1f}",
            f"{100 * over:.1f}",
            f"{cpu_s:.1f}",
            str(sum(bool(e.refused) for e in mine)),
        )
        rows.append((-statistics.mean(shares), f"| {' | '.join(cells)} |"))
    head = (
        f"{len(shared)} instances; value in per cent of what no policy exceeds.\n\n"
        "| planner | branches allowed | mean | least | branches used | overruns % | CPU s | refused |\n"
        "|---|---|---|---|---|---|---|---|\n"
    )
    left = (
        f"\n\n{len(every - shared)} instances that not every planner tried are left out."
        if every - shared
        else ""
    )
    return head + "\n".join(row for _, row in sorted(rows)) + left
