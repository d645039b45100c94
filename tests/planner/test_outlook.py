"""What a plan may come to: with successes that go together within a day, and without."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from planner.errors import ProblemError
from planner.evaluate.model import Floats, Model
from planner.evaluate.monte_carlo import simulate
from planner.outlook import Outlook, beta_quantile, day_odds, outlook
from planner.plan_tree import Navigate, Observe, OnFail, Plan, Step, TrackStart
from planner.problem import ObservationId, Problem, TargetId, problem_from_dict, problem_to_dict

WORTH = (20.0, 11.0, 14.0)
ODDS = 0.8


def _observed(name: str, kind: str, worth: float, instrument: str, p: float = ODDS) -> dict[str, object]:
    amounts = {"time_s": {"mean": 60.0, "sd": 5.0}, "energy_j": {"mean": 50.0}}
    return {
        "id": name,
        "kind": kind,
        "utility": worth,
        "p_success": p,
        "observe": amounts,
        "instrument": instrument,
    }


def _problem(rho: float = 0.0, *, p_lose: float = 0.0, **more: object) -> Problem:
    """Return a day of three placements on three targets, and a picture; nothing binds."""
    names = ["T1", "T2", "T3"]
    observed = [_observed(f"P{t}", "place", w, "mi") for t, w in zip(names, WORTH, strict=True)]
    return problem_from_dict(
        {
            "format": "problem/2",
            "name": "three",
            "budget": {"time_s": 1e6, "energy_j": 1e9},
            "hotel_w": 10.0,
            "track_start": {"time_s": 10.0, "energy_j": 5.0},
            "track_overhead_s_per_leg": 0.0,
            "targets": [
                {
                    "id": t,
                    "observations": [o, *([_observed("I", "image", 3.0, "cam", 0.9)] if t == "T3" else [])],
                }
                for t, o in zip(names, observed, strict=True)
            ],
            "legs": [
                {
                    "from": a,
                    "to": b,
                    "time_s": {"mean": 300.0, "sd": 30.0},
                    "energy_j": {"mean": 900.0},
                    "p_lose": {b: p_lose},
                }
                for a in ("start", *names)
                for b in names
                if a != b
            ],
            **({"intraday_correlation": {"mi": rho}} if rho else {}),
            **more,
        }
    )


def _plan() -> Plan:
    names = [TargetId(f"T{k}") for k in (1, 2, 3)]
    steps: list[Step] = [TrackStart(t) for t in names]
    for t in names:
        steps += [Navigate(t, on_fail=OnFail.SKIP), Observe(ObservationId(f"P{t}"), t, OnFail.SKIP)]
    return (*steps, Observe(ObservationId("I"), names[2], OnFail.SKIP))


def _inside(said: Outlook, earned: Floats, rng: np.random.Generator) -> float:
    """Return the share of days inside the 90 % band, by the randomised transform."""
    below = np.concatenate([[0.0], np.cumsum(said.shares)])
    at = np.searchsorted(said.values, earned - 1e-6)
    v = below[at] + said.shares[at] * rng.random(len(earned))
    return float(np.mean((v >= 0.05) & (v <= 0.95)))


def _days(rho: float, count: int, rng: np.random.Generator) -> Floats:
    """Return what drawn days earn, from the definition: a beta draw a day, then coins."""
    size = (1.0 - rho) / rho
    odds = rng.beta(ODDS * size, (1.0 - ODDS) * size, count)
    coins = rng.random((count, 3)) < odds[:, None]
    earned: Floats = coins @ np.array(WORTH) + 3.0 * (rng.random(count) < 0.9)
    return earned


def test_the_band_holds_nine_days_of_ten_where_successes_go_together_and_only_if_told() -> None:
    for rho in (0.15, 0.4):
        rng = np.random.default_rng([3, int(100 * rho)])
        earned = _days(rho, 20_000, rng)
        told, untold = (outlook(_problem(r), _plan(), seed=4) for r in (rho, 0.0))
        assert _inside(told, earned, rng) == pytest.approx(0.9, abs=0.012)
        assert _inside(untold, earned, rng) < 0.9 - 0.12 * rho  # too sure of itself


def test_the_number_of_successes_is_beta_binomial() -> None:
    rho, problem = 0.3, _problem(0.3)
    odds = day_odds(problem, 40_000, seed=9)[:, :3]
    assert np.array_equal(odds[:, 0], odds[:, 2])  # one day, one instrument
    coins = np.random.default_rng(10).random(odds.shape) < odds
    size = (1.0 - rho) / rho
    truth = stats.betabinom.pmf(np.arange(4), 3, ODDS * size, (1.0 - ODDS) * size)
    seen = np.bincount(coins.sum(axis=1), minlength=4) / len(odds)
    assert seen == pytest.approx(truth, abs=0.01)
    assert np.corrcoef(coins[:, 0], coins[:, 1])[0, 1] == pytest.approx(rho, abs=0.02)


def test_without_a_correlation_every_coin_falls_for_itself() -> None:
    p_lose = 0.25
    said = outlook(_problem(p_lose=p_lose), _plan(), seed=5)
    truth: dict[float, float] = {}
    chances = (*[(1.0 - p_lose) * ODDS] * 3, 0.9)
    for made in itertools.product((0, 1), repeat=4):
        p = float(np.prod([c if m else 1.0 - c for m, c in zip(made, chances, strict=True)]))
        worth = float(np.dot(made, (*WORTH, 3.0)))
        truth[worth] = truth.get(worth, 0.0) + p
    assert said.values.tolist() == sorted(truth)
    for v, share in zip(said.values, said.shares, strict=True):
        assert share == pytest.approx(truth[float(v)], abs=4 * np.sqrt(truth[float(v)] / 20_000))
    assert said.shares.sum() == pytest.approx(1.0)


def test_a_correlation_spreads_the_utility_and_leaves_every_mean() -> None:
    plain, together = (outlook(_problem(r, p_lose=0.1), _plan(), seed=6) for r in (0.0, 0.5))
    problem = _problem(0.5, p_lose=0.1)
    value = simulate(Model.of(problem), _plan(), 20_000, seed=6, threads=1).estimate().mean
    for said in (plain, together):
        assert said.mean == pytest.approx(value, abs=5 * together.sd / np.sqrt(20_000))
    assert together.made == pytest.approx(plain.made, abs=0.015)
    assert together.sd > 1.2 * plain.sd
    assert (together.time_s, together.energy_j) == (plain.time_s, plain.energy_j)
    assert together.quantile(0.05) <= plain.quantile(0.05)
    assert together.quantile(0.95) >= plain.quantile(0.95)


@settings(deadline=None, max_examples=60)
@given(mean=st.floats(0.01, 0.99), rho=st.floats(1e-4, 0.95))
def test_odds_of_days_keep_their_mean_and_have_the_correlation(mean: float, rho: float) -> None:
    odds = beta_quantile((np.arange(40_000) + 0.5) / 40_000, mean, rho)
    assert odds.mean() == pytest.approx(mean, abs=2e-4)
    assert odds.var() == pytest.approx(rho * mean * (1.0 - mean), rel=0.02, abs=2e-6)


def test_certain_odds_stay_certain_and_a_full_correlation_is_all_or_nothing() -> None:
    share = np.linspace(0.01, 0.99, 99)
    for certain in (0.0, 1.0):
        assert set(beta_quantile(share, certain, 0.7)) == {certain}
    assert beta_quantile(share, 0.8, 1.0).mean() == pytest.approx(0.8, abs=0.011)
    assert set(beta_quantile(share, 0.8, 0.0)) == {0.8}


def test_what_counts_less_after_others_of_its_target_is_worth_less() -> None:
    document = problem_to_dict(_problem())
    document["targets"] = [
        {
            "id": "T1",
            "diminishing": 0.5,
            "observations": [
                _observed(f"O{k}", "image", 8.0, "cam", p) for k, p in enumerate((0.5, 1.0, 1.0))
            ],
        }
    ]
    document["legs"] = [leg for leg in document["legs"] if (leg["from"], leg["to"]) == ("start", "T1")]
    document["legs"] = [{**leg, "p_lose": {}} for leg in document["legs"]]
    target = TargetId("T1")
    looks = (Observe(ObservationId(f"O{k}"), target, OnFail.SKIP) for k in (2, 0, 1))
    said = outlook(problem_from_dict({**document, "format": "problem/1"}), (Navigate(target), *looks), seed=1)
    assert said.values.tolist() == [10.0, 14.0]  # 8 + 8/4, and 8/2 where the coin falls
    assert said.made == pytest.approx((0.5, 1.0, 1.0), abs=0.02)


def test_quantiles_have_their_plain_meaning_and_no_plan_earns_nothing() -> None:
    said = replace(
        outlook(_problem(), _plan(), seed=1),
        values=np.array([0.0, 5.0, 9.0]),
        shares=np.array([0.04, 0.5, 0.46]),
    )
    assert [said.quantile(p) for p in (0.01, 0.04, 0.05, 0.5, 0.95, 1.0)] == [0.0, 0.0, 5.0, 5.0, 9.0, 9.0]
    assert outlook(_problem(), (), seed=1).values.tolist() == [0.0]


def test_the_document_says_what_goes_together_and_nothing_where_nothing_does() -> None:
    plain, together = _problem(), _problem(0.25)
    document = problem_to_dict(together)
    assert document["format"] == "problem/2"
    assert document["intraday_correlation"] == {"mi": 0.25}
    assert problem_from_dict(document) == together
    assert together.digest() != plain.digest()
    for nothing in ({}, None, {"mi": 0.0}):
        silent = problem_from_dict(
            {**problem_to_dict(plain), "format": "problem/2"} | {"intraday_correlation": nothing}
        )
        assert silent.digest() == plain.digest()
    assert "intraday_correlation" not in problem_to_dict(plain)
    with pytest.raises(ProblemError, match=r"intraday_correlation is .* need the format problem/2"):
        problem_from_dict(
            {**problem_to_dict(plain), "format": "problem/1", "intraday_correlation": {"mi": 0.2}}
        )
    with pytest.raises(ProblemError, match="intraday_correlation"):
        problem_from_dict({**document, "intraday_correlation": {"mi": 1.5}})
