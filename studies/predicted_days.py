"""Does the rover agree with the planner's model? Days of `subframe` on sites that no calibration saw.

    .venv/bin/python -m studies.predicted_days --cache var/days --train 20 --days 100 [--docs docs]

Training: days on sites of their own, flown by the executive, so drives, tracks, placements and images are all
observed; the product's `calibrate` learns from their folders. Evaluation: days on fresh sites, drawn when the
command runs and printed. Each is planned with a calibration, with branches; the plan's futures give the
distribution of the utility, with every success coin tossed. Then it is flown. As a mission would, the
calibration is learned anew after every so many days, from all that were flown by then; so each is on a site
that its own calibration did not see. After the code has changed the same command with a new cache does all of
it again; an interrupted one goes on where it stood, and several processes may share a cache.

A day is inside its band by the randomised probability integral transform: v is drawn evenly between the
shares of futures that earned less, and at most as much, than was achieved; inside is 0.05 <= v <= 0.95. A
true model has 90 % there however coarse the utilities are; the closed interval from the 5th to the 95th
percentile would hold more. The draw depends on the seed of the day alone.
"""

from __future__ import annotations

import argparse
import fcntl
import json
import math
import secrets
import time
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ground.errors import InvalidInputError
from ground.resources.calibrations.driven_legs import DrivenLeg, calibrate, legs_of_run
from ground.resources.calibrations.made_activities import activities_of_run
from planner.outlook import outlook
from planner.path_network import CALIBRATIONS, Calibration
from planner.plan_tree import Plan
from planner.problem import START, Problem, TargetId
from rover_iface.terrain import generate_terrain
from studies.common.asked_days import PROFILE, PlannedDay, flown, planned_day
from studies.common.day_fates import fates, node_of, results
from studies.common.pages import table, write_section

TRAIN_BELOW, SEEDS = 2**20, 2**30
"""Seeds of training sites lie below the first, those of evaluation sites from there to the second."""
TARGETS = 5
BAND = (0.05, 0.95)
DAY, LEARNED = "day.json", "calibration.json"
RELEARN = 20
"""Days after which the calibration is learned anew: for it each day so far needs a map, a second of work."""
WAIT_S = 5.0
"""Between two looks whether another process has learned it."""


# ---------------------------------------------------------------------------------------------- days


