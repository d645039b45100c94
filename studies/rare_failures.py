"""Importance sampling against closed forms and brute force: bias, relative error, coverage of the interval.

    python -m studies.rare_failures [--repeats 100] [--runs 20000] [--brute 300000] [--seed S] [--workers 2]

Three failures of a plan that tracks three targets, drives once and observes once. Each is estimated anew,
with fresh seeds, in each repetition:

- *three tracks*: all of three targets are lost on the drive: the product of three chances, 1e-5;
- *long drive*: the drive takes longer than the 1 - 1e-5 quantile of its log-normal time;
- *late and spoilt*: drive and observation end late and the observation is spoilt, about 1e-3: the chance of
  a spoilt observation times that of a sum of two log-normals, by quadrature.

Each is counted by brute force too, by the same rover without tilts; where that expects at least ten, its
interval stands beside the truth.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from concurrent.futures import ProcessPoolExecutor
from functools import lru_cache
from statistics import NormalDist, mean, stdev

import numpy as np

from ground.campaigns.case import Case, world_text
from ground.campaigns.events import read_event
from ground.campaigns.intervals import share_interval
from ground.campaigns.pilot import pilot_of
from ground.campaigns.rare import RareSampler

LOSSES = (0.02, 0.02, 0.025)
TARGETS = ("A", "B", "C")
DRIVE, LOOK = (600.0, 200.0), (300.0, 90.0)
P_SPOILT = 0.05
LATE_S = 1550.0
TRACK_S, CARRIED_S = 20.0, 45.0
"""What a track takes to start, and on the drive."""


def case(short: bool = False) -> Case:
    """Return the case of the study; `short` leaves the observation out of the plan."""
    amount = {"mean": LOOK[0], "sd": LOOK[1]}
    observe = {"time_s": amount, "energy_j": {"mean": 1000.0, "sd": 0.0}}
    problem = {
        "format": "problem/1",
        "name": "rare",
        "start": {"east_m": 0.0, "north_m": 0.0},
        "budget": {"time_s": 9000.0, "energy_j": 1e6},
        "hotel_w": 10.0,
        "track_start": {"time_s": TRACK_S, "energy_j": 200.0},
        "track_overhead_s_per_leg": CARRIED_S,
        "targets": [
            {
                "id": name,
                "point_m": [5.0 + k, 0.0, 0.0],
                "observation_point": {"east_m": 4.0 + k, "north_m": 0.0},
                "observations": [
                    {
                        "id": f"{name}-mi",
                        "kind": "place",
                        "utility": 1.0,
                        "instrument": "mi",
                        "observe": observe,
                    },
                    *(
                        [
                            {
                                "id": "A-img",
                                "kind": "image",
                                "utility": 1.0,
                                "instrument": "scicam",
                                "p_success": 1.0 - P_SPOILT,
                                "observe": observe,
                            }
                        ]
                        if name == "A"
                        else []
                    ),
                ],
            }
            for k, name in enumerate(TARGETS)
        ],
        "legs": [
            {
                "from": "start",
                "to": "A",
                "time_s": {"mean": DRIVE[0], "sd": DRIVE[1]},
                "energy_j": {"mean": 50000.0, "sd": 5000.0},
                "p_lose": dict(zip(TARGETS, LOSSES, strict=True)),
            }
        ],
    }
    tracks = "\n".join(
        f"(task :id track-{t} :continue-on-failure t :action trackstart :parameters (target = {t}))"
        for t in TARGETS
    )
    crl = f"""(plan :id rare :node (block :id root :node-list ({tracks}
      (task :id drive :continue-on-failure t :action navigate :parameters (target = A))
      (task :id look :continue-on-failure t :reward 1 :metadata (observation = A-img)
        :action image :parameters (target = A instrument = scicam)))))"""
    world = {"format": "world/1", "name": "rare", "problem": problem}
    from executive.crl.printer import canonical_text
    from executive.crl.reader import parse

    text = canonical_text(parse(crl))
    if short:
        text = text[: text.index(" (task :id look")] + ")))"
    return Case(text, world_text(world), "abstract")


def _ln(amount: tuple[float, float]) -> tuple[float, float]:
    """Return mean and standard deviation of the logarithm of a log-normal time of a mean and spread, s."""
    variance = math.log1p((amount[1] / amount[0]) ** 2)
    return math.log(amount[0]) - variance / 2, math.sqrt(variance)


def _longer(limit_s: float) -> float:
    """Return the chance that a drive and an observation take longer than a limit, by Simpson's rule."""
    normal = NormalDist()
    (mu, sigma), (look_mu, look_sigma) = _ln(DRIVE), _ln(LOOK)
    z = np.linspace(-9.0, 9.0, 20_001)
    left_s = limit_s - np.exp(mu + sigma * z)
    beyond = [1.0 if s <= 0 else 1.0 - normal.cdf((math.log(s) - look_mu) / look_sigma) for s in left_s]
    weights = np.where(np.arange(len(z)) % 2, 4.0, 2.0)
    weights[[0, -1]] = 1.0
    density = np.exp(-z * z / 2) / math.sqrt(2 * math.pi)
    return float((weights * beyond * density).sum() * (z[1] - z[0]) / 3)


