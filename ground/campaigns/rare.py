"""Rare failures: importance sampling over the draws that a run looks at.

Each draw of the abstract world (time and energy of a drive or an observation, loss of a track, success of an
observation, kind of sol) can be tilted: a normal number is shifted by `shift`, a yes-no draw gets another
chance. A run is weighted by the likelihood ratio of the draws that it has looked at; which ones it looks at
depends on earlier ones only, so the weighted mean is unbiased. Tilts are found by the cross-entropy method
(Rubinstein and Kroese 2004, chapter 3) on pilot runs that are not used in the estimate. Final runs come from
a defensive mixture of the tilted and the true odds (Hesterberg 1995): no weight exceeds 1 / `true_share`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ground.campaigns.case import Case
from ground.campaigns.events import RareEvent
from ground.campaigns.intervals import CONFIDENCE, Z
from ground.campaigns.pilot import Pilot, pilot_of
from ground.campaigns.row import Row
from ground.errors import InvalidInputError
from mission.codec import Codec
from mission.values import value

if TYPE_CHECKING:
    from rover_iface.simulator.model import AbstractModel, Noise

Draw = tuple[str, tuple[int, ...]]
"""A draw by its array in `Future` and its index there."""

NORMAL = ("leg_time_s", "leg_energy_j", "obs_time_s", "obs_energy_j")
LOW_IS_BAD = ("leg_loss_u", "leg_fail_u", "sol_u")
"""Coins of which a number below the chance is the bad side."""


@dataclass(frozen=True, slots=True)
class RareOptions:
    """How tilts are looked for.

    Parameters
    ----------
    pilot_runs, pilots
        Runs of one pilot, and the most pilots. A fifth of 20,000 runs in all.
    elite
        Share of a pilot whose scores the next tilt is fitted to, until the event itself is so frequent.
    smooth
        Share of the new tilt that is taken in each step.
    most_shift
        Bound on shifts, standard deviations; beyond it weights of single runs decide the estimate.
    chance
        Bounds of tilted chances.
    true_share
        Share of final runs with the true odds.
    """

    pilot_runs: int = 800
    pilots: int = 5
    elite: float = 0.1
    smooth: float = 0.8
    most_shift: float = 4.0
    chance: tuple[float, float] = (0.001, 0.95)
    true_share: float = 0.1


@value
class RareResult:
    """How likely a rare event is.

    Parameters
    ----------
    probability, standard_error, low, high
        Estimate and its interval of 95 %; where it never happened, `high` is what the runs with the true odds
        leave open.
    runs, pilot_runs
        Runs of the estimate; runs spent on looking for tilts.
    hits
        Runs of the estimate in which it happened.
    effective_runs
        Runs of plain sampling that would give the same standard error.
    tilts
        Draws that were tilted most, in words.
    """

    event: str
    probability: float
    standard_error: float
    low: float
    high: float
    runs: int
    pilot_runs: int
    hits: int
    effective_runs: float
    seed: int
    tilts: tuple[str, ...]


RARE = Codec(RareResult, "campaign-rare/1", "rare failure", error=InvalidInputError)


@dataclass
class Tilt:
    """Shift of normal numbers and chances of coins; a draw that is not named keeps its true odds."""

    shift: dict[Draw, float] = field(default_factory=dict)
    chance: dict[Draw, float] = field(default_factory=dict)


class Seen:
    """An array of a future that notes which of its elements are looked at."""

    def __init__(self, name: str, array: Any, seen: dict[Draw, None], prefix: tuple[int, ...] = ()) -> None:
        self._name, self._array, self._seen, self._prefix = name, array, seen, prefix

    def __getitem__(self, index: int | tuple[int, ...]) -> Any:
        place = (*self._prefix, *(index if isinstance(index, tuple) else (index,)))
        found = self._array[index]
        if isinstance(found, np.ndarray) and found.ndim:
            return Seen(self._name, found, self._seen, place)
        self._seen[self._name, place] = None
        return found


@dataclass(frozen=True, slots=True)
class Sample:
    """A run under a tilt: its row, and the normal number or the coin's side of each draw it looked at."""

    row: Row
    normals: dict[Draw, float]
    coins: dict[Draw, bool]


