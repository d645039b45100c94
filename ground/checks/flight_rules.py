"""The flight rules: what each holds of a plan, given the facts of its day.

A server takes the facts from its rows and has all of them; a pipeline takes them from files and may lack
some. A rule whose facts are absent is undecided and says what is missing.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from typing import TYPE_CHECKING

from ground.campaigns.case import observations_of
from ground.campaigns.result import CampaignResult
from ground.campaigns.tally import OVER
from ground.checks.used_observations import OpenUse

if TYPE_CHECKING:
    from planner.problem_document import ObservationDocument, PoseDocument, ProblemDocument, TargetDocument

MARS_HOUR_S = 88_775.244 / 24
"""Seconds of an hour of local mean solar time."""


@dataclass(frozen=True, slots=True)
class Rule:
    """One flight rule of the file."""

    id: str
    check: str
    title: str
    limit: float
    unit: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Facts:
    """What the rules look at; None where it is not known.

    Attributes
    ----------
    problem, planned
        The planning problem, None where it came with an archive, so that nothing here vouches for it; and the
        ids of the observations that the plan makes.
    open_uses
        Tasks of which it cannot be told which observation they make; rules on observations that hold of the
        others are undecided then.
    errors
        What the validator found wrong, as texts.
    instruments
        Of the rover, by name.
    slope
        Slope of the ground at east, north, radians.
    overrun
        Share of the futures that end over a budget, by the planner; None where it is not to be trusted.
    campaign, least_runs
        What the largest campaign of the plan says, and how many runs are asked for.
    """

    problem: ProblemDocument | None
    planned: frozenset[str]
    errors: tuple[str, ...]
    instruments: frozenset[str]
    slope: Callable[[float, float], float] | None
    battery_j: float | None
    energy_floor_j: float | None
    start_lmst_h: float | None
    overrun: float | None
    campaign: CampaignResult | None
    least_runs: int
    open_uses: tuple[OpenUse, ...] = ()

    def day(self) -> ProblemDocument:
        """Return the problem, which every rule reads that holds of the day or of runs in its world.

        Raises
        ------
        UndecidedError
            If nothing here vouches for it.
        """
        if self.problem is None:
            raise UndecidedError("the problem came with an archive and counts for no rule; plan anew here")
        return self.problem

    def observations(self) -> Iterator[tuple[TargetDocument, ObservationDocument]]:
        """Yield each planned observation with its target."""
        for target in self.day().get("targets", ()):
            for observation in observations_of(target):
                if observation["id"] in self.planned:
                    yield target, observation


class UndecidedError(Exception):
    """A rule's facts are absent; the message says which."""


Verdict = tuple[bool, float | None, str]
"""Whether the rule holds, the value found, and what to say about it."""


def _name(target: TargetDocument) -> str:
    return (target.get("refs") or {}).get("name", target["id"])


def _stand(target: TargetDocument) -> PoseDocument:
    found = target.get("observation_point")
    if found is None:
        raise UndecidedError(f"the problem has no observation_point of {target['id']}")
    return found


def _settled(verdict: Verdict, uses: Iterable[OpenUse]) -> Verdict:
    """Return a verdict on observations: what is broken is broken, what holds holds if none is open."""
    if verdict[0] and (said := "; ".join(dict.fromkeys(use.said for use in uses))):
        raise UndecidedError(said)
    return verdict


def _tilt(facts: Facts, limit: float) -> Verdict:
    worst, where = 0.0, "no observation point in the plan"
    for target, _ in facts.observations():
        if facts.slope is None:
            raise UndecidedError("no terrain is given")
        pose = _stand(target)
        slope = facts.slope(pose["east_m"], pose["north_m"])
        if math.isnan(slope) or slope >= worst:
            worst, where = slope, f"steepest at {_name(target)}"
    return _settled((worst <= limit, worst, where), facts.open_uses)


def _energy_floor(facts: Facts, limit: float) -> Verdict:
    if facts.battery_j is None or facts.energy_floor_j is None:
        missing = "the battery's charge" if facts.battery_j is None else "the battery's floor"
        raise UndecidedError(f"{missing} is not given")
    left = facts.battery_j - facts.day()["budget"]["energy_j"] - facts.energy_floor_j
    return left >= limit, left, f"left above the floor of {facts.energy_floor_j / 3600.0:.3g} Wh"


