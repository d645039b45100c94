"""Instances of the contest, `contingency/1`: read as plain numbers, and drawn from a seed."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from planner.errors import ProblemError
from planner.problem_document import CONTINGENCY

FAMILIES = ("resource", "tracking", "windows", "mixed", "reserve")
MOST_TARGETS = 12


@dataclass(frozen=True, slots=True)
class Goal:
    """A target with its one observation; `place` must be tracked when it is made. Times s, energies J."""

    place: bool
    utility: float
    p_success: float
    time_s: tuple[float, float]
    energy_j: tuple[float, float]
    window_s: tuple[float, float]


@dataclass(frozen=True, slots=True)
class Leg:
    """A drive: mean and standard deviation of its time, s, and energy, J, and chances to lose each track."""

    time_s: tuple[float, float]
    energy_j: tuple[float, float]
    p_lose: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class Instance:
    """A planning problem as the checker sees it."""

    name: str
    digest: str
    budget_s: float
    budget_j: float
    hotel_w: float
    penalty: float
    track_start: tuple[float, float]
    track_overhead_s: float
    goals: Mapping[str, Goal]
    legs: Mapping[tuple[str, str], Leg]


def read_instance(document: Mapping[str, object]) -> Instance:
    """Return an instance from `contingency/1`.

    Raises
    ------
    ProblemError
        If it is malformed; the message names the member.
    """
    told: Any = CONTINGENCY.from_document(document)

    def amount(given: Mapping[str, float | None]) -> tuple[float, float]:
        return float(given["mean"] or 0.0), float(given.get("sd") or 0.0)

    goals = {
        t["id"]: Goal(
            t["kind"] == "place",
            t["utility"],
            t["p_success"],
            amount(t["observe"]["time_s"]),
            amount(t["observe"]["energy_j"]),
            tuple(t.get("window_s") or (0.0, math.inf)),
        )
        for t in told["targets"]
    }
    if len(goals) != len(told["targets"]) or "start" in goals:
        raise ProblemError(f"problem {told['name']!r}: two targets have one name, or one is called 'start'")
    legs = {}
    for leg in told["legs"]:
        ends = leg["from"], leg["to"]
        unknown = {*ends, *(leg.get("p_lose") or {})} - {*goals, "start"}
        if unknown:
            raise ProblemError(
                f"problem legs[{ends[0]} -> {ends[1]}] names {min(unknown)!r}, which is not a target"
            )
        legs[ends] = Leg(amount(leg["time_s"]), amount(leg["energy_j"]), leg.get("p_lose") or {})
    canonical = json.dumps(document, sort_keys=True, separators=(",", ":")).encode()
    return Instance(
        told["name"],
        hashlib.sha256(canonical).hexdigest(),
        told["budget"]["time_s"],
        told["budget"]["energy_j"],
        told["hotel_w"],
        float(told.get("overrun_penalty") or 0.0),
        (told["track_start"]["time_s"], told["track_start"]["energy_j"]),
        told["track_overhead_s_per_leg"],
        goals,
        legs,
    )


def load_document(path: Path) -> Mapping[str, object]:
    """Return a JSON file.

    Raises
    ------
    ProblemError
        If it cannot be read; the message names it.
    """
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as err:
        raise ProblemError(f"{path}: {err}") from err
    if not isinstance(found, dict):
        raise ProblemError(f"{path}: a JSON object is needed, not {type(found).__name__}")
    return found


SPEED_M_PER_S = 0.0055
"""Of K9 between looks for its targets: 5 m took about 15 min in its field runs (Pedersen et al. 2005)."""
DRIVE_J_PER_M = 20_000.0
SPREAD_TIME, SPREAD_ENERGY = 0.65, 0.18
"""Standard deviations over means of a drive; by hand: times stray far, energies little."""
FIELD_M = 8.0
OVERHEAD_S = 45.0


def generate(family: str, targets: int, seed: int) -> Mapping[str, object]:
    """Return an instance of a family, `contingency/1`, drawn from a seed.

    `resource`: images alone, time and energy are short. `tracking`: targets to touch, drives lose tracks.
    `windows`: images in windows. `mixed`: all of it. `reserve`: mixed, an overrun costs half of all value.

    Raises
    ------
    ProblemError
        If there is no such family, or the number of targets is not from 2 to 12.
    """
    if family not in FAMILIES:
        raise ProblemError(f"there is no family {family!r}; there are {', '.join(FAMILIES)}")
    if not 2 <= targets <= MOST_TARGETS:
        raise ProblemError(f"targets is {targets}; an instance has 2 to {MOST_TARGETS}")
    rng = np.random.default_rng([seed, targets, FAMILIES.index(family)])
    touched = {"resource": 0.0, "windows": 0.0, "tracking": 0.7, "mixed": 0.5, "reserve": 0.5}[family]
    timed = {"resource": 0.0, "windows": 0.8, "tracking": 0.0, "mixed": 0.4, "reserve": 0.4}[family]
    places = np.vstack([np.zeros(2), rng.uniform(-FIELD_M, FIELD_M, (targets, 2))])
    names = ["start", *(f"T{k}" for k in range(1, targets + 1))]
    place = rng.random(targets) < touched
    lengths = np.linalg.norm(places[:, None] - places[None], axis=2)
    times = np.maximum(lengths, 0.5) / SPEED_M_PER_S
    total = float(np.sort(times[0, 1:]).sum())
    budget_s = round(float(rng.uniform(0.55, 0.85)) * (total + 400.0 * targets), 1)
    budget_j = round(
        budget_s * 38.0 + float(rng.uniform(0.5, 0.8)) * DRIVE_J_PER_M * SPEED_M_PER_S * total, 1
    )
    rows: list[dict[str, Any]] = []
    for k in range(targets):
        mean = 500.0 if place[k] else 200.0
        row: dict[str, Any] = {
            "id": names[k + 1],
            "kind": "place" if place[k] else "image",
            "utility": float(rng.integers(2, 12) + 8 * place[k]),
            "p_success": round(float(rng.uniform(0.75, 1.0)), 2),
            "target_m": [round(float(v), 3) for v in places[k + 1]],
            "observe": {
                "time_s": {"mean": mean, "sd": 0.25 * mean},
                "energy_j": {"mean": 30.0 * mean, "sd": 4.0 * mean},
            },
        }
        if rng.random() < timed:
            opens = float(rng.uniform(0.0, 0.6)) * budget_s
            row["window_s"] = [round(opens, 1), round(opens + float(rng.uniform(0.2, 0.5)) * budget_s, 1)]
        rows.append(row)
    legs = []
    for i in range(targets + 1):
        for j in range(1, targets + 1):
            if i == j:
                continue
            lose = {
                names[k + 1]: round(float(min(0.4, 0.01 + 0.012 * lengths[i, j] * rng.uniform(0.3, 2.0))), 4)
                for k in range(targets)
                if place[k]
            }
            energy = float(lengths[i, j]) * DRIVE_J_PER_M
            legs.append(
                {
                    "from": names[i],
                    "to": names[j],
                    "length_m": round(float(lengths[i, j]), 3),
                    "time_s": {
                        "mean": round(float(times[i, j]), 3),
                        "sd": round(SPREAD_TIME * float(times[i, j]), 3),
                    },
                    "energy_j": {"mean": round(energy, 3), "sd": round(SPREAD_ENERGY * energy, 3)},
                    "p_lose": lose,
                }
            )
    worth = sum(row["utility"] for row in rows)
    return {
        "format": "contingency/1",
        "name": f"{family}-{targets}-{seed}",
        "family": family,
        "seed": seed,
        "units": "seconds, joules, metres",
        "overrun_penalty": round(0.5 * worth, 1) if family == "reserve" else 0.0,
        "budget": {"time_s": budget_s, "energy_j": budget_j},
        "hotel_w": 38.0,
        "track_start": {"time_s": 20.0, "energy_j": 200.0},
        "track_overhead_s_per_leg": OVERHEAD_S,
        "targets": rows,
        "legs": legs,
    }