@contextmanager
def claimed(folder: Path) -> Iterator[bool]:
    """Give whether the folder of a day is this process's to fill; it is let go at the end or its death."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "claim").open("w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            yield False
            return
        yield True


def fill(cache: Path, count: int, seeds: range, fly: Callable[[int, Path], dict[str, Any]]) -> None:
    """Fly days until the cache holds so many; first those that were begun and left."""
    while True:
        known = sorted(cache.glob("*/")) if cache.exists() else []
        left = [folder for folder in known if not (folder / DAY).exists()]
        if len(known) - len(left) >= count:
            return
        new = cache / str(seeds.start + secrets.randbelow(len(seeds)))
        busy = 0
        for folder in (*left, new):
            if folder == new and len(known) - len(left) + busy >= count:
                return  # the rest is being flown by others
            with claimed(folder) as mine:
                if not mine:
                    busy += 1
                elif not (folder / DAY).exists():
                    seed = int(folder.name)
                    print(f"seed {seed}", flush=True)
                    day = fly(seed, folder)
                    (folder / DAY).write_text(json.dumps(day, indent=1) + "\n", encoding="utf-8")
                    print(f"seed {seed}: {day.get('error') or day['line']}", flush=True)
                    break


def flown_or_error(seed: int, out: Path, calibration: Calibration | None, targets: int) -> dict[str, Any]:
    """Return the record of a day; what is not foreseen is told in it."""
    for old in (*out.glob("*.json"), *out.glob("*.jsonl")):
        old.unlink()
    begun = time.process_time()
    with ThreadPoolExecutor(1) as pool:  # whose future holds whatever is raised
        day = pool.submit(whole_day, seed, out, calibration, targets)
        err = day.exception()
    record: dict[str, Any] = {"processor_s": time.process_time() - begun}
    if err is None:
        return {**day.result(), **record}
    expected = isinstance(err, InvalidInputError)
    told = f"no day on this site: {err}" if expected else "".join(traceback.format_exception(err))
    return {"seed": seed, "error": told, "exception": not expected, **record}


def whole_day(seed: int, out: Path, calibration: Calibration | None, targets: int) -> dict[str, Any]:
    """Plan and fly a day, and return its record; without a calibration it is one to learn from."""
    return record_of(planned_day(seed, targets, calibration, quick=calibration is None), out)


def record_of(day: PlannedDay, out: Path) -> dict[str, Any]:
    """Return what was predicted of a day and what came of it; flies it into the folder `out`."""
    problem = day.prepared.problem
    foretold = prediction(problem, day.plan.tree.plan, day.seed)
    flight, rover = flown(day, out)
    refused = {r.target_id: r.reason for r in day.prepared.refused}
    became = fates(out, [t.id for t in day.asked.targets], refused, rover.truth.history)
    made = {node_of(r["command"][1]): r for r in results(out)}
    outcome = flight.outcome
    observations = []
    for o, chance in zip(problem.observations, foretold["made"], strict=True):
        told = made.get(f"observe-{o.id}")
        observations.append(
            {
                "id": o.id,
                "kind": o.kind.value,
                "utility": o.utility,
                "chance": chance,
                "tried": told is not None,
                "success": told is not None and bool(told["success"]),
            }
        )
    return {
        "seed": day.seed,
        "predicted": {k: v for k, v in foretold.items() if k != "made"},
        "achieved": {
            "utility": outcome.utility,
            "time_s": outcome.end_s,
            "energy_j": flight.samples[-1].energy_used_j if flight.samples else 0.0,
            "pit": list(shares(foretold["values"], outcome.utility)),
            "over_budget": outcome.over_budget,
        },
        "observations": observations,
        "drives": list(drives(problem, legs_flown(out))),
        "fates": [asdict(fate) for fate in became],
        "unreasoned": [name for name, r in made.items() if not r["success"] and not r["reason"]],
        "line": f"{outcome.utility:g} of {foretold['mean']:.1f} predicted, "
        f"{sum(f.placed for f in became)} of {len(became)} placed",
    }


def prediction(problem: Problem, plan: Plan, seed: int) -> dict[str, Any]:
    """Return what the planner's model says of a plan: its utility, time and energy, and what is made.

    `values` holds each utility with its share of the futures.
    """
    said = outlook(problem, plan, seed=seed)
    return {
        "mean": said.mean,
        "sd": said.sd,
        "time_s": said.time_s,
        "energy_j": said.energy_j,
        "overrun": said.overrun,
        "values": [[float(v), float(p)] for v, p in zip(said.values, said.shares, strict=True)],
        "made": list(said.made),
        "intraday_correlation": dict(problem.intraday_correlation),
    }


def shares(values: Sequence[Sequence[float]], achieved: float) -> tuple[float, float]:
    """Return the shares of futures that earned less than was achieved, and at most as much.

    `values` [k] are pairs of a utility and its share.
    """
    below = math.fsum(p for v, p in values if v < achieved - 1e-6)
    return below, below + math.fsum(p for v, p in values if abs(v - achieved) <= 1e-6)


def legs_flown(out: Path) -> list[DrivenLeg]:
    """Return the drives of a run; none where the rover never moved."""
    return legs_of_run(out) if any((out / "products").glob("*-odometry.json")) else []


def drives(problem: Problem, legs: Sequence[DrivenLeg]) -> Iterator[dict[str, Any]]:
    """Yield what was predicted of each drive of a run between places of the plan, and what it took."""
    of = {(str(leg.origin), str(leg.to)): leg for leg in problem.legs}
    here: str = START
    for leg in legs:
        said = of.get((here, leg.to))
        if said is not None and leg.energy_j > 0.0:  # of one that a budget cut short nothing is told
            overhead_s = problem.track_overhead_s_per_leg * len(leg.tracks)
            yield {
                "to": leg.to,
                "arrived": leg.arrived,
                "tracks": len(leg.tracks),
                "lost": sum(track.lost for track in leg.tracks),
                "said_lost": math.fsum(said.p_lose.get(TargetId(track.target), 0.0) for track in leg.tracks),
                "said_s": said.time_s.mean + overhead_s,
                "took_s": leg.duration_s,
                "said_j": said.energy_j.mean,
                "took_j": leg.energy_j,
            }
        if leg.arrived:
            here = leg.to


# ---------------------------------------------------------------------------------------------- training


def flown_days(cache: Path) -> list[Path]:
    """Return the folders of all days of a cache that were flown to their end, of training and evaluation."""
    return [f for f in sorted(cache.glob("*/*/")) if (f / "run.json").exists() and (f / DAY).exists()]


def learned(cache: Path, name: str) -> Calibration:
    """Return what the product learns from all days of a cache so far."""
    folders = flown_days(cache)
    legs = {folder.name: legs_flown(folder) for folder in folders}
    return calibrate(
        [leg for found in legs.values() for leg in found],
        PROFILE,
        {seed: generate_terrain(int(seed)) for seed, found in legs.items() if found},
        name=name,
        source=f"{len(folders)} recorded days on other sites",
        made=[one for folder in folders for one in activities_of_run(folder, PROFILE)],
    )


def calibration_of_block(block: Path, learn: Callable[[], Calibration]) -> Calibration:
    """Return the calibration of a block of days; one process learns it, before the block's first day."""
    kept = block / LEARNED
    while not kept.exists():
        with claimed(block) as mine:
            if mine and not kept.exists():
                model = learn()
                draft = kept.with_suffix(".draft")
                draft.write_text(CALIBRATIONS.write(model, indent=2) + "\n", encoding="utf-8")
                draft.replace(kept)
        if not mine:
            time.sleep(WAIT_S)
    return CALIBRATIONS.read_file(kept)


