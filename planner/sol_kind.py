"""Kinds of sols that a plan cannot tell beforehand: what all drives, or all energies, of one have in common.

A slow sol (slip, loose ground) lengthens every drive, a hungry one (cold, dust) raises every energy. One kind
is drawn for the sol and hidden; only elapsed time and energy used reveal it. Durations that are independent
of each other understate the spread of a day in which they are long together.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from mission.codec import shown
from planner.errors import ProblemError
from planner.problem_document import SolKindDocument

ORDINARY_NAME = "ordinary"

ROUNDING = 1e-9
"""By how much probabilities may exceed 1 in sum: three sixths are written with sixteen digits."""


@dataclass(frozen=True, slots=True)
class SolKind:
    """A kind of sol and its probability `p`; the factors multiply what the problem states.

    `drive_time_factor` and `drive_energy_factor` are on times and energies of legs, `energy_factor` on all
    energies: those of legs (again), observations, starts of tracks, and the hotel load.
    """

    name: str
    p: float
    drive_time_factor: float = 1.0
    drive_energy_factor: float = 1.0
    energy_factor: float = 1.0


def read_kinds(documents: Sequence[SolKindDocument]) -> tuple[SolKind, ...]:
    """Return the kinds of sols that a problem states.

    Raises
    ------
    ProblemError
        If a name is used twice or is that of the ordinary sol, or the probabilities exceed 1 in sum.
    """
    for name, count in Counter(d["name"] for d in documents).items():
        if name == ORDINARY_NAME:
            raise ProblemError(f'sol kind "{name}" is kept for sols whose factors are 1')
        if count > 1:
            raise ProblemError(f"sol kind {shown(name)} is given twice")
    total = math.fsum(d["p"] for d in documents)
    if total > 1.0 + ROUNDING:
        raise ProblemError(f"problem sol_kinds[].p sum to {total:.12g}; the sum must be at most 1")
    return tuple(
        SolKind(
            d["name"],
            d["p"],
            _factor(d.get("drive_time_factor")),
            _factor(d.get("drive_energy_factor")),
            _factor(d.get("energy_factor")),
        )
        for d in documents
    )


def _factor(given: float | None) -> float:
    return 1.0 if given is None else given


def written_kinds(kinds: Sequence[SolKind]) -> tuple[SolKindDocument, ...]:
    """Return kinds of sols as a problem states them."""
    return tuple(
        {
            "name": kind.name,
            "p": kind.p,
            "drive_time_factor": kind.drive_time_factor,
            "drive_energy_factor": kind.drive_energy_factor,
            "energy_factor": kind.energy_factor,
        }
        for kind in kinds
    )


def all_kinds(kinds: Sequence[SolKind]) -> tuple[SolKind, ...]:
    """Return the kinds that may come, with the ordinary sol last where it may; their `p` sum to 1."""
    total = math.fsum(kind.p for kind in kinds)
    rest = 1.0 - total
    scale = 1.0
    if rest <= ROUNDING:
        rest, scale = 0.0, 1.0 / total if total > 0.0 else 1.0
    may_come = tuple(
        SolKind(k.name, k.p * scale, k.drive_time_factor, k.drive_energy_factor, k.energy_factor)
        for k in kinds
        if k.p > 0.0
    )
    return (*may_come, SolKind(ORDINARY_NAME, rest)) if rest > 0.0 else may_come
