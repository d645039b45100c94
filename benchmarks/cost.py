"""How cost grows: processor seconds against targets, branches, runs of a campaign, and users at once.

Each curve is measured at a few sizes and fitted by c * n^p, least squares in logarithms; all are drawn into
one picture, `--picture`. Targets are planned with a fixed number of candidates, branches searched to the
end, runs flown by the abstract rover in this process; of users, each of whom reads a mission's list of
targets again and again, the server's process is measured.
"""

from __future__ import annotations

import asyncio
import json
import math
import os
import statistics
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.common.clock import median_spent
from benchmarks.common.figure import Figure, command, number
from benchmarks.common.served import ROOT, Server, ask, file_mission, place, service
from benchmarks.dry_run import bytes_in, order_for
from planner.problem import Problem, load_problem
from planner.solve import solve
from tests.planner.examples import problem_document

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CANDIDATES = 20
"""Looked at for each number of targets: enough for a plan; check and bound are in the cost, too."""
TARGET_BRANCHES = 4
DAY_S, DAY_J, LOSS, PENALTY = 9000.0, 3_000_000.0, 0.1, 20.0
"""A day in which some of the targets are reached, and an overrun costs a little more than one earns."""
CAMPAIGN = 10_000
CAMPAIGN_MOST_S, RUN_MOST_KB = 60.0, 2.0
"""For so many runs, and on disk for each run of a campaign of any size."""
QUICK = {
    "targets": (3, 5),
    "branches": (1, 2),
    "runs": (20, 100),
    "users": (2, 8),
    "reads": 20,
    "repeat": 1,
    "picture": Path(os.devnull),  # lines through two points
}
BUDGET_S = 900.0


@dataclass(frozen=True, slots=True)
class Curve:
    """Processor seconds at some sizes of one thing; at least two sizes."""

    what: str
    of: str
    sizes: tuple[int, ...]
    seconds: tuple[float, ...]

    def fit(self) -> tuple[float, float]:
        """Return c, in seconds, and p of c * n^p, by least squares in logarithms."""
        p, log_c = np.polyfit(np.log(self.sizes), np.log(self.seconds), 1)
        return float(np.exp(log_c)), float(p)

    def figures(self) -> Iterator[Figure]:
        """Yield each point, the power, and the factor by which a point is farthest from the fit."""
        for size, spent in zip(self.sizes, self.seconds, strict=True):
            yield Figure(f"{self.what}, {size:,} {self.of}", spent, "s")
        c, p = self.fit()
        logs = [math.log(s / (c * n**p)) for n, s in zip(self.sizes, self.seconds, strict=True)]
        yield Figure(f"{self.what}: p of {number(c)} s * {self.of}^p", p)
        yield Figure(f"{self.what}: farthest from the fit", math.exp(max(map(abs, logs))), "times")


def day_of(targets: int) -> Problem:
    """Return a problem of so many targets on a spiral."""
    angles = [0.7 * k for k in range(targets)]
    places = [((6 + 1.5 * k) * math.cos(a), (6 + 1.5 * k) * math.sin(a)) for k, a in enumerate(angles)]
    document = problem_document(
        places=places, time_s=DAY_S, energy_j=DAY_J, loss=LOSS, overrun_penalty=PENALTY
    )
    return load_problem(document)


def planning(targets: Sequence[int], repeat: int) -> Curve:
    """Measure plans for ever more targets."""
    plan = partial(solve, iterations=CANDIDATES, max_branches=TARGET_BRANCHES)
    plan(day_of(min(targets)))
    seconds = [median_spent(partial(plan, day_of(count)), repeat) for count in targets]
    return Curve("planning", "targets", tuple(targets), tuple(seconds))


def branching(branches: Sequence[int], repeat: int) -> Curve:
    """Measure plans of one problem with ever more branches."""
    problem = load_problem(ROOT / "examples" / "first_plan" / "three-rocks.json")
    plan = partial(solve, problem, time_limit_s=300.0)
    plan(max_branches=min(branches))
    seconds = [median_spent(partial(plan, max_branches=count), repeat) for count in branches]
    return Curve("a search", "branches", tuple(branches), tuple(seconds))


def flying(runs: Sequence[int]) -> tuple[Curve, float]:
    """Measure campaigns of ever more runs of ten targets; return also kilobytes a run of the last."""
    from ground.campaigns.conduct import Conduct, Plan, make_order
    from ground.campaigns.engines import HereEngine
    from ground.campaigns.folder import CampaignFolder
    from ground.campaigns.inputs import read_case

    with tempfile.TemporaryDirectory(prefix="outcrop-cost-") as work:
        folder = Path(work)
        given = order_for(folder)
        (folder / "plan.crl").write_text(given.crl_text, encoding="utf-8")
        (folder / "problem.json").write_text(json.dumps(given.problem), encoding="utf-8")
        order = make_order(read_case(folder / "plan.crl", folder / "problem.json", "abstract"), 1)
        seconds = []
        for number_of_it, count in enumerate((min(runs), *runs)):
            held = CampaignFolder(folder / str(number_of_it))
            held.open(order, resume=False)
            began = time.process_time()
            Conduct(held, order, Plan(count)).run(HereEngine())
            seconds.append(time.process_time() - began)
        return Curve("a campaign", "runs", tuple(runs), tuple(seconds[1:])), bytes_in(
            held.path
        ) / count / 1000


