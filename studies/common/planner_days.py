"""Random days for studies of the planner."""

from __future__ import annotations

from typing import Any

import numpy as np

from planner.problem import Problem, problem_from_dict
from tests.planner.examples import observation, problem_document


def day(rng: np.random.Generator, *, least: int = 3, most: int = 9) -> Problem:
    """Return a day of some targets, one observation each, with windows, penalties and tracks by chance."""
    count = int(rng.integers(least, most + 1))
    rows: list[list[dict[str, Any]]] = []
    for k in range(count):
        kind = "place" if rng.random() < 0.5 else "image"
        row = [observation(f"A{k}", kind, float(rng.integers(2, 11)), p_success=0.9)]
        if rng.random() < 0.3:
            opens = float(rng.integers(0, 6000))
            row[0]["window_s"] = [opens, opens + float(rng.integers(1500, 6000))]
        rows.append(row)
    return problem_from_dict(
        problem_document(
            places=[(float(x), float(y)) for x, y in rng.uniform(-9.0, 9.0, (count, 2))],
            observations=rows,
            time_s=float(rng.integers(4000, 12_000)),
            energy_j=float(rng.integers(400, 1200)) * 1000.0,
            spread=float(rng.choice([0.3, 0.6])),
            loss=float(rng.choice([0.05, 0.2])),
            overrun_penalty=float(rng.choice([0.0, 10.0])),
        )
    )
