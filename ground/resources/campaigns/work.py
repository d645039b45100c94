"""Fly a campaign, and write down what its runs say while they go on."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict
from functools import partial

from ground.campaigns.case import Case, Cases, world_text
from ground.campaigns.conduct import Conduct, Plan, make_order, result_of, tally_of
from ground.campaigns.dask_engine import engine_here, nothing
from ground.campaigns.engines import Engine
from ground.campaigns.folder import MAIN, CampaignFolder, CampaignOrder, write_whole
from ground.campaigns.result import RESULTS
from ground.campaigns.row import Row
from ground.campaigns.units import Unit, cut
from ground.campaigns.variant import canonical
from ground.errors import JobFailedError
from ground.gdr.places import JOB_PATIENCE_S, fetched, keep_folder, open_store, place_of
from ground.jobs.queue import Report, WorkStoppedError
from ground.resources.campaigns.order import CampaignWork

LIVE = "live.json"
LIVE_S = 1.0
"""Between two looks at the runs so far; each costs time in proportion to them."""


class LiveEngine:
    """Writes what the main series says so far while an engine flies, with the runs of attempts before."""

    def __init__(self, engine: Engine, folder: CampaignFolder, order: CampaignOrder, runs: int) -> None:
        self._engine = engine
        self._path, self._order = folder.path / LIVE, order
        self._case = order.case()
        self._tally = tally_of(self._case)
        self._next = 0.0
        for unit in cut(MAIN, order.seed, runs, order.unit):
            self._take(folder.read_unit(unit) or "")
        if self._tally.runs:
            self._tell()

    def _take(self, text: str) -> None:
        for line in text.splitlines():
            self._tally.add(Row.read(line))

    def close(self) -> None:
        self._engine.close()

    def fly(
        self, cases: Cases, units: Iterable[Unit], should_stop: Callable[[], bool]
    ) -> Iterator[tuple[Unit, str]]:
        for unit, text in self._engine.fly(cases, units, should_stop):
            if unit.series == MAIN:
                self._take(text)
                self._tell()
            yield unit, text

    def _tell(self) -> None:
        now = time.monotonic()
        if now >= self._next:
            write_whole(self._path, RESULTS.write(result_of(self._order, self._case, self._tally, "")) + "\n")
            self._next = time.monotonic() + max(LIVE_S, 20 * (time.monotonic() - now))


def case_of(order: CampaignWork) -> Case:
    """Return the case that a job is to fly."""
    world = {
        "format": "world/1",
        "name": str(order.problem.get("name", "")),
        "profile": order.rover_profile,
        "problem": order.problem,
        "sun": asdict(order.sky),
        "terrain": str(place_of(order.terrain_dir)),
    }
    return Case(canonical(order.crl_text), world_text(world), order.rover)


def work(order: CampaignWork, report: Report, should_stop: Callable[[], bool]) -> dict[str, object]:
    """Return `campaign/1`. Units that are in the folder from an attempt before are kept.

    Raises
    ------
    JobFailedError
        If plan, world or rover cannot be used.
    """
    from executive.errors import ExecutiveError
    from rover_iface.errors import RoverError

    kept = open_store(order.folder, JOB_PATIENCE_S)
    folder = CampaignFolder(kept.root)
    try:
        asked = make_order(
            case_of(order),
            order.seed,
            help_runs=min(order.help_runs, order.runs),
            expected_utility=order.expected_utility,
        )
        folder.open(asked, resume=True)
        conduct = Conduct(
            folder,
            asked,
            Plan(order.runs, order.until_se),
            lambda done, of: report(min(0.99, done / of), f"{done:,} of {of:,} runs"),
            should_stop,
        )
        bring = nothing if order.rover == "abstract" else partial(fetched, order.terrain_dir)
        engine = engine_here(bring)
        flown = conduct.run(LiveEngine(engine, folder, asked, order.runs))
    except (RoverError, ExecutiveError) as err:
        raise JobFailedError(str(err)) from err
    if flown is None:
        raise WorkStoppedError
    keep_folder(kept)
    return {"result": RESULTS.document(flown)}
