"""A traverse of stops with panoramas: rocks of each, every leg judged, all adjusted together.

Stops are believed poses to begin with (wheel odometry). Rocks of each accepted leg tie its two stops; a
refused leg is held by odometry alone. Each stop stands level in the axes of the site, its origin at the eye.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_iface.errors import LocalizationError
from rover_iface.frames import Transform
from rover_iface.localization.bundle_adjustment import Adjustment, BundleAdjustment
from rover_iface.localization.ground_points import GroundPoints
from rover_iface.localization.leg import FaultLimits, LegResult, localise_leg
from rover_iface.localization.rock_extraction import extract_rocks
from rover_iface.localization.rock_matching import BIAS_PX, LegPrior, MatchingOptions, RockPair
from rover_iface.localization.seen_rock import SeenRock

Array = npt.NDArray[np.float64]
FORMAT = "localization/1"


@dataclass(frozen=True, slots=True)
class TraverseOptions:
    """What is believed of the odometry between stops.

    Attributes
    ----------
    share
        Deviation of the shift of a leg, as a share of its length.
    sigma_z_share
        The same for height.
    heading_sigma_rad
        Of the turn between two stops.
    sun_sigma_rad, tilt_sigma_rad
        Of each stop's own heading and of roll and pitch; None when headings are odometry's.
    """

    share: float = 0.05
    sigma_z_share: float = 0.02
    heading_sigma_rad: float = math.radians(3.0)
    sun_sigma_rad: float | None = None
    tilt_sigma_rad: float = math.radians(0.3)

    def __post_init__(self) -> None:
        if not (0 < self.share < 1 and self.heading_sigma_rad > 0 and self.sigma_z_share > 0):
            raise LocalizationError(
                f"odometry with deviations of {self.share} of the way and {self.heading_sigma_rad} rad; "
                "a share between 0 and 1 and a positive angle are needed"
            )


@dataclass(frozen=True, eq=False, slots=True)
class LocalisedLeg:
    """A leg of a traverse: the stops' names and the verdict."""

    first: str
    second: str
    prior: LegPrior
    result: LegResult


@dataclass(frozen=True, eq=False, slots=True)
class Traverse:
    """Stops before and after, site axes.

    Attributes
    ----------
    before, before_covariance
        [n, 3] and [n, 3, 3]: where the stops were believed to be, and how far off by odometry alone.
    adjustment
        Poses by the names of the stops.
    rocks
        Those of each stop, in its own frame.
    """

    names: tuple[str, ...]
    before: Array
    before_covariance: Array
    adjustment: Adjustment
    legs: tuple[LocalisedLeg, ...]
    rocks: tuple[tuple[SeenRock, ...], ...]

    def document(self, pictures: Sequence[Mapping[str, object]] = ()) -> dict[str, object]:
        """Return the result as JSON (`localization/1`), with a picture of each stop where there are any.

        Positions are east, north, up, metres.
        """
        stops = []
        for k, name in enumerate(self.names):
            pose = self.adjustment.poses[name]
            stops.append(
                {
                    "name": name,
                    "believed_m": [round(float(v), 4) for v in self.before[k]],
                    "believed_covariance_m2": np.round(self.before_covariance[k], 6).tolist(),
                    "adjusted_m": [round(float(v), 4) for v in pose.site_from_rover.translation],
                    "adjusted_covariance_m2": np.round(pose.position_covariance, 6).tolist(),
                    "heading_correction_rad": round(_heading(pose.site_from_rover), 6),
                    "rocks": len(self.rocks[k]),
                    **({"picture": pictures[k]} if pictures else {}),
                }
            )
        return {"format": FORMAT, "stops": stops, "legs": [self._leg_document(leg) for leg in self.legs]}

    def _leg_document(self, leg: LocalisedLeg) -> dict[str, object]:
        match = leg.result.match
        pairs = () if match is None else match.pairs
        one, two = self.rocks[self.names.index(leg.first)], self.rocks[self.names.index(leg.second)]
        start, end = (self.before[self.names.index(name)] for name in (leg.first, leg.second))

        def pair_document(pair: RockPair) -> dict[str, object]:
            first, second = one[pair.first], two[pair.second]
            return {
                "first_m": [round(float(v), 3) for v in start + first.position],
                "second_m": [round(float(v), 3) for v in end + second.position],
                "height_m": round(first.height_m, 3),
                "probability": round(pair.probability, 4),
            }

        return {
            "first": leg.first,
            "second": leg.second,
            "length_m": round(leg.prior.length_m, 2),
            "accepted": leg.result.accepted,
            "verdict": leg.result.verdict,
            "faults": [refusal.fault.value for refusal in leg.result.refusals],
            "false_probability": None if match is None else match.false_probability,
            "pairs": [pair_document(p) for p in pairs],
            "rejected": [pair_document(p) for p in (() if match is None else match.rejected)],
        }