def _overrun(facts: Facts, limit: float) -> Verdict:
    if facts.overrun is None:
        return _flown_overrun(facts, limit, 1, "the plan was merged; a campaign flown here would tell")
    return facts.overrun <= limit, facts.overrun, "share of the futures that end over a budget"


def _arm(facts: Facts, limit: float) -> Verdict:
    farthest, where = 0.0, "the arm is not used"
    for target, observation in facts.observations():
        if observation.get("kind") != "place":
            continue
        pose = _stand(target)
        point = target.get("point_m")
        if point is None:
            raise UndecidedError(f"the problem has no point_m of {target['id']}")
        distance = math.hypot(point[0] - pose["east_m"], point[1] - pose["north_m"])
        if distance > farthest:
            farthest, where = distance, f"farthest is {_name(target)}"
    return _settled((farthest <= limit, farthest, where), (use for use in facts.open_uses if use.arm))


def _instrument(facts: Facts, limit: float) -> Verdict:
    used = {str(o["instrument"]) for _, o in facts.observations() if o.get("instrument")}
    foreign = sorted(used - facts.instruments)
    said = ", ".join(foreign) or "all are known"
    return _settled((len(foreign) <= limit, float(len(foreign)), said), facts.open_uses)


def _time_of_day(facts: Facts, limit: float) -> Verdict:
    if facts.start_lmst_h is None:
        raise UndecidedError("no time of day is given")
    end_h = facts.start_lmst_h + facts.day()["budget"]["time_s"] / MARS_HOUR_S
    return end_h <= limit, end_h, f"latest end; the plan begins at {_lmst(facts.start_lmst_h)}"


def _lmst(hours: float) -> str:
    """Return a local mean solar time as people write it: `09:30 LMST`."""
    minutes = round(hours * 60.0)
    return f"{minutes // 60:02d}:{minutes % 60:02d} LMST"


def _crl(facts: Facts, limit: float) -> Verdict:
    return len(facts.errors) <= limit, float(len(facts.errors)), "; ".join(facts.errors[:3]) or "none"


def _campaign(facts: Facts, limit: float) -> Verdict:
    missing = f"the plan was not flown in a campaign here; {facts.least_runs:,} runs are asked for"
    return _flown_overrun(facts, limit, facts.least_runs, missing)


def _flown_overrun(facts: Facts, limit: float, least_runs: int, missing: str) -> Verdict:
    """Check a limit against the share of runs over a budget; `missing` is said if no campaign was flown."""
    facts.day()  # in whose world the campaign was flown
    flown = facts.campaign
    over = None if flown is None else next((f for f in flown.frequencies if f.what == OVER), None)
    if flown is None or over is None:
        return False, None, missing
    share = 1.0 if over.interval.high is None else over.interval.high
    if flown.runs < least_runs:
        return False, share, f"its largest campaign has {flown.runs:,} runs; {least_runs:,} are asked for"
    told = (
        f"{over.runs:,} of {flown.runs:,} runs end over a budget; the value is the upper end of the interval"
    )
    return share <= limit, share, told


CHECKS: Mapping[str, Callable[[Facts, float], Verdict]] = {
    "tilt": _tilt,
    "energy_floor": _energy_floor,
    "overrun": _overrun,
    "arm": _arm,
    "instrument": _instrument,
    "time_of_day": _time_of_day,
    "crl": _crl,
    "campaign": _campaign,
}


@lru_cache(maxsize=1)
def flight_rules() -> tuple[Rule, ...]:
    """Return the rules of the file, each with a check of ours."""
    document = tomllib.loads((files("ground") / "flight_rules.toml").read_text(encoding="utf-8"))
    rules = tuple(Rule(**rule) for rule in document["rules"])
    for rule in rules:
        if rule.check not in CHECKS:
            raise ValueError(f"flight rule {rule.id}: there is no check {rule.check!r}")
    return rules