class RareSampler:
    """Flies a case under tilted odds.

    Raises
    ------
    InvalidInputError
        If the rover is not the abstract one: other rovers' chance cannot be tilted.
    """

    def __init__(self, case: Case, event: RareEvent, options: RareOptions | None = None) -> None:
        from rover_iface.simulator.model import AbstractModel

        if case.rover != "abstract":
            raise InvalidInputError(f"the rover {case.rover} draws for itself; only abstract can be tilted")
        self.event, self.options = event, options or RareOptions()
        self._pilot: Pilot = pilot_of(case)
        self._model: AbstractModel = AbstractModel.from_problem(case.problem)

    def chance(self, draw: Draw) -> float:
        """Return the true chance of a coin: of a loss, of a drive that fails, of a kind of sol where it is
        none before, or of a spoilt observation.
        """
        name, place = draw
        if name == "leg_loss_u":
            return float(self._model.p_lose[place])
        if name == "leg_fail_u":
            return float(self._model.p_fail[place])
        if name == "sol_u":
            return self._model.sols.chance(place[0])
        return 1.0 - self._model.observations[place[0]].p_success

    def fly(self, seed: int, tilt: Tilt) -> Sample:
        """Return the run of a seed with its noise tilted."""
        from rover_iface.simulator.model import Future, Noise

        noise = self._tilted(Noise.draw(self._model, seed), tilt)
        future = noise.future(self._model)
        sols = self._model.sols
        kind = sols.kind(noise.sol_u)
        asked = len(sols.p) if kind is None else kind + 1  # kinds are drawn one after the other
        seen: dict[Draw, None] = {("sol_u", (k,)): None for k in range(asked)}
        names = Future.__dataclass_fields__.keys() - {"energy_factor"}
        arrays: dict[str, Any] = {name: Seen(name, getattr(future, name), seen) for name in names}
        watched = replace(future, **arrays)
        row = self._pilot.row(seed, watched)
        normals: dict[Draw, float] = {}
        coins: dict[Draw, bool] = {}
        for draw in seen:
            name, place = draw
            if name in NORMAL:
                normals[draw] = float(getattr(noise, name.rsplit("_", 1)[0] + "_z")[place])
            elif name in LOW_IS_BAD:
                coins[draw] = bool(getattr(noise, name)[place] < self.chance(draw))
            else:
                coins[draw] = bool(noise.obs_success_u[place] >= 1.0 - self.chance(draw))
        return Sample(row, normals, coins)

    def _tilted(self, noise: Noise, tilt: Tilt) -> Noise:
        for (name, place), shift in tilt.shift.items():
            getattr(noise, name.rsplit("_", 1)[0] + "_z")[place] += shift
        for draw, chance in tilt.chance.items():
            name, place = draw
            array = getattr(noise, name)
            bad = array[place] if name in LOW_IS_BAD else 1.0 - array[place]
            bad = _bent(bad, self.chance(draw), chance)
            array[place] = bad if name in LOW_IS_BAD else 1.0 - bad
        return noise

    def log_ratio(self, sample: Sample, tilt: Tilt) -> float:
        """Return log of the tilted over the true likelihood of what a run looked at."""
        total = 0.0
        for draw, z in sample.normals.items():
            shift = tilt.shift.get(draw)
            if shift:
                total += shift * z - shift * shift / 2
        for draw, bad in sample.coins.items():
            tilted = tilt.chance.get(draw)
            if tilted is not None:
                true = self.chance(draw)
                total += math.log(tilted / true) if bad else math.log((1 - tilted) / (1 - true))
        return total

    # ---- looking for a tilt

    def first_tilt(self, seed: int) -> tuple[Tilt, int]:
        """Return a tilt under which what may go wrong is frequent, and the runs spent."""
        tilt = Tilt()
        for k in range(PROBES):
            for draw in self.fly(seed + k, tilt).coins:
                true = self.chance(draw)
                if 0.0 < true < 1.0:
                    tilt.chance[draw] = min(self.options.chance[1], max(true, math.sqrt(true)))
        return tilt, PROBES

    def search(self, seed: int) -> tuple[Tilt, int]:
        """Return a tilt under which the event is frequent, and how many runs were spent."""
        options = self.options
        tilt, spent = self.first_tilt(seed)
        for _ in range(options.pilots):
            samples = [self.fly(seed + spent + k, tilt) for k in range(options.pilot_runs)]
            spent += options.pilot_runs
            scores = np.array([self.event.score(s.row) for s in samples])
            full = float(len(self.event.terms))
            level = min(full, float(np.quantile(scores, 1.0 - options.elite)))
            elite = [s for s, score in zip(samples, scores, strict=True) if score >= level]
            tilt = self._fitted(elite, tilt)
            if level >= full and len(elite) >= 2 * options.elite * options.pilot_runs:
                break
        return tilt, spent

    def _fitted(self, elite: Sequence[Sample], old: Tilt) -> Tilt:
        """Return the tilt that fits the elite best, each weighted as under the true odds."""
        options = self.options
        logs = np.array([-self.log_ratio(s, old) for s in elite])
        weights = np.exp(logs - logs.max())
        sums: dict[Draw, list[float]] = {}
        for sample, weight in zip(elite, weights, strict=True):
            for draw, figure in (*sample.normals.items(), *sample.coins.items()):
                held = sums.setdefault(draw, [0.0, 0.0, 0.0])
                held[0] += weight
                held[1] += weight * float(figure)
                held[2] += 1.0
        tilt = Tilt()
        least = max(5.0, 0.05 * len(elite))
        for draw, (whole, part, count) in sums.items():
            if count < least:
                continue  # too few runs came there to learn from
            mean, share = part / whole, options.smooth
            if draw[0] in NORMAL:
                fitted = share * mean + (1 - share) * old.shift.get(draw, 0.0)
                if abs(fitted) > SMALL_SHIFT:
                    tilt.shift[draw] = max(-options.most_shift, min(options.most_shift, fitted))
                continue
            true = self.chance(draw)
            if 0.0 < true < 1.0:
                low, high = options.chance
                fitted = share * mean + (1 - share) * old.chance.get(draw, true)
                tilt.chance[draw] = max(min(low, true), min(high, fitted))
        return tilt

    # ---- estimate

    def estimate(self, runs: int, seed: int) -> RareResult:
        """Return the probability of the event from `runs` runs in all, pilots included.

        Raises
        ------
        InvalidInputError
            If there are too few runs for the pilots and an estimate.
        """
        options = self.options
        most = PROBES + options.pilots * options.pilot_runs
        if runs < 2 * most:
            raise InvalidInputError(
                f"--runs is {runs}; pilots take up to {most}, and at least {2 * most} are needed"
            )
        tilt, spent = self.search(seed)
        left = runs - spent
        true_runs = round(options.true_share * left)
        share = true_runs / left
        weights = np.zeros(left)
        hits = 0
        plain = Tilt()
        for k in range(left):
            sample = self.fly(seed + spent + k, plain if k < true_runs else tilt)
            if self.event.holds(sample.row):
                hits += 1
                weights[k] = 1.0 / (
                    share + (1.0 - share) * math.exp(min(self.log_ratio(sample, tilt), 700.0))
                )
        # The two strata are sampled in fixed numbers: the variance is the sum of theirs.
        parts = (weights[:true_runs], weights[true_runs:])
        mean = float(weights.mean())
        variance = sum(len(p) * float(p.var(ddof=1)) for p in parts if len(p) > 1) / left**2
        error = math.sqrt(variance)
        return RareResult(
            self.event.text,
            mean,
            error,
            max(0.0, mean - Z * error),
            min(1.0, mean + Z * error) if hits else unseen_at_most(true_runs),
            left,
            spent,
            hits,
            mean * (1.0 - mean) / variance if variance > 0 else 0.0,
            seed,
            tuple(self._told(tilt)),
        )

    def _told(self, tilt: Tilt) -> list[str]:
        """Return the strongest tilts in words."""
        found = [
            (abs(s), f"{self._words(d)} shifted by {s:+.2f} standard deviations")
            for d, s in tilt.shift.items()
        ]
        for draw, chance in tilt.chance.items():
            true = self.chance(draw)
            found.append(
                (abs(math.log(chance / true)), f"{self._words(draw)} {chance:.3f} instead of {true:.3g}")
            )
        found.sort(reverse=True)
        return [text for _, text in found[:8]]

    def _words(self, draw: Draw) -> str:
        name, place = draw
        if name == "sol_u":
            return f"chance of a {self._model.sols.name[place[0]]} sol"
        words = {
            "leg_time_s": "time of drive",
            "leg_energy_j": "energy of drive",
            "leg_loss_u": "chance of a loss on drive",
            "leg_fail_u": "chance to fail of drive",
            "obs_time_s": "time of observation",
            "obs_energy_j": "energy of observation",
            "obs_success_u": "chance of failure of observation",
        }
        return f"{words[name]} {'-'.join(map(str, place))}"


