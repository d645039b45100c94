"""Two campaigns against each other: in pairs where they share their seeds, else as independent samples."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from ground.campaigns.folder import CampaignFolder
from ground.campaigns.intervals import Moments, mean_interval, student
from ground.campaigns.result import RESULTS, CampaignResult, Difference
from ground.campaigns.row import Row
from ground.campaigns.tally import bounds
from ground.errors import InvalidInputError


@dataclass(frozen=True, slots=True)
class Comparison:
    """The second campaign minus the first. `examples` differ most, the worst loss first."""

    difference: Difference
    paired: bool
    examples: tuple[tuple[int, float, float], ...] = ()


def paired(rows: Iterable[Row], base: Iterable[Row], name: str) -> Difference:
    """Return `rows` minus `base`, seed by seed.

    Raises
    ------
    InvalidInputError
        If the seeds are not the same.
    """
    apart, here, there = Moments(), Moments(), Moments()
    better = worse = 0
    for row, other in zip(rows, base, strict=True):
        if row.seed != other.seed:
            raise InvalidInputError(f"{name}: seed {row.seed} stands against seed {other.seed}")
        step = row.utility - other.utility
        apart.add(step)
        here.add(row.utility)
        there.add(other.utility)
        better += step > 0
        worse += step < 0
    ratio = (here.sd**2 + there.sd**2) / apart.sd**2 if apart.sd > 0 else None
    error = apart.standard_error
    interval = bounds(mean_interval(apart.mean, error, apart.runs))
    return Difference(name, apart.runs, apart.mean, error, interval, better, worse, ratio)


def compare(first: CampaignFolder, second: CampaignFolder) -> Comparison:
    """Return the second campaign minus the first.

    Raises
    ------
    InvalidInputError
        If one has not ended, or they share some seeds and not all: neither pairs nor independent.
    """
    a, b = result_in(first), result_in(second)
    range_a, range_b = range(a.seed, a.seed + a.runs), range(b.seed, b.seed + b.runs)
    name = f"{second.path} minus {first.path}"
    apart = range_a.stop <= range_b.start or range_b.stop <= range_a.start
    if a.futures == b.futures and range_a == range_b:
        difference = paired(second.rows(runs=b.runs), first.rows(runs=a.runs), name)
        examples = tuple(_most_different(first.rows(runs=a.runs), second.rows(runs=b.runs)))
        return Comparison(difference, True, examples)
    if a.futures == b.futures and not apart:
        raise InvalidInputError(
            f"the seeds overlap in part: {first.path} has {range_a.start} to {range_a.stop - 1}, "
            f"{second.path} {range_b.start} to {range_b.stop - 1}; the same seeds make "
            "pairs, wholly different ones are independent"
        )
    return Comparison(_welch(a, b, name), False)


def result_in(folder: CampaignFolder) -> CampaignResult:
    """Return the result in a folder; raises as `CampaignFolder.result_document`, or if it is malformed."""
    return RESULTS.from_document(folder.result_document(), str(folder.path))


def _most_different(first: Iterable[Row], second: Iterable[Row]) -> Iterator[tuple[int, float, float]]:
    steps = [
        (b.utility - a.utility, a.seed, a.utility, b.utility) for a, b in zip(first, second, strict=True)
    ]
    steps.sort()
    for step, seed, before, after in [*steps[:3], *[s for s in steps[-3:] if s not in steps[:3]]]:
        if step:
            yield seed, before, after


def _welch(a: CampaignResult, b: CampaignResult, name: str) -> Difference:
    """Return the difference of independent means (Welch 1947)."""
    va, vb = a.utility.standard_error**2, b.utility.standard_error**2
    error = math.sqrt(va + vb)
    mean = b.utility.mean - a.utility.mean
    if a.runs < 2 or b.runs < 2 or error == 0:
        interval = (-math.inf, math.inf) if error else (mean, mean)
    else:
        freedom = (va + vb) ** 2 / (va**2 / (a.runs - 1) + vb**2 / (b.runs - 1))
        half = student(freedom) * error
        interval = (mean - half, mean + half)
    return Difference(name, min(a.runs, b.runs), mean, error, bounds(interval), 0, 0)


def comparison_lines(found: Comparison) -> Iterator[str]:
    """Yield what a terminal is told of a comparison."""
    d = found.difference
    ends = ["-" if end is None else f"{end:+.4f}" for end in (d.interval.low, d.interval.high)]
    how = f"{d.runs:,} pairs" if found.paired else f"independent seeds, at least {d.runs:,} runs each"
    yield f"{d.name}: {d.mean:+.4f} +- {d.standard_error:.4f} ({ends[0]} to {ends[1]}), {how}"
    if found.paired:
        saved = "" if d.variance_ratio is None else f"; pairs save a factor of {d.variance_ratio:.1f} in runs"
        yield f"  better in {d.better:,} runs, worse in {d.worse:,}{saved}"
    for seed, before, after in found.examples:
        yield f"  seed {seed}: {before:g} to {after:g}"
