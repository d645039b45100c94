"""Small problems in which coming back, going round and light at two times of the day pay."""

from __future__ import annotations

from typing import Any

import numpy as np

from planner.problem import Problem, problem_from_dict
from tests.planner.examples import amount, problem_document

FAMILIES = ("plain", "twice", "hub", "precedence", "fading", "tracking", "penalty", "through", "failing")
ALL_FAMILIES = (*FAMILIES, "sols")
"""Those too in which the kind of sol is hidden, and no table holds the best policy."""


def generated(family: str, seed: int, *, spread: float = 0.0) -> Problem:
    """Return a problem of 3 targets and up to 5 observations; `spread` 0 makes all amounts constant."""
    rng = np.random.default_rng((ALL_FAMILIES.index(family), seed))
    n = 3
    places = [(float(e), float(w)) for e, w in rng.uniform(-6.0, 6.0, (n, 2)).round(1)]
    rows: list[list[dict[str, object]]] = []
    for k in range(n):
        row = [_observation(rng, f"A{k + 1}", spread, place=family == "tracking" or rng.random() < 0.3)]
        if (family in ("twice", "fading") or (family == "sols" and seed % 3 == 0)) and k < 2:
            row.append(_observation(rng, f"B{k + 1}", spread))
        if family == "twice" and k < 2:  # morning and evening light
            row[0]["window_s"] = [0.0, 2500.0]
            row[1]["window_s"] = [4000.0, 6500.0]
        rows.append(row)
    more: dict[str, object] = {"overrun_penalty": 10.0 if family == "penalty" else 0.0}
    if family == "precedence":
        rows[0].append(_observation(rng, "B1", spread))
        more["precedence"] = [["A1", "A2"], ["A2", "B1"]]
    document = problem_document(
        places=places,
        observations=rows,
        time_s=float(rng.integers(3500, 8000)),
        energy_j=float(rng.integers(300, 800)) * 1000.0,
        spread=spread,
        loss=float(rng.choice([0.0, 0.1, 0.3])),
        **more,
    )
    for leg in document["legs"]:
        for name in ("time_s", "energy_j"):
            mean = float(round(leg[name]["mean"], -1))
            leg[name] = amount(mean, spread * mean)
    if family in ("hub", "through"):
        document["legs"] = [
            leg for leg in document["legs"] if {leg["from"], leg["to"]} not in ({"T2", "T3"}, {"start", "T3"})
        ]
    if family == "through":  # nothing is wanted at the place that leads on, and nothing leads back
        document["targets"][0]["observations"] = []
        back = ("T3",) if seed % 2 else ("T2", "T3")
        document["legs"] = [leg for leg in document["legs"] if leg["from"] not in back]
    if family == "failing":  # on some the way through another place is missing, too
        document["format"] = "problem/2"
        for leg in document["legs"]:
            leg["p_fail"] = float(rng.choice([0.0, 0.1, 0.3, 0.6]))
        if seed % 3 == 0:
            document["legs"] = [leg for leg in document["legs"] if leg["from"] != "T1" or leg["to"] != "T3"]
    if family == "sols":
        _hide_the_kind(document, rng, seed)
    if family == "fading":
        for target in document["targets"]:
            target["diminishing"] = 0.5
    return problem_from_dict(document)


def _hide_the_kind(document: dict[str, Any], rng: np.random.Generator, seed: int) -> None:
    """Put in one to three kinds of sols; some pairs are told apart by observations alone, some by nothing."""
    document["format"] = "problem/2"
    if seed % 2:  # energy used then tells nothing by itself
        document["hotel_w"] = 0.0
    kinds: list[dict[str, object]] = []
    for k in range(int(rng.integers(1, 4))):
        slow, hungry = float(rng.choice([1.0, 1.25, 1.5, 0.75])), float(rng.choice([1.0, 1.25, 1.5]))
        within = bool(rng.random() < 0.5)
        kinds.append(
            {
                "name": f"kind {k}",
                "p": float(rng.choice([0.1, 0.2, 0.3])),
                "drive_time_factor": slow,
                "drive_energy_factor": 1.0 if within else hungry,
                "energy_factor": hungry if within else 1.0,
            }
        )
    document["sol_kinds"] = kinds


def _observation(
    rng: np.random.Generator, name: str, spread: float, *, place: bool = False
) -> dict[str, object]:
    time_s, energy_j = float(rng.integers(10, 60)) * 10.0, float(rng.integers(5, 20)) * 1000.0
    return {
        "id": name,
        "kind": "place" if place else "image",
        "utility": float(rng.integers(1, 12)),
        "p_success": float(rng.choice([1.0, 0.8])),
        "observe": {
            "time_s": amount(time_s, spread * time_s),
            "energy_j": amount(energy_j, spread * energy_j),
        },
    }