def _heading(pose: Transform) -> float:
    return math.atan2(float(pose.rotation[1, 0]), float(pose.rotation[0, 0]))


def leg_prior(shift: Array, options: TraverseOptions) -> LegPrior:
    """Return the prior of a leg whose believed shift is [3], m, in the frame of its first stop."""
    length = max(float(np.hypot(*shift[:2])), 1.0)
    return LegPrior(
        float(shift[0]),
        float(shift[1]),
        float(shift[2]),
        0.0,
        sigma_m=max(options.share * length, 0.1),
        sigma_z_m=max(options.sigma_z_share * length, 0.1),
        sigma_heading_rad=options.heading_sigma_rad,
    )


def localise_traverse(
    stops: Sequence[tuple[str, GroundPoints]],
    options: TraverseOptions | None = None,
    *,
    limits: FaultLimits | None = None,
    matching: MatchingOptions | None = None,
    report: Callable[[str], None] | None = None,
) -> Traverse:
    """Return a traverse of named stops in the order driven, each with the points seen from it.

    Raises
    ------
    LocalizationError
        If there are fewer than two stops, or two have one name.
    """
    options = options or TraverseOptions()
    names = tuple(name for name, _ in stops)
    if len(names) < 2:
        raise LocalizationError(f"a traverse has at least 2 stops, found {len(names)}")
    if len(set(names)) < len(names):
        raise LocalizationError(f"two stops have one name: {', '.join(names)}")
    say = report or (lambda line: None)
    rocks = []
    for name, seen in stops:
        rocks.append(tuple(extract_rocks(seen.from_eye())))
        say(f"{name}: {len(rocks[-1])} rocks")
    eyes = np.array([seen.eye for _, seen in stops])
    legs = []
    for k in range(1, len(names)):
        prior = leg_prior(eyes[k] - eyes[k - 1], options)
        result = localise_leg(rocks[k - 1], rocks[k], prior, limits=limits, options=matching)
        legs.append(LocalisedLeg(names[k - 1], names[k], prior, result))
        say(f"{names[k - 1]} to {names[k]}: {result.verdict}")
    return _adjusted(names, eyes, tuple(rocks), tuple(legs), options)


def _adjusted(
    names: tuple[str, ...],
    eyes: Array,
    rocks: tuple[tuple[SeenRock, ...], ...],
    legs: tuple[LocalisedLeg, ...],
    options: TraverseOptions,
) -> Traverse:
    adjustment, alone = BundleAdjustment(), BundleAdjustment()
    tilt, held = options.tilt_sigma_rad, 1e-4
    for which in (adjustment, alone):
        spread = np.diag([tilt, tilt, held, held, held, held]) ** 2
        which.add_pose(names[0], Transform(np.eye(3), eyes[0]), covariance=spread)
    for k, leg in enumerate(legs, 1):
        shift = eyes[k] - eyes[k - 1]
        p = leg.prior
        sigma = [tilt, tilt, p.sigma_heading_rad, p.sigma_m, p.sigma_m, p.sigma_z_m]
        for which in (adjustment, alone):
            which.add_pose(leg.second, Transform(np.eye(3), eyes[k]))
            which.add_motion(leg.first, leg.second, Transform(np.eye(3), shift), np.diag(sigma) ** 2)
            turn = options.sun_sigma_rad if options.sun_sigma_rad is not None else math.pi
            which.add_attitude(leg.second, Transform.identity(), (tilt, tilt, turn))
        match = leg.result.match
        if match is None or not leg.result.accepted:
            continue
        for number, pair in enumerate(match.pairs):
            one, two = rocks[k - 1][pair.first], rocks[k][pair.second]
            adjustment.add_point((k, number), eyes[k - 1] + one.position)
            for stop, rock in ((leg.first, one), (leg.second, two)):
                adjustment.add_rock(
                    stop, (k, number), rock.position, covariance_among(rock, len(match.pairs))
                )
    solved, blind = adjustment.solve(), alone.solve()
    return Traverse(
        names,
        eyes,
        np.array([blind.poses[name].position_covariance for name in names]),
        solved,
        legs,
        rocks,
    )


def covariance_among(
    rock: SeenRock, count: int, *, bias_px: float = BIAS_PX, range_factor: float = 235.4
) -> Array:
    """Return the covariance of a rock for use with others of its stop, whose ranges share a bias.

    A bias common to n rocks does not average out; n times its variance on each leaves it in their mean.
    """
    sight = rock.position / np.linalg.norm(rock.position)
    bias = bias_px * rock.range_m**2 / range_factor
    return np.asarray(rock.covariance + count * bias**2 * np.outer(sight, sight))
