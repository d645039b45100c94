"""Small planning problems for the tests, and hypothesis strategies that make whole valid ones."""

from __future__ import annotations

import itertools
import math
from typing import Any

from hypothesis import strategies as st

from planner.plan_tree import Navigate, Observe, OnFail, Plan, Step, TrackStart
from planner.problem import Problem, problem_from_dict


def amount(mean: float, sd: float = 0.0) -> dict[str, float]:
    return {"mean": mean, "sd": sd}


def observation(name: str, kind: str = "image", utility: float = 5.0, **more: Any) -> dict[str, Any]:
    return {
        "id": name,
        "kind": kind,
        "utility": utility,
        "observe": {"time_s": amount(300.0, 60.0), "energy_j": amount(9000.0, 1500.0)},
        **more,
    }


def problem_document(
    *,
    places: list[tuple[float, float]] = [(4.0, 1.0), (6.0, -2.0), (3.0, -4.0)],  # noqa: B006
    observations: list[list[dict[str, Any]]] | None = None,
    time_s: float = 6000.0,
    energy_j: float = 600_000.0,
    spread: float = 0.5,
    loss: float = 0.15,
    **more: Any,
) -> dict[str, Any]:
    """Return a `problem/1` document: targets at places (metres), legs by distance."""
    n = len(places)
    rows = observations or [[observation(f"O{k + 1}", "place" if k % 2 == 0 else "image")] for k in range(n)]
    spots = {"start": (0.0, 0.0), **{f"T{k + 1}": places[k] for k in range(n)}}
    legs = []
    for a, b in itertools.permutations(spots, 2):
        if b == "start":
            continue
        d = math.dist(spots[a], spots[b])
        mean = 300.0 + 190.0 * d
        legs.append(
            {
                "from": a,
                "to": b,
                "length_m": d,
                "time_s": amount(mean, spread * mean),
                "energy_j": amount(20_000.0 * d + 4000.0, 0.2 * (20_000.0 * d + 4000.0)),
                "p_lose": {f"T{k + 1}": loss for k in range(n)},
            }
        )
    return {
        "format": "problem/1",
        "name": "example",
        "budget": {"time_s": time_s, "energy_j": energy_j},
        "hotel_w": 38.0,
        "track_start": {"time_s": 20.0, "energy_j": 200.0},
        "track_overhead_s_per_leg": 45.0,
        "targets": [{"id": f"T{k + 1}", "observations": rows[k]} for k in range(n)],
        "legs": legs,
        **more,
    }


def example(**more: Any) -> Problem:
    return problem_from_dict(problem_document(**more))


def visits(problem: Problem, *names: str, on_fail: OnFail = OnFail.SKIP) -> Plan:
    """Return the plan that tracks and visits these observations in order."""
    by_name = {o.id: o for o in problem.observations}
    steps: list[Step] = []
    for target in dict.fromkeys(by_name[n].target for n in names if by_name[n].kind.value == "place"):  # type: ignore[index]
        steps.append(TrackStart(target))
    for name in names:
        o = by_name[name]  # type: ignore[index]
        steps.append(Navigate(o.target, o.kind.value == "place", on_fail))
        steps.append(Observe(o.id, o.target, on_fail))
    return tuple(steps)


@st.composite
def problems(draw: st.DrawFn, *, targets: int = 3, constant: bool = False) -> Problem:
    """Draw a problem of up to so many targets with one or two observations each."""
    n = draw(st.integers(1, targets))
    places = [(draw(st.floats(2.0, 9.0, width=16)), draw(st.floats(-5.0, 5.0, width=16))) for _ in range(n)]
    rows = []
    for k in range(n):
        row = [
            observation(
                f"O{k + 1}",
                draw(st.sampled_from(["place", "image"])),
                float(draw(st.integers(0, 10))),
                p_success=draw(st.sampled_from([1.0, 0.8])),
            )
        ]
        if draw(st.booleans()):
            row.append(observation(f"P{k + 1}", "image", float(draw(st.integers(0, 4)))))
        if draw(st.booleans()):
            row[0]["window_s"] = [draw(st.integers(0, 2000)), draw(st.integers(2000, 6000))]
        if constant:
            for o in row:
                o["observe"] = {"time_s": amount(300.0), "energy_j": amount(9000.0)}
        rows.append(row)
    document = problem_document(
        places=places,
        observations=rows,
        time_s=float(draw(st.integers(600, 8000))),
        energy_j=float(draw(st.integers(50_000, 700_000))),
        spread=0.0 if constant else draw(st.sampled_from([0.2, 0.6])),
        loss=0.0 if constant else draw(st.sampled_from([0.0, 0.2])),
        overrun_penalty=float(draw(st.sampled_from([0, 0, 5]))),
    )
    if constant:
        for leg in document["legs"]:
            leg["energy_j"]["sd"] = 0.0
    return problem_from_dict(document)
