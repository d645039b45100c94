"""What a campaign says of its rows, against counts made anew and other people's formulas."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace
from pathlib import Path
from statistics import NormalDist

import numpy as np
import pytest

from ground.campaigns.case import Case, world_text
from ground.campaigns.causes import Causes
from ground.campaigns.conduct import make_order, result_of, tally_of
from ground.campaigns.events import read_event
from ground.campaigns.inputs import expected_utility, option_odds, read_case
from ground.campaigns.intervals import quantile_interval, share_interval
from ground.campaigns.pilot import pilot_of
from ground.campaigns.rare import RareOptions, RareSampler, Tilt, summary_line
from ground.campaigns.row import Row
from tests.ground.campaigns.small import write_small

RUNS = 400


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Case:
    return read_case(*write_small(tmp_path_factory.mktemp("small")), "abstract")


@pytest.fixture(scope="module")
def rows(case: Case) -> list[Row]:
    return [pilot_of(case).row(seed) for seed in range(1, RUNS + 1)]


def test_a_row_is_what_its_line_says(rows: list[Row]) -> None:
    assert [Row.read(row.line()) for row in rows] == rows


def test_figures_are_those_of_numpy(case: Case, rows: list[Row]) -> None:
    tally = tally_of(case)
    for row in rows:
        tally.add(row)
    result = result_of(make_order(case, 1), case, tally, "")
    utilities = np.array([r.utility for r in rows])
    assert result.utility.mean == pytest.approx(utilities.mean())
    assert result.utility.sd == pytest.approx(utilities.std(ddof=1))
    assert result.utility.standard_error == pytest.approx(utilities.std(ddof=1) / math.sqrt(RUNS))
    for p, value in result.utility.quantiles.items():
        assert value == pytest.approx(np.quantile(utilities, float(p)))
    for p, value in result.energy_used_j.items():
        assert value == pytest.approx(np.quantile([r.energy_used_j for r in rows], float(p)))
    assert result.outcomes == dict(Counter(r.outcome for r in rows))
    assert result.options == dict(Counter(o for r in rows for o in r.options))
    assert sum(b.runs for b in result.histogram) == RUNS
    assert result.convergence[-1] == (RUNS, result.utility.mean, result.utility.standard_error)
    worst = sorted((r.utility, r.seed) for r in rows)[:10]
    assert [(w.utility, w.seed) for w in result.worst] == worst
    stay = next(f for f in result.frequencies if f.what == "option stay")
    assert (stay.predicted, stay.runs) == (0.5, result.options["stay"])
    over = next(f for f in result.frequencies if f.what == "over budget")
    assert over.runs == sum(bool(r.exceeded) for r in rows)
    for k, name in enumerate(pilot_of(case).node_ids):
        assert result.nodes[name][0] == sum(r.nodes[k] == "S" for r in rows) / RUNS


def test_failure_modes_name_task_condition_and_resource_and_their_examples_have_them(
    case: Case, rows: list[Row]
) -> None:
    tally = tally_of(case)
    for row in rows:
        tally.add(row)
    modes = {(m.task, m.condition): m for m in tally.failures()}
    lost = modes["at-T1", "track of T1 lost"]
    assert lost.resource == "track of T1"
    assert lost.runs == sum(r.reasons.get("at-T1") == "start-condition" for r in rows)
    late = modes["root", "((database (:time <= 2600))) no longer held"]
    assert late.resource == "time"
    assert ("plan", "over the budget of time") in modes
    assert ("touch-T2", "action failed: no usable product") in modes
    causes = Causes.of(case.plan())
    ended = [r for r in rows if r.reasons.get("root", "").startswith("maintain-violated")]
    assert any("time" in r.exceeded for r in ended)
    assert late.runs + modes["plan", "over the budget of time"].runs == sum(
        "time" in r.exceeded for r in rows
    )
    by_seed = {r.seed: r for r in rows}
    for mode in tally.failures():
        assert 1 <= len(mode.examples) <= 3
        for seed in mode.examples:
            found = [(c.task, c.condition) for c in causes.of_row(by_seed[seed])]
            assert (mode.task, mode.condition) in found
        with_mode = [r.utility for r in rows if (mode.task, mode.condition) in _keys(causes, r)]
        assert mode.mean_utility == pytest.approx(sum(with_mode) / len(with_mode))


def _keys(causes: Causes, row: Row) -> list[tuple[str, str]]:
    return [(c.task, c.condition) for c in causes.of_row(row)]


def test_the_interval_of_a_share_holds_the_truth_as_often_as_it_says() -> None:
    """Wilson's interval, summed over the binomial distribution: 95 % on average over shares."""
    runs, covered = 100, []
    for share in np.linspace(0.02, 0.98, 49):
        inside = 0.0
        for count in range(runs + 1):
            low, high = share_interval(count, runs)
            if low <= share <= high:
                inside += math.comb(runs, count) * share**count * (1 - share) ** (runs - count)
        covered.append(inside)
    assert 0.94 < float(np.mean(covered)) < 0.965
    assert min(covered) > 0.91


@pytest.mark.parametrize(("runs", "p"), [(50, 0.5), (400, 0.05), (400, 0.99), (2000, 0.01)])
def test_the_interval_of_a_quantile_holds_the_truth_as_often_as_it_says(runs: int, p: float) -> None:
    rng = np.random.default_rng(5)
    hits = 0
    for _ in range(1000):
        low, high = quantile_interval(sorted(rng.random(runs)), p)
        hits += low <= p <= high
    assert hits >= 930


