"""Whole valid routing problems, small enough for brute force."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from planner.orienteering import Experiment, RoutingProblem, SideLimit


@st.composite
def problems(draw: st.DrawFn, *, limits: bool = False, must: bool = True) -> RoutingProblem:
    """Up to four sites and six experiments with windows, precedence, missing roads and asymmetric costs."""
    sites = draw(st.integers(1, 4))
    count = draw(st.integers(1, 6))
    cost = st.integers(1, 30)
    roads = np.array(
        [[draw(st.integers(-2, 30)) for _ in range(sites)] for _ in range(sites)], dtype=np.int64
    )
    roads = np.where(roads == 0, 1, np.maximum(roads, -1))
    fuel = np.array([[draw(cost) for _ in range(sites)] for _ in range(sites)], dtype=np.int64)
    horizon = draw(st.integers(20, 150))
    experiments = []
    for k in range(count):
        opens = draw(st.integers(0, 60))
        experiments.append(
            Experiment(
                f"E{k}",
                draw(st.integers(0, sites - 1)),
                draw(st.integers(0, 20)),
                draw(st.integers(1, 25)),
                draw(st.integers(0, 20)),
                opens if draw(st.booleans()) else 0,
                opens + draw(st.integers(10, 80)) if draw(st.booleans()) else None,
                must and draw(st.integers(0, 9)) == 0,
            )
        )
    pairs = tuple((a, a + 1) for a in range(count - 1) if draw(st.integers(0, 3)) == 0)
    side = ()
    if limits:
        amounts = tuple(draw(st.integers(0, 3)) for _ in range(count))
        side = (SideLimit("volume", amounts, draw(st.integers(0, 6))),)
    return RoutingProblem(
        roads,
        fuel,
        tuple(experiments),
        horizon,
        draw(st.one_of(st.none(), st.integers(10, 120))),
        start_site=draw(st.integers(0, sites - 1)),
        end_site=draw(st.one_of(st.none(), st.integers(0, sites - 1))),
        precedence=pairs,
        limits=side,
        base_prize=draw(st.integers(0, 3)),
    )