# ---------------------------------------------------------------------------------------------- summary


def pit_of(day: Mapping[str, Any]) -> float:
    """Return the randomised probability integral transform of a day's utility, 0 to 1."""
    below, upto = day["achieved"]["pit"]
    return float(below + (upto - below) * np.random.default_rng([day["seed"], 0x917]).random())


def mean_and_error(x: npt.ArrayLike) -> tuple[float, float]:
    """Return the mean of numbers [n] and its standard error."""
    values = np.asarray(x, dtype=float)
    error = float(values.std(ddof=1)) / math.sqrt(len(values)) if len(values) > 1 else math.inf
    return float(values.mean()), error


def ratio(took: npt.ArrayLike, said: npt.ArrayLike) -> tuple[float, float]:
    """Return the ratio of two sums over days [n] and its standard error (linearised; Cochran 1977, 2.11)."""
    a, b = np.asarray(took, dtype=float), np.asarray(said, dtype=float)
    share = float(a.sum() / b.sum())
    if len(a) < 2:
        return share, math.inf
    return share, float(np.std(a - share * b, ddof=1)) * math.sqrt(len(a)) / float(b.sum())


def summary(days: Sequence[Mapping[str, Any]], about: str) -> str:
    """Return what was predicted and what came, as Markdown; `days` are all that were tried."""
    good = [day for day in days if "achieved" in day]
    v = np.array([pit_of(day) for day in good])
    inside = (v >= BAND[0]) & (v <= BAND[1])
    middle = [sum(day["achieved"]["pit"]) / 2 for day in good]
    took = np.array([day["achieved"]["utility"] for day in good])
    said = np.array([day["predicted"]["mean"] for day in good])
    error = math.sqrt(sum(day["predicted"]["sd"] ** 2 for day in good)) / len(good)
    every = [drive for day in good for drive in day["drives"]]
    arrived = [drive for drive in every if drive["arrived"]]
    placing = [o for day in good for o in day["observations"] if o["kind"] == "place"]
    images = [o for day in good for o in day["observations"] if o["kind"] == "image"]
    became = [fate for day in good for fate in day["fates"]]
    wrong = sum(fate["what"] == "claimed and wrong" for fate in became)
    placed = sum(fate["what"].startswith("placed") for fate in became)

    def figures(name: str, unit: float, digits: int) -> list[str]:
        a = [day["achieved"][name] for day in good]
        b = [day["predicted"][name] for day in good]
        share, spread = ratio(a, b)
        size = f"{np.mean(b) / unit:.{digits}f}", f"{np.mean(a) / unit:.{digits}f}"
        return [*size, f"{share:.3f} +- {spread:.3f}"]

    def of_drives(some: Sequence[Mapping[str, Any]], what: str) -> list[str]:
        # drives of one day are not independent: errors are those over days
        ids = [id(drive) for drive in some]
        a = [sum(d[f"took_{what}"] for d in day["drives"] if id(d) in ids) for day in good]
        b = [sum(d[f"said_{what}"] for d in day["drives"] if id(d) in ids) for day in good]
        share, spread = ratio(a, b)
        count = max(len(some), 1)
        return [f"{sum(b) / count:.0f}", f"{sum(a) / count:.0f}", f"{share:.3f} +- {spread:.3f}"]

    def odds(some: Sequence[Mapping[str, Any]]) -> list[str]:
        expected, seen = sum(o["chance"] for o in some), sum(o["success"] for o in some)
        off = math.sqrt(sum(o["chance"] * (1 - o["chance"]) for o in some))
        return [f"{expected:.1f}", str(seen), f"{(seen - expected) / max(off, 1e-9):+.1f} deviations"]

    share, spread = ratio(took, said)
    rows = [
        ["utility of a day", f"{said.mean():.2f}", f"{took.mean():.2f} +- {mean_and_error(took)[1]:.2f}",
         f"{share:.3f} +- {spread:.3f}; {(took.mean() - said.mean()) / error:+.1f} predicted deviations"],
        ["time of a day, h", *figures("time_s", 3600.0, 2)],
        ["energy of a day, kJ", *figures("energy_j", 1000.0, 0)],
        [f"time of a drive, s ({len(every)})", *of_drives(every, "s")],
        [f"of one that arrived ({len(arrived)})", *of_drives(arrived, "s")],
        [f"energy of a drive, J ({len(every)})", *of_drives(every, "j")],
        [f"of one that arrived ({len(arrived)})", *of_drives(arrived, "j")],
        [f"placements that earned ({len(placing)})", *odds(placing)],
        [f"images that earned ({len(images)})", *odds(images)],
        [f"tracks lost on drives ({sum(d['tracks'] for d in every)})",
         f"{sum(d['said_lost'] for d in every):.1f}", str(sum(d["lost"] for d in every)), ""],
    ]  # fmt: skip
    exceptions = [day for day in days if day.get("exception")]
    sites = sum("error" in day and not day["exception"] for day in days)
    unreasoned = sum(len(day["unreasoned"]) for day in good)
    text = [
        about,
        "",
        table(["", "predicted", "came", "ratio"], rows),
        f"Inside the 90 % band: {int(inside.sum())} of {len(good)} days ({100 * inside.mean():.0f} %); "
        f"{int((v < BAND[0]).sum())} below, {int((v > BAND[1]).sum())} above. The transform's mean is "
        f"{v.mean():.2f}, by mid-ranks {np.mean(middle):.2f} (0.5 in a true model). {placed} of "
        f"{len(became)} targets have the tool on them, {wrong} claimed and wrong; {len(exceptions)} "
        f"exceptions, {unreasoned} failures without a reason; {sites} sites had no day to offer. "
        f"{np.mean([day['processor_s'] for day in good]):.0f} s of a processor a day.",
    ]
    return "\n".join(text)


