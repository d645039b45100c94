"""What a campaign says, the format `campaign/1`."""

from __future__ import annotations

from collections.abc import Mapping

from ground.errors import InvalidInputError
from mission.codec import Codec
from mission.values import value


@value
class Interval:
    """Ends of an interval of 95 %; None is unbounded."""

    low: float | None
    high: float | None


@value
class Utility:
    """Of the runs: mean, standard deviation, standard error of the mean, quantiles by their share.

    `predicted` is what the planner expected; `deviation` how many standard errors the mean is above it.
    """

    mean: float
    sd: float
    standard_error: float
    interval: Interval
    quantiles: Mapping[str, float]
    quantile_intervals: Mapping[str, Interval]
    predicted: float | None = None
    deviation: float | None = None


@value
class Frequency:
    """How often something happened: the share of the runs, its interval, and what was predicted."""

    what: str
    runs: int
    share: float
    interval: Interval
    predicted: float | None = None


@value
class FailureMode:
    """Runs in which a task failed for one reason.

    Parameters
    ----------
    task
        The node that failed; `plan` for a budget that was exceeded at the end.
    condition
        What failed, in words of the plan.
    resource
        `time`, `energy`, `track of TARGET`, or empty.
    mean_utility
        Of these runs; `utility_without` of all others (None if there are none).
    examples
        Seeds, the worst first.
    """

    task: str
    condition: str
    resource: str
    runs: int
    share: float
    interval: Interval
    mean_utility: float
    utility_without: float | None
    examples: tuple[int, ...]


@value
class BadRun:
    """A run of low utility, and why."""

    seed: int
    utility: float
    why: str


@value
class Difference:
    """A case minus the plan as it is, over the same seeds: mean of the differences with its interval.

    `better` and `worse` count the runs in which it earns more and less; `variance_ratio` is the variance that
    independent seeds would have, over that of the pairs.
    """

    name: str
    runs: int
    mean: float
    standard_error: float
    interval: Interval
    better: int
    worse: int
    variance_ratio: float | None = None


@value
class Bin:
    """Runs whose utility is at least `low` and less than `high` (of the last bin: at most)."""

    low: float
    high: float
    runs: int


@value
class CampaignResult:
    """What a campaign says.

    Parameters
    ----------
    campaign, futures
        Digest of what decides the rows; digest of what decides the futures of a seed, so that campaigns with
        the same one are compared in pairs.
    rover, seed, runs
        Seeds `seed` to `seed + runs - 1`.
    digest
        SHA-256 of `runs.csv`.
    outcomes, options
        Number of runs by outcome of the plan, and by option taken.
    frequencies
        Outcomes, options and `over budget`, with intervals and predictions.
    nodes
        By node of the plan: shares that SUCCEEDED, FAILED, were ABORTED, were SKIPPED.
    helps
        What one more unit of a budget, or a better tracker, would bring with this plan.
    """

    campaign: str
    futures: str
    rover: str
    seed: int
    runs: int
    digest: str
    utility: Utility
    outcomes: Mapping[str, int]
    options: Mapping[str, int]
    frequencies: tuple[Frequency, ...]
    nodes: Mapping[str, tuple[float, float, float, float]]
    end_s: Mapping[str, float]
    energy_used_j: Mapping[str, float]
    histogram: tuple[Bin, ...]
    convergence: tuple[tuple[int, float, float], ...]
    worst: tuple[BadRun, ...]
    failures: tuple[FailureMode, ...]
    variants: tuple[Difference, ...] = ()
    helps: tuple[Difference, ...] = ()
    stopped: str = ""


RESULTS = Codec(CampaignResult, "campaign/1", "campaign", error=InvalidInputError)