def reading(server: Server, mission: str, users: Sequence[int], reads: int, repeat: int) -> Curve:
    """Measure a server that ever more users ask at once, each so many times."""
    path = f"/api/v1/missions/{mission}/targets"
    seconds = []
    for count in (min(users), *users):
        rounds = []
        for _ in range(repeat):
            before = server.cpu_s()
            _, errors = asyncio.run(ask(server.port, path, count, lambda answered: answered < reads))
            if errors:
                raise RuntimeError(f"{count} users of {path}: {errors} errors")
            rounds.append(server.cpu_s() - before)
        seconds.append(statistics.median(rounds))
    return Curve(f"{reads} reads of each", "users", tuple(users), tuple(seconds[1:]))


@contextmanager
def mission_served() -> Iterator[tuple[Server, str]]:
    """Give a service and a mission of it."""
    with place() as environment, service(environment) as server:
        yield server, file_mission(server.api)[0]


def figures(
    targets: tuple[int, ...] = (5, 10, 20, 30),
    branches: tuple[int, ...] = (1, 2, 4, 8),
    runs: tuple[int, ...] = (100, 1_000, 5_000, CAMPAIGN),
    users: tuple[int, ...] = (1, 4, 16, 64),
    reads: int = 200,
    repeat: int = 3,
    picture: Path = ROOT / "docs" / "img" / "cost.svg",
) -> Iterator[Figure]:
    """Yield the points and the fit of each curve, and draw them."""
    curves = [planning(targets, repeat)]
    yield from curves[-1].figures()
    curves.append(branching(branches, repeat))
    yield from curves[-1].figures()
    curve, kilobytes = flying(runs)
    curves.append(curve)
    yield from curve.figures()
    yield Figure(f"a campaign of {runs[-1]:,} runs, a run", kilobytes, "kB", RUN_MOST_KB)
    if runs[-1] == CAMPAIGN:
        yield Figure(f"the campaign of {CAMPAIGN:,} runs", curve.seconds[-1], "s", CAMPAIGN_MOST_S)
    with mission_served() as (server, mission):
        curves.append(reading(server, mission, users, reads, repeat))
    yield from curves[-1].figures()
    draw(curves, picture)


def draw(curves: Sequence[Curve], path: Path) -> None:
    """Draw each curve with its fit, both axes logarithmic, seconds on one scale for all."""
    from matplotlib import pyplot as plt

    from studies.common.drawing import INK, save

    size = (2.4 * len(curves), 2.5)
    _, panels = plt.subplots(1, len(curves), figsize=size, sharey=True, layout="constrained")
    for axes, curve in zip(panels, curves, strict=True):
        panel(axes, curve)
    spent = [seconds for curve in curves for seconds in curve.seconds]
    decades = range(math.floor(math.log10(min(spent))), math.ceil(math.log10(max(spent))) + 1)
    panels[0].set_yticks([10.0**k for k in decades], [f"{10.0**k:g}" for k in decades])
    panels[0].set_ylabel("processor seconds", fontsize=8, color=INK)
    save(path)


def panel(axes: Axes, curve: Curve) -> None:
    """Draw one curve."""
    from studies.common.drawing import BLUE, GREY, INK, ORANGE

    c, p = curve.fit()
    ends = np.array([curve.sizes[0], curve.sizes[-1]], dtype=float)
    axes.loglog(ends, c * ends**p, color=ORANGE, lw=1.2)
    axes.loglog(curve.sizes, curve.seconds, "o", color=BLUE, ms=4)
    axes.set_xticks(curve.sizes, [f"{n // 1000}k" if n % 1000 == 0 else str(n) for n in curve.sizes])
    axes.minorticks_off()
    axes.tick_params(labelsize=7, colors=INK)
    axes.grid(True, axis="y", color=GREY, alpha=0.3, lw=0.6)
    axes.set_xlabel(curve.of, fontsize=8, color=INK)
    axes.set_title(f"{curve.what}\n{number(c)} s · n^{p:.2f}", fontsize=8, color=INK)
    axes.spines[["top", "right"]].set_visible(False)


if __name__ == "__main__":
    command(figures, QUICK, BUDGET_S)
