"""Conducts a campaign: what is missing is flown, what is there is kept, and then it is summed up."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from ground.campaigns.case import Case, observations_of, sha256_of
from ground.campaigns.causes import Causes
from ground.campaigns.compare import paired
from ground.campaigns.engines import Engine
from ground.campaigns.folder import MAIN, RESULT, CampaignFolder, CampaignOrder, SeriesOrder, write_whole
from ground.campaigns.helps import help_cases
from ground.campaigns.inputs import option_odds
from ground.campaigns.intervals import Moments
from ground.campaigns.pilot import pilot_of
from ground.campaigns.result import RESULTS, CampaignResult, Difference
from ground.campaigns.row import Row
from ground.campaigns.tally import Tally
from ground.campaigns.units import Unit, cut, unit_size
from ground.campaigns.variant import NamedCase
from ground.errors import InvalidInputError

MOST_RUNS = 10_000_000
LEAST_RUNS = 200
"""Before the rule `until_se` may stop a campaign: the spread of fewer runs is too uncertain."""
VARIANTS, HELPS = "variants", "helps"

Report = Callable[[int, int], None]
"""Told how many runs are done, of how many."""


def _silent(_done: int, _runs: int) -> None:
    """Tell nobody."""


def _never() -> bool:
    return False


@dataclass(frozen=True, slots=True)
class Plan:
    """How many runs, and when it may end earlier.

    Parameters
    ----------
    runs
        Seeds of the main series and of each variant.
    until_se
        End at the first unit, in order, after which the standard error of the mean utility is at most this.
    """

    runs: int
    until_se: float | None = None

    def __post_init__(self) -> None:
        if not 1 <= self.runs <= MOST_RUNS:
            raise InvalidInputError(f"--runs is {self.runs}; it must be 1 to {MOST_RUNS}")
        if self.until_se is not None and not self.until_se > 0:
            raise InvalidInputError(f"--until-se is {self.until_se:g}; it must be more than 0")


def make_order(
    base: Case,
    seed: int,
    *,
    variants: Sequence[NamedCase] = (),
    help_runs: int = 0,
    expected_utility: float | None = None,
) -> CampaignOrder:
    """Return the order of a campaign; `help_runs` seeds answer each question of what would help most.

    Raises
    ------
    InvalidInputError
        If the seed is negative or too large for its runs.
    """
    from importlib.metadata import version

    if not 0 <= seed < 2**62:
        raise InvalidInputError(f"--seed is {seed}; it must be at least 0 and less than 2^62")
    series = [SeriesOrder(MAIN, base.crl_text, base.world_text)]
    series += [_series(VARIANTS, v, 0) for v in variants]
    if help_runs:
        series += [_series(HELPS, c, help_runs) for c in help_cases(base)]
    return CampaignOrder(
        version("outcrop"), base.rover, seed, unit_size(base.rover), tuple(series), expected_utility
    )


def _series(folder: str, named: NamedCase, runs: int) -> SeriesOrder:
    return SeriesOrder(f"{folder}/{named.name}", named.case.crl_text, named.case.world_text, runs)


@dataclass(frozen=True)
class Conduct:
    """A campaign that is to be flown into its folder.

    What it says (`runs.csv`, `campaign.json`) is the same whatever the engine, its workers, and however often
    it was broken off. Units that were flown stay, also those that a stop rule or fewer runs leave uncounted.
    """

    folder: CampaignFolder
    order: CampaignOrder
    plan: Plan
    report: Report = _silent
    should_stop: Callable[[], bool] = _never

    def run(self, engine: Engine) -> CampaignResult | None:
        """Fly what is missing and sum up; None if it was stopped before the end (what is there stays)."""
        if not self._fly(engine, MAIN, self.plan.runs):
            return None
        runs = self._stop_at()
        for series in self.order.series[1:]:
            if not self._fly(engine, series.name, self._runs_of(series, runs)):
                return None
        return self.sum_up(runs)

    def _runs_of(self, series: SeriesOrder, runs: int) -> int:
        return min(series.runs, runs) if series.runs else runs

    def _units(self, series: str, runs: int) -> list[Unit]:
        return list(cut(series, self.order.seed, runs, self.order.unit))

    def _fly(self, engine: Engine, series: str, runs: int) -> bool:
        """Fly the units of a series that are not there; return whether all are there now."""
        units = self._units(series, runs)
        missing = [u for u in units if self.folder.read_unit(u) is None]
        done = runs - sum(u.count for u in missing)
        self.report(done, runs)
        if not missing:
            return True
        rule = _Rule(self, series, units, missing)
        for unit, text in engine.fly({series: self.order.case(series)}, missing, rule.over):
            self.folder.write_unit(unit, text)
            rule.take(unit, text)
            done += unit.count
            self.report(done, runs)
        return rule.met or done == runs

    def _stop_at(self) -> int:
        """Return how many runs count: all, or as many as the rule `until_se` needs."""
        if self.plan.until_se is None:
            return self.plan.runs
        moments, count = Moments(), 0
        for unit in self._units(MAIN, self.plan.runs):
            text = self.folder.read_unit(unit)
            if text is None:
                break
            for line in text.splitlines():
                moments.add(Row.read(line).utility)
            count += unit.count
            if enough(moments, self.plan.until_se):
                break
        return count

    def sum_up(self, runs: int) -> CampaignResult:
        """Write `runs.csv` and `campaign.json` of all series from their units; return the main one."""
        differences: dict[str, list[Difference]] = {VARIANTS: [], HELPS: []}
        for series in self.order.series[1:]:
            flown = self._runs_of(series, runs)
            result = self._result(series.name, flown)
            kind, _, name = series.name.partition("/")
            pair = paired(self.folder.rows(series.name, flown), self.folder.rows(MAIN, flown), name)
            differences[kind].append(pair)
            self._write(series.name, result)
        helps = sorted(differences[HELPS], key=lambda d: (-d.mean, d.name))
        result = replace(self._result(MAIN, runs), variants=tuple(differences[VARIANTS]), helps=tuple(helps))
        self._write(MAIN, result)
        return result

    def _write(self, series: str, result: CampaignResult) -> None:
        path = self.folder.series_folder(series) / RESULT
        write_whole(path, RESULTS.write(result, indent=1) + "\n")

    def _result(self, series: str, runs: int) -> CampaignResult:
        digest = self.folder.write_csv(series, runs)
        case = self.order.case(series)
        tally = tally_of(case)
        for row in self.folder.rows(series, runs):
            tally.add(row)
        stopped = ""
        if series == MAIN and self.plan.until_se is not None and runs < self.plan.runs:
            stopped = f"the standard error is at most {self.plan.until_se:g}"
        predicted = self.order.expected_utility if series == MAIN else None
        return result_of(self.order, case, tally, digest, predicted=predicted, stopped=stopped)


class _Rule:
    """Watches the rule `until_se` while units come in any order."""

    def __init__(self, conduct: Conduct, series: str, units: Sequence[Unit], missing: Sequence[Unit]) -> None:
        self._conduct, self._limit = conduct, conduct.plan.until_se if series == MAIN else None
        self._moments, self._next, self._units = Moments(), 0, units
        self._open = {u.index for u in missing}
        self._held: dict[int, list[float]] = {}
        self.met = False
        if self._limit is not None:
            for unit in units:
                if unit.index in self._open:
                    break
                self._count(conduct.folder.read_unit(unit) or "")

    def _count(self, text: str) -> None:
        self._add([Row.read(line).utility for line in text.splitlines()])

    def _add(self, utilities: Sequence[float]) -> None:
        for utility in utilities:
            self._moments.add(utility)
        self._next += 1
        if self._limit is not None and enough(self._moments, self._limit):
            self.met = True

    def take(self, unit: Unit, text: str) -> None:
        if self._limit is None or self.met:
            return
        self._open.discard(unit.index)
        self._held[unit.index] = [Row.read(line).utility for line in text.splitlines()]
        while not self.met and self._next < len(self._units) and self._next not in self._open:
            held = self._held.pop(self._next, None)
            if held is None:
                self._count(self._conduct.folder.read_unit(self._units[self._next]) or "")
            else:
                self._add(held)

    def over(self) -> bool:
        return self.met or self._conduct.should_stop()


def enough(moments: Moments, until_se: float) -> bool:
    """Return whether a campaign may end by the rule `until_se`."""
    return moments.runs >= LEAST_RUNS and moments.standard_error <= until_se


def tally_of(case: Case) -> Tally:
    """Return an empty tally for the rows of a case."""
    return Tally(Causes.of(case.plan()), pilot_of(case).node_ids)


def result_of(
    order: CampaignOrder,
    case: Case,
    tally: Tally,
    digest: str,
    *,
    predicted: float | None = None,
    stopped: str = "",
) -> CampaignResult:
    """Return what the rows taken so far say."""
    if not tally.runs or not math.isfinite(tally.moments.mean):
        raise InvalidInputError("a campaign without runs says nothing")
    return CampaignResult(
        campaign=sha256_of(order.program, case.digest, str(order.seed)),
        futures=futures_of(case),
        rover=order.rover,
        seed=order.seed,
        runs=tally.runs,
        digest=digest,
        utility=tally.utility(predicted),
        outcomes=dict(sorted(tally.outcomes.items())),
        options=dict(sorted(tally.options.items())),
        frequencies=tally.frequencies(option_odds(case.plan())),
        nodes=tally.nodes(),
        end_s=tally.quantiles("end_s"),
        energy_used_j=tally.quantiles("energy_used_j"),
        histogram=tally.histogram(),
        convergence=tally.convergence(),
        worst=tally.worst(),
        failures=tally.failures(),
        stopped=stopped,
    )


def futures_of(case: Case) -> str:
    """Return a digest of what gives a seed its meaning: the rover, the places and the observations."""
    targets = case.problem.get("targets", ())
    names = [f"{t['id']}:{','.join(o['id'] for o in observations_of(t))}" for t in targets]
    return sha256_of(case.rover, *map(str, names))
