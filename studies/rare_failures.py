"""Importance sampling against closed forms and brute force: bias, relative error, coverage of the interval.

    python -m studies.rare_failures [--repeats 100] [--runs 20000] [--brute 300000] [--seed S] [--workers 2]

Three failures of a plan that tracks three targets, drives once and observes once. Each is estimated anew,
with fresh seeds, in each repetition:

- *three tracks*: all of three targets are lost on the drive: the product of three chances, 1e-5;
- *long drive*: the drive takes longer than the 1 - 1e-5 quantile of its log-normal time;
- *late and spoilt*: drive and observation end late and the observation is spoilt, about 1e-3: its truth is a
  brute-force count, by the same rover without tilts.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from concurrent.futures import ProcessPoolExecutor
from functools import lru_cache
from statistics import NormalDist, mean, stdev

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


def case() -> Case:
    """Return the case of the study."""
    amount = {"mean": LOOK[0], "sd": LOOK[1]}
    observe = {"time_s": amount, "energy_j": {"mean": 1000.0, "sd": 0.0}}
    problem = {
        "format": "problem/1",
        "name": "rare",
        "start": {"east_m": 0.0, "north_m": 0.0},
        "budget": {"time_s": 9000.0, "energy_j": 1e6},
        "hotel_w": 10.0,
        "track_start": {"time_s": 20.0, "energy_j": 200.0},
        "track_overhead_s_per_leg": 45.0,
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

    return Case(canonical_text(parse(crl)), world_text(world), "abstract")


def events() -> dict[str, tuple[str, float | None]]:
    """Return the events with their closed forms; None where there is none."""
    variance = math.log1p((DRIVE[1] / DRIVE[0]) ** 2)
    drive_s = math.exp(
        math.log(DRIVE[0]) - variance / 2 + NormalDist().inv_cdf(1 - 1e-5) * math.sqrt(variance)
    )
    return {
        "three tracks": ("lost A and lost B and lost C", math.prod(LOSSES)),
        "long drive": (f"end_s > {60 + 135 + drive_s:.3f}", 1e-5),
        "late and spoilt": (f"end_s > {LATE_S} and failed look", None),
    }


@lru_cache(maxsize=8)
def sampler(text: str, short: bool) -> RareSampler:
    """Return the sampler of an event; `short` leaves the observation out of the plan."""
    whole = case()
    if short:
        cut = whole.crl_text[: whole.crl_text.index(" (task :id look")] + ")))"
        whole = Case(cut, whole.world_text, whole.rover)
    return RareSampler(whole, read_event(text, {"failed": ["look"], "lost": TARGETS}))


def estimate(text: str, short: bool, runs: int, seed: int) -> tuple[float, float, float, float]:
    """Return estimate, standard error and interval of one repetition."""
    found = sampler(text, short).estimate(runs, seed)
    return found.probability, found.standard_error, found.low, found.high


def count(text: str, first: int, runs: int) -> int:
    """Return how often an event happens in plain runs."""
    event, pilot = sampler(text, False).event, pilot_of(case())
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
            interval = (truth, truth)
            if truth is None:
                parts = chunks(seed, options.brute)
                hits = sum(pool.map(count, *zip(*[(text, *part) for part in parts], strict=True)))
                truth, interval = hits / options.brute, share_interval(hits, options.brute)
            firsts = [seed + 10_000_000 + k * options.runs for k in range(options.repeats)]
            short = name == "long drive"
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
                "truth_interval": interval,
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