PROBES = 50
"""Runs that find which coins there are; each makes the failures that it saw more frequent for the next."""
SMALL_SHIFT = 0.05
"""Shifts below this are noise of the fit and only spread the weights."""


def unseen_at_most(runs: int) -> float:
    """Return the upper end of the interval for what did not happen in so many runs with the true odds.

    Exact (Clopper and Pearson 1934). Tilted runs prove nothing here: the tilt may lead away from the event.
    """
    return 1.0 - math.pow((1.0 - CONFIDENCE) / 2, 1.0 / runs)


def _bent(u: float, true: float, tilted: float) -> float:
    """Return a uniform number whose chance to be below `true` is `tilted`, uniform on both sides of it."""
    if u < tilted:
        return u / tilted * true
    return true + (u - tilted) / (1.0 - tilted) * (1.0 - true)


def summary_line(result: RareResult) -> str:
    """Return what a terminal is told."""
    return (
        f"P({result.event}) = {result.probability:.3g} ({result.low:.3g} to {result.high:.3g}), "
        f"relative standard error {result.standard_error / result.probability:.1%}, {result.hits:,} hits in "
        f"{result.runs:,} runs; plain sampling would need {result.effective_runs:,.0f}"
        if result.probability > 0
        else f"P({result.event}): not seen in {result.runs:,} runs; at most {result.high:.3g}"
    )