def test_a_tilted_draw_keeps_its_likelihood(case: Case) -> None:
    """Weights of the tilted runs have mean 1, and weighted means are those of the plain runs."""
    event = read_event("end_s > 1", {})
    sampler = RareSampler(case, event)
    tilt = Tilt(
        shift={("leg_time_s", (0, 1)): 0.7, ("obs_time_s", (1,)): -0.4},
        chance={("leg_loss_u", (0, 1, 1)): 0.4, ("obs_success_u", (2,)): 0.5},
    )
    plain, weighted = [], []
    weights = []
    for seed in range(1, 501):
        plain.append(sampler.fly(seed, Tilt()).row.end_s)
        sample = sampler.fly(seed + 10_000, tilt)
        weights.append(math.exp(-sampler.log_ratio(sample, tilt)))
        weighted.append(sample.row.end_s * weights[-1])
    error = np.std(weights) / math.sqrt(len(weights))
    assert abs(np.mean(weights) - 1.0) < 4 * error
    spread = math.hypot(np.std(plain), np.std(weighted)) / math.sqrt(len(plain))
    assert abs(np.mean(plain) - np.mean(weighted)) < 4 * spread


def test_plain_runs_are_those_of_the_campaign(case: Case) -> None:
    sampler = RareSampler(case, read_event("utility < 1", {}))
    for seed in (1, 2, 77):
        assert sampler.fly(seed, Tilt()).row == pilot_of(case).row(seed)


def test_a_rare_event_with_a_closed_form_is_met(case: Case) -> None:
    """The first drive takes longer than so many seconds: a log-normal tail of 1e-4, within its interval."""
    variance = math.log1p((200 / 600) ** 2)
    z = NormalDist().inv_cdf(1 - 1e-4)
    drive_s = math.exp(math.log(600) - variance / 2 + z * math.sqrt(variance))
    plan = case.crl_text
    short = plan[: plan.index("(task :id look-T1")] + ")))"
    end_s = 40 + drive_s + 90  # two track starts, and what tracking adds to a drive
    sampler = RareSampler(
        Case(short, case.world_text, "abstract"),
        read_event(f"end_s > {end_s}", {}),
        RareOptions(pilot_runs=200, pilots=5),
    )
    found = sampler.estimate(3000, 1)
    assert found.probability == pytest.approx(1e-4, abs=4 * found.standard_error)
    assert found.standard_error < 0.15e-4
    assert found.runs + found.pilot_runs == 3000


def test_an_event_that_never_happened_may_still_have_the_chance_that_the_runs_leave_open(case: Case) -> None:
    sampler = RareSampler(case, read_event("end_s < 0", {}), RareOptions(pilot_runs=20, pilots=1))
    found = sampler.estimate(300, 1)
    assert (found.probability, found.hits, found.low) == (0.0, 0, 0.0)
    true_runs = round(0.1 * found.runs)
    assert (1 - found.high) ** true_runs == pytest.approx(0.025)  # so seldom nothing at all is seen of it
    assert summary_line(found).endswith(f"not seen in {found.runs} runs; at most {found.high:.3g}")


def test_the_interval_of_what_nearly_always_happens_ends_at_one(case: Case) -> None:
    sampler = RareSampler(case, read_event("end_s > 1", {}), RareOptions(pilot_runs=20, pilots=1))
    found = sampler.estimate(300, 1)
    assert found.probability > 0.9
    assert found.high == 1.0


def test_predictions_are_read_from_the_plan(tmp_path: Path) -> None:
    plan, world = write_small(tmp_path)
    (tmp_path / "summary.json").write_text('{"expected_utility": 7.5}')
    assert expected_utility(plan) == 7.5
    assert option_odds(read_case(plan, world, "abstract").plan()) == {"stay": 0.5}


def test_a_rare_kind_of_sol_is_tilted_and_named(case: Case) -> None:
    problem = {
        **case.problem,
        "format": "problem/2",
        "sol_kinds": [{"name": "quick", "p": 0.3}, {"name": "stuck", "p": 0.01, "drive_time_factor": 10.0}],
    }
    hidden = replace(case, world_text=world_text({**case.world, "problem": problem}))
    event = read_event("end_s > 2600", {})
    sampler = RareSampler(hidden, event, RareOptions(pilot_runs=200, pilots=3))
    tilt = Tilt(chance={("sol_u", (1,)): 0.6})
    samples = [sampler.fly(seed, tilt) for seed in range(1, 801)]
    asked = [s.coins["sol_u", (1,)] for s in samples if ("sol_u", (1,)) in s.coins]
    assert len(asked) / 800 == pytest.approx(0.7, abs=0.06)  # of sols that are not quick
    assert np.mean(asked) == pytest.approx(0.6, abs=0.07)
    weights = [math.exp(-sampler.log_ratio(s, tilt)) for s in samples]
    assert np.mean(weights) == pytest.approx(1.0, abs=4.0 * float(np.std(weights)) / math.sqrt(800))
    happened = np.array([event.holds(sampler.fly(seed, Tilt()).row) for seed in range(9_000, 11_000)])
    result = sampler.estimate(4000, seed=1)
    spread = math.hypot(result.standard_error, float(happened.std()) / math.sqrt(2000))
    assert result.probability == pytest.approx(float(happened.mean()), abs=4.0 * spread)
    assert any("chance of a stuck sol" in told for told in result.tilts)
