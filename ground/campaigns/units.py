"""A campaign cut into units: so many seeds of a case, flown by one process and sent back as text."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from ground.campaigns.case import Case
from ground.campaigns.pilot import pilot_of
from ground.tracing import Part, now_ns, this_place

FAST_UNIT, SLOW_UNIT = 100, 1
"""Runs of a unit: a quarter of a second of the abstract rover, one run of a rover in a terrain. What is lost
when a process dies is a unit."""


@dataclass(frozen=True, slots=True)
class Unit:
    """Runs `first` to `first + count - 1` of a case, by seed; `series` names the case."""

    series: str
    index: int
    first: int
    count: int


def unit_size(rover: str) -> int:
    """Return how many runs of a rover make a unit."""
    return FAST_UNIT if rover == "abstract" else SLOW_UNIT


def cut(series: str, seed: int, runs: int, size: int) -> Iterator[Unit]:
    """Yield the units of a series of seeds, in order; the last may be shorter."""
    for index in range((runs + size - 1) // size):
        done = index * size
        yield Unit(series, index, seed + done, min(size, runs - done))


def fly_unit(case: Case, unit: Unit) -> str:
    """Return the rows of a unit, a line each. Pure: the same on every machine that runs this program."""
    pilot = pilot_of(case)
    return "".join(pilot.row(seed).line() + "\n" for seed in range(unit.first, unit.first + unit.count))


def fly_noted(case: Case, unit: Unit) -> tuple[str, Part]:
    """Return the rows of a unit, and when and in which process it was flown."""
    began_ns = now_ns()
    text = fly_unit(case, unit)
    return text, Part(f"unit {unit.series or 'main'} {unit.index}", began_ns, now_ns(), this_place())