def events() -> dict[str, tuple[str, float]]:
    """Return the events with their chances."""
    mu, sigma = _ln(DRIVE)
    drive_s = math.exp(mu + NormalDist().inv_cdf(1 - 1e-5) * sigma)
    before_s = len(TARGETS) * (TRACK_S + CARRIED_S)
    return {
        "three tracks": ("lost A and lost B and lost C", math.prod(LOSSES)),
        "long drive": (f"end_s > {before_s + drive_s:.3f}", 1e-5),
        "late and spoilt": (f"end_s > {LATE_S} and failed look", P_SPOILT * _longer(LATE_S - before_s)),
    }


@lru_cache(maxsize=8)
def sampler(text: str, short: bool) -> RareSampler:
    """Return the sampler of an event."""
    return RareSampler(case(short), read_event(text, {"failed": ["look"], "lost": TARGETS}))


def estimate(text: str, short: bool, runs: int, seed: int) -> tuple[float, float, float, float]:
    """Return estimate, standard error and interval of one repetition."""
    found = sampler(text, short).estimate(runs, seed)
    return found.probability, found.standard_error, found.low, found.high


def count(text: str, short: bool, first: int, runs: int) -> int:
    """Return how often an event happens in plain runs."""
    event, pilot = sampler(text, short).event, pilot_of(case(short))
    return sum(event.holds(pilot.row(seed)) for seed in range(first, first + runs))


def chunks(first: int, runs: int, most: int = 5000) -> list[tuple[int, int]]:
    """Return parts of so many runs as (first seed, runs), none longer than `most`."""
    return [(start, min(most, first + runs - start)) for start in range(first, first + runs, most)]


def main() -> None:
    """Print a table and write `studies/results/rare_failures.json`."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=100)
    parser.add_argument("--runs", type=int, default=20_000)
    parser.add_argument("--brute", type=int, default=300_000)
    parser.add_argument("--seed", type=int, default=None, help="fresh from the clock when absent")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--only", choices=list(events()), action="append")
    options = parser.parse_args()
    seed = options.seed if options.seed is not None else time.time_ns() % 1_000_000_000
    print(f"seed {seed}, {options.repeats} repetitions of {options.runs} runs")
    results = {}
    with ProcessPoolExecutor(options.workers) as pool:
        for name, (text, truth) in events().items():
            if options.only and name not in options.only:
                continue
            interval, short = None, name == "long drive"
            if truth * options.brute >= 10.0:
                parts = chunks(seed, options.brute)
                hits = sum(pool.map(count, *zip(*[(text, short, *part) for part in parts], strict=True)))
                interval = share_interval(hits, options.brute)
                print(f"{name}: {hits} of {options.brute} plain runs, {interval[0]:.3g} to {interval[1]:.3g}")
            firsts = [seed + 10_000_000 + k * options.runs for k in range(options.repeats)]
            found = list(
                pool.map(
                    estimate, *zip(*[(text, short, options.runs, first) for first in firsts], strict=True)
                )
            )
            guesses = [p for p, *_ in found]
            covered = sum(low <= truth <= high for _, _, low, high in found)
            bias = (mean(guesses) - truth) / (stdev(guesses) / math.sqrt(len(guesses)))
            row = {
                "event": text,
                "truth": truth,
                "counted_interval": interval,
                "mean": mean(guesses),
                "bias_in_standard_errors": bias,
                "relative_standard_error": stdev(guesses) / truth,
                "claimed_relative_standard_error": mean(e for _, e, *_ in found) / truth,
                "covered": covered,
                "repeats": options.repeats,
            }
            results[name] = row
            error, claimed = row["relative_standard_error"], row["claimed_relative_standard_error"]
            print(
                f"{name:16} truth {truth:.4g}  mean {row['mean']:.4g} ({bias:+.1f} standard errors)  "
                f"relative error {error:.1%}, claimed {claimed:.1%}; interval right {covered} of "
                f"{options.repeats}",
                flush=True,
            )
    with open("studies/results/rare_failures.json", "w", encoding="utf-8") as file:  # noqa: PTH123
        json.dump(
            {"seed": seed, "runs": options.runs, "brute": options.brute, "events": results}, file, indent=1
        )
        file.write("\n")


if __name__ == "__main__":
    main()
