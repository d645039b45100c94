"""One leg between two stops: rocks matched, checked by every fault rule, and a pose only if none fires.

The first four rules are Li et al. 2007, section II.D; the others came from asking when a match would be wrong
without any of those noticing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np
import numpy.typing as npt

from rover_iface.errors import LocalizationError
from rover_iface.frames import Transform
from rover_iface.localization.rock_matching import (
    LegPrior,
    MatchingOptions,
    RockMatch,
    match_rocks,
    overlapping,
)
from rover_iface.localization.seen_rock import SeenRock

Array = npt.NDArray[np.float64]


class LegFault(StrEnum):
    """Why a leg is refused."""

    LEG_TOO_LONG = "leg too long"
    TOO_FEW_ROCKS = "too few rocks in the overlap"
    TOO_FEW_SIGNIFICANT = "too few significant rocks"
    TOO_FEW_MATCHES = "too few matches"
    AMBIGUOUS = "another pose fits nearly as well"
    INCONSISTENT = "inconsistent geometry"
    WEAK_GEOMETRY = "geometry too weak"
    FAR_FROM_ODOMETRY = "far from odometry"


@dataclass(frozen=True, slots=True)
class FaultLimits:
    """Limits of the fault rules.

    Attributes
    ----------
    longest_m
        Longest leg (published for Navcam: 30 m).
    least_rocks, least_significant
        In the overlap, at each stop, of what is more probably a rock than not; significant rocks are
        `significant_height_m` high or more.
    least_matches
        Final pairs.
    largest_false_probability
        That the pose is wrong altogether.
    chi2_tail
        The pairs' squared normalised distances are inconsistent if as large a sum comes by chance less often.
    largest_sigma_m, largest_sigma_rad
        Of the pose, in shift (the worst direction) and heading.
    largest_prior_sigma
        Distance of the pose from odometry, in deviations of the prior.
    """

    longest_m: float = 30.0
    least_rocks: int = 6
    least_significant: int = 4
    significant_height_m: float = 0.15
    least_matches: int = 4
    largest_false_probability: float = 0.05
    chi2_tail: float = 1e-4
    largest_sigma_m: float = 0.5
    largest_sigma_rad: float = math.radians(1.5)
    largest_prior_sigma: float = 4.0

    def __post_init__(self) -> None:
        if self.least_matches < 3:
            raise LocalizationError(f"a leg needs at least 3 pairs, found a limit of {self.least_matches}")
        if not 0 < self.largest_false_probability < 1:
            raise LocalizationError(
                f"largest false-match probability is {self.largest_false_probability}; it must lie in (0, 1)"
            )


@dataclass(frozen=True, slots=True)
class Refusal:
    """One rule that fired: which, and the value against its limit."""

    fault: LegFault
    message: str


@dataclass(frozen=True, eq=False, slots=True)
class LegResult:
    """What came of a leg.

    Attributes
    ----------
    match
        What the matching found; nothing if a rule fired before it.
    refusals
        Rules that fired, in the order of `LegFault`; none if the leg is accepted.
    """

    match: RockMatch | None
    refusals: tuple[Refusal, ...] = field(default=())

    @property
    def accepted(self) -> bool:
        """Return whether no rule fired."""
        return not self.refusals and self.match is not None

    @property
    def first_from_second(self) -> Transform:
        """Return the pose of the second stop's frame in the first's.

        Raises
        ------
        LocalizationError
            If the leg was refused: there is no pose that may be used.
        """
        if self.match is None or self.refusals:
            raise LocalizationError(f"the leg was refused: {'; '.join(r.message for r in self.refusals)}")
        m = self.match
        return Transform.from_rpy(0.0, 0.0, m.heading_rad, (m.x_m, m.y_m, m.z_m))

    @property
    def verdict(self) -> str:
        """Return one line for the operator."""
        if self.match is not None and not self.refusals:
            return (
                f"accepted: {len(self.match.pairs)} pairs, false with probability "
                f"{self.match.false_probability:.1e}"
            )
        return "refused: " + "; ".join(r.message for r in self.refusals)


def localise_leg(
    first: Sequence[SeenRock],
    second: Sequence[SeenRock],
    prior: LegPrior,
    *,
    limits: FaultLimits | None = None,
    options: MatchingOptions | None = None,
) -> LegResult:
    """Return the verdict on a leg and what the match found; frames as in `match_rocks`."""
    limits, options = limits or FaultLimits(), options or MatchingOptions()
    refusals = list(_before(first, second, prior, limits, options))
    if refusals:
        return LegResult(None, tuple(refusals))
    match = match_rocks(first, second, prior, options)
    return LegResult(match, tuple(check_match(match, prior, limits)))


def _before(
    first: Sequence[SeenRock],
    second: Sequence[SeenRock],
    prior: LegPrior,
    limits: FaultLimits,
    options: MatchingOptions,
) -> list[Refusal]:
    found = []
    if prior.length_m > limits.longest_m:
        found.append(
            Refusal(
                LegFault.LEG_TOO_LONG, f"leg is {prior.length_m:.1f} m long, limit {limits.longest_m:g} m"
            )
        )
    c, s = math.cos(prior.heading_rad), math.sin(prior.heading_rad)
    back = np.array([-c * prior.x_m - s * prior.y_m, s * prior.x_m - c * prior.y_m, 0.0])
    there = np.array([prior.x_m, prior.y_m, 0.0])
    for name, rocks, other in (("first", first, there), ("second", second, back)):
        near = (rocks[k] for k in overlapping(rocks, other, options.farthest_m))
        inside = [rock for rock in near if rock.probability > 0.5]
        if len(inside) < limits.least_rocks:
            found.append(
                Refusal(
                    LegFault.TOO_FEW_ROCKS,
                    f"{len(inside)} rocks of the {name} stop in the overlap, limit {limits.least_rocks}",
                )
            )
            continue
        large = sum(rock.height_m >= limits.significant_height_m for rock in inside)
        if large < limits.least_significant:
            found.append(
                Refusal(
                    LegFault.TOO_FEW_SIGNIFICANT,
                    f"{large} significant rocks of the {name} stop in the overlap, "
                    f"limit {limits.least_significant}",
                )
            )
    return found


def check_match(match: RockMatch, prior: LegPrior, limits: FaultLimits) -> list[Refusal]:
    """Return the rules about the result that fire."""
    from scipy.stats import chi2

    found: list[Refusal] = []
    count = len(match.pairs)
    if count < limits.least_matches:
        found.append(
            Refusal(LegFault.TOO_FEW_MATCHES, f"{count} pairs of rocks, limit {limits.least_matches}")
        )
    if match.false_probability > limits.largest_false_probability:
        found.append(
            Refusal(
                LegFault.AMBIGUOUS,
                f"false-match probability {match.false_probability:.2g}, "
                f"limit {limits.largest_false_probability:g}",
            )
        )
    if count < limits.least_matches:
        return found
    total = count * match.chi2_per_pair
    limit = float(chi2.isf(limits.chi2_tail, 3 * count - 4))
    if total > limit:
        found.append(
            Refusal(
                LegFault.INCONSISTENT, f"squared distances of the pairs sum to {total:.1f}, limit {limit:.1f}"
            )
        )
    shift = math.sqrt(float(np.linalg.eigvalsh(match.covariance[:2, :2])[-1]))
    turn = math.sqrt(float(match.covariance[3, 3]))
    if shift > limits.largest_sigma_m or turn > limits.largest_sigma_rad:
        found.append(
            Refusal(
                LegFault.WEAK_GEOMETRY,
                f"pose is known to {shift:.2f} m and {math.degrees(turn):.1f} degrees, limits "
                f"{limits.largest_sigma_m:g} m and {math.degrees(limits.largest_sigma_rad):.1f} degrees",
            )
        )
    away = math.hypot(match.x_m - prior.x_m, match.y_m - prior.y_m) / prior.sigma_m
    turned = abs(math.remainder(match.heading_rad - prior.heading_rad, math.tau)) / prior.sigma_heading_rad
    if max(away, turned) > limits.largest_prior_sigma:
        found.append(
            Refusal(
                LegFault.FAR_FROM_ODOMETRY,
                f"pose is {away:.1f} and heading {turned:.1f} deviations from odometry, "
                f"limit {limits.largest_prior_sigma:g}",
            )
        )
    return found