def plot(days: Sequence[Mapping[str, Any]], path: Path) -> None:
    """Draw achieved over predicted utility with each day's band, and the histogram of the transform."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    good = [day for day in days if "achieved" in day]
    said = np.array([day["predicted"]["mean"] for day in good])
    took = np.array([day["achieved"]["utility"] for day in good])
    edges = np.array([[quantile(day["predicted"]["values"], p) for p in BAND] for day in good]).T
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 4.2), layout="constrained")
    bars = np.abs(edges - said)
    left.errorbar(said, said, yerr=bars, fmt="none", color="0.75", capsize=2, label="predicted, 5 to 95 %")
    left.plot(said, took, "o", ms=4, color="tab:blue", label="flown")
    left.plot([0, said.max()], [0, said.max()], "k--", lw=1)
    left.set(xlabel="predicted mean utility of a day", ylabel="utility achieved")
    left.legend(loc="upper left")
    right.hist([pit_of(day) for day in good], bins=10, range=(0, 1), color="tab:blue")
    right.axhline(len(good) / 10, color="k", ls="--", lw=1)
    right.set(xlabel="share of predicted futures below what came", ylabel="days")
    figure.savefig(path, dpi=110)
    plt.close(figure)


def seeds_of(days: Sequence[Mapping[str, Any]]) -> str:
    """Return the seeds of days as text."""
    return ", ".join(str(day["seed"]) for day in days)


def quantile(values: Sequence[Sequence[float]], p: float) -> float:
    """Return the least utility that at most `p` of the futures lie below; `values` as for `shares`."""
    total = 0.0
    for v, share in values:
        total += share
        if total >= p:
            return float(v)
    return float(values[-1][0])


def recorded(cache: Path, name: str) -> list[dict[str, Any]]:
    """Return the records of the days in all folders of a name."""
    return [json.loads(path.read_text("utf-8")) for path in sorted(cache.glob(f"{name}/*/{DAY}"))]


def report(cache: Path, targets: int) -> str:
    """Return both tables of a cache with their seeds, as Markdown."""
    days, before = recorded(cache, "days-*"), recorded(cache, "train")
    if not days:
        return "No day of the evaluation was flown."
    sources = [CALIBRATIONS.read_file(path).source for path in sorted(cache.glob(f"days-*/{LEARNED}"))]
    about = f"Days of {targets} targets, calibrated from {', then '.join(sources)}; seeds {seeds_of(days)}:"
    parts = [summary(days, about)]
    if before:
        told = f"The training days, by the rover profile's numbers; seeds {seeds_of(before)}:"
        parts.append(summary(before, told))
    return "\n\n".join(parts)


def main() -> None:
    """Fly what the cache lacks, and print the summary; with --docs put it and its picture into the docs."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cache", type=Path, required=True)
    parser.add_argument("--train", type=int, default=20, help="days to learn from")
    parser.add_argument("--days", type=int, default=100, help="days of the evaluation")
    parser.add_argument("--targets", type=int, default=TARGETS)
    parser.add_argument("--relearn", type=int, default=RELEARN, help="days after which it is learned anew")
    parser.add_argument("--calibration", type=Path, help="plan with this one instead of what is learned")
    parser.add_argument("--docs", type=Path)
    arguments = parser.parse_args()
    cache, targets = arguments.cache, arguments.targets
    fill(
        cache / "train",
        arguments.train,
        range(TRAIN_BELOW),
        partial(flown_or_error, calibration=None, targets=targets),
    )
    for first in range(0, arguments.days, arguments.relearn):
        block = cache / f"days-{first:03d}"
        given: Path | None = arguments.calibration
        model = calibration_of_block(
            block,
            partial(CALIBRATIONS.read_file, given) if given else partial(learned, cache, block.name),
        )
        fill(
            block,
            min(arguments.relearn, arguments.days - first),
            range(TRAIN_BELOW, SEEDS),
            partial(flown_or_error, calibration=model, targets=targets),
        )
    text = report(cache, targets)
    print(text)
    if arguments.docs is not None:
        plot(recorded(cache, "days-*"), arguments.docs / "img" / "predicted-days.png")
        write_section(arguments.docs, "predicted-days", "days", text)


if __name__ == "__main__":
    main()
