"""What a benchmark says: figures, each with its limit; and the command line that all benchmarks have.

A benchmark is a module of `benchmarks` with `figures(...)`, which yields each `Figure` as soon as it is
measured and whose keyword arguments are the options of its command line; `QUICK`, the options of a run that
shows only that it works; and `BUDGET_S`, wall seconds after which `scripts/bench` ends it. A limit that was
set for one size is not checked against a figure of another.
"""

from __future__ import annotations

import argparse
import inspect
import json
import signal
import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

Figures = Callable[..., Iterable["Figure"]]


@dataclass(frozen=True, slots=True)
class Figure:
    """One thing that was measured.

    `limit` is the most that is allowed, with `least` the least. Where there is a `ratio`, to what `to` says,
    the limit is the ratio's; else it is the value's, in its `unit`.
    """

    name: str
    value: float
    unit: str = ""
    limit: float | None = None
    least: bool = False
    ratio: float | None = None
    to: str = ""

    def __post_init__(self) -> None:
        if (self.ratio is None) != (not self.to):
            raise ValueError(f"figure {self.name}: a ratio of {self.ratio} to {self.to!r}; both or neither")

    @property
    def exceeded(self) -> bool:
        """Whether the limit is exceeded; what is not a number exceeds every limit."""
        if self.limit is None:
            return False
        judged = self.value if self.ratio is None else self.ratio
        return not (judged >= self.limit if self.least else judged <= self.limit)

    @property
    def verdict(self) -> str:
        """Return `ok`, `over`, `under`, or nothing if there is no limit."""
        if self.limit is None:
            return ""
        return "ok" if not self.exceeded else "under" if self.least else "over"

    def cells(self) -> list[str]:
        """Return name, what was measured, limit and verdict as text."""
        measured = f"{number(self.value)} {self.unit}".strip()
        if self.ratio is not None:
            measured += f", {number(self.ratio)} times {self.to}"
        if self.limit is None:
            return [self.name, measured, "", ""]
        unit = self.unit if self.ratio is None else "times"
        bound = f"{'at least' if self.least else 'at most'} {number(self.limit)} {unit}".strip()
        return [self.name, measured, bound, self.verdict]

    def as_line(self) -> str:
        """Return the figure as a line of JSON."""
        return json.dumps(asdict(self)) + "\n"


HEAD = ["figure", "measured", "limit", ""]


def number(value: float) -> str:
    """Return a number in three digits, from one on in four, from a thousand on in whole ones."""
    if 999.95 <= abs(value) < 1e15:
        return f"{value:,.0f}"
    return f"{value:.4g}" if abs(value) >= 1.0 else f"{value:.3g}"


def command(figures: Figures, quick: Mapping[str, Any], budget_s: float) -> None:
    """Measure as the command line says and print; end with 1 if a limit is exceeded.

    With `--into FILE` the budget and then each figure are added to a file, a line of JSON each.
    """
    parser = argparse.ArgumentParser(
        description=sys.modules[figures.__module__].__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    for name, parameter in inspect.signature(figures).parameters.items():
        parser.add_argument(f"--{name.replace('_', '-')}", **_option(parameter.default))
    parser.add_argument("--quick", action="store_true", help=f"small: {dict(quick)}")
    parser.add_argument("--into", type=Path, default=None, help=argparse.SUPPRESS)
    given = vars(parser.parse_args())
    into: Path | None = given.pop("into")
    options = {**quick, **given} if given.pop("quick") else given
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job ignores it
    _add(into, json.dumps({"budget_s": budget_s}) + "\n")
    exceeded = False
    for figure in figures(**options):
        print("  ".join(cell for cell in figure.cells() if cell), flush=True)
        _add(into, figure.as_line())
        exceeded |= figure.exceeded
    raise SystemExit(1 if exceeded else 0)


def _option(default: Any) -> dict[str, Any]:
    """Return how argparse is to read an option of this default; one that is not given is left away."""
    told = {"default": argparse.SUPPRESS, "help": f"default {default}"}
    if isinstance(default, bool):
        return {**told, "action": "store_true", "help": None}
    if isinstance(default, tuple):
        return {**told, "nargs": "*", "type": type(default[0]) if default else str}
    return {**told, "type": type(default)}


def _add(into: Path | None, line: str) -> None:
    if into is not None:
        with into.open("a", encoding="utf-8") as file:
            file.write(line)
