"""What a day is predicted to earn, by another reckoning; and what a block of days learns from."""

from __future__ import annotations

import itertools
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from ground.day.prepare import calibration_of
from planner.path_network import Calibration
from planner.plan_tree import Navigate, Observe, OnFail, Plan, TrackStart
from planner.problem import ObservationId, Problem, TargetId, problem_from_dict
from studies.common.asked_days import PROFILE
from studies.predicted_days import (
    calibration_of_block,
    flown_days,
    pit_of,
    prediction,
    quantile,
    ratio,
    shares,
)

LOST, ODDS, WORTH = 0.2, (0.7, 0.6, 0.9), (20.0, 8.0, 3.0)


def _problem() -> Problem:
    """Return a day of one drive to a target with two placements and a picture; nothing binds."""
    kinds = ("place", "place", "image")
    return problem_from_dict(
        {
            "format": "problem/1",
            "name": "one drive",
            "budget": {"time_s": 1e6, "energy_j": 1e9},
            "hotel_w": 10.0,
            "track_start": {"time_s": 10.0, "energy_j": 5.0},
            "track_overhead_s_per_leg": 0.0,
            "targets": [
                {
                    "id": "T1",
                    "observations": [
                        {
                            "id": f"O{k}",
                            "kind": kind,
                            "utility": worth,
                            "p_success": p,
                            "observe": {"time_s": {"mean": 60.0}, "energy_j": {"mean": 50.0}},
                        }
                        for k, (kind, worth, p) in enumerate(zip(kinds, WORTH, ODDS, strict=True))
                    ],
                }
            ],
            "legs": [
                {
                    "from": "start",
                    "to": "T1",
                    "time_s": {"mean": 300.0, "sd": 30.0},
                    "energy_j": {"mean": 900.0},
                    "p_lose": {"T1": LOST},
                }
            ],
        }
    )


def _by_hand() -> dict[float, float]:
    """Return the chance of each utility: the track is kept or not, and then each coin falls."""
    found: dict[float, float] = {}
    for kept, *coins in itertools.product((True, False), repeat=4):
        p = 1.0 - LOST if kept else LOST
        earned = 0.0
        for k, coin in enumerate(coins):
            p *= ODDS[k] if coin else 1.0 - ODDS[k]
            earned += WORTH[k] if coin and (kept or k == 2) else 0.0
        found[earned] = found.get(earned, 0.0) + p
    return found


def test_the_predicted_utilities_are_those_of_all_that_may_happen() -> None:
    target = TargetId("T1")
    plan: Plan = (
        TrackStart(target),
        Navigate(target),
        *(Observe(ObservationId(f"O{k}"), target, OnFail.SKIP) for k in range(3)),
    )
    foretold = prediction(_problem(), plan, seed=5)
    truth = _by_hand()
    assert {v for v, _ in foretold["values"]} == set(truth)
    for v, share in foretold["values"]:
        assert share == pytest.approx(truth[v], abs=4 * np.sqrt(truth[v] / 20_000))
    assert foretold["mean"] == pytest.approx(sum(v * p for v, p in truth.items()), rel=0.02)
    assert foretold["made"] == pytest.approx([0.8 * 0.7, 0.8 * 0.6, 0.9], abs=0.015)


def test_a_true_model_has_even_transforms_and_a_flattering_one_has_not() -> None:
    values = [[v, p] for v, p in sorted(_by_hand().items())]
    rng = np.random.default_rng(8)

    def transforms(worth: list[float]) -> list[float]:
        drawn = rng.choice(worth, 2000, p=[p for _, p in values])
        return [
            pit_of({"seed": k, "achieved": {"pit": shares(values, float(u))}}) for k, u in enumerate(drawn)
        ]

    assert stats.kstest(transforms([v for v, _ in values]), "uniform").pvalue > 0.01
    assert stats.kstest(transforms([0.0, *(v for v, _ in values[:-1])]), "uniform").pvalue < 1e-6


def test_quantiles_and_ratios_have_their_plain_meaning() -> None:
    values = [[0.0, 0.04], [5.0, 0.5], [9.0, 0.46]]
    assert [quantile(values, p) for p in (0.01, 0.05, 0.95)] == [0.0, 5.0, 9.0]
    assert shares(values, 5.0) == pytest.approx((0.04, 0.54))
    share, error = ratio([2.0, 4.0, 6.0], [1.0, 2.0, 3.0])
    assert (share, error) == pytest.approx((2.0, 0.0))


def test_a_block_of_days_is_planned_with_what_was_known_when_it_began(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("studies.predicted_days.WAIT_S", 0.01)
    asked = threading.Barrier(2)
    learned: list[Calibration] = []

    def learn() -> Calibration:
        learned.append(replace(calibration_of(PROFILE), source=f"{len(flown_days(tmp_path))} days"))
        return learned[-1]

    def begin() -> Calibration:
        asked.wait()
        return calibration_of_block(tmp_path / "days-020", learn)

    for name in ("train/7", "days-000/8", "days-000/9"):
        folder = tmp_path / name
        folder.mkdir(parents=True)
        (folder / "run.json").write_text("{}")
        if folder.name != "9":  # which is still being flown
            (folder / "day.json").write_text("{}")
    with ThreadPoolExecutor(2) as pool:
        both = [begun.result() for begun in [pool.submit(begin), pool.submit(begin)]]
    (tmp_path / "days-000/9/day.json").write_text("{}")
    assert [model.source for model in (*both, calibration_of_block(tmp_path / "days-020", learn))] == [
        "2 days"
    ] * 3
    assert len(learned) == 1
