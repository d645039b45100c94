"""The numbers behind durations, energies and lost tracks: where they are from, and how to fit them.

A leg of length L (m), total turn R (rad), mean uphill slope tangent U and rise C (m) has

    duration  mean = fixed_s + drive_factor * (L / speed) * (1 + slope_gain * U)
                     + turn_factor * (R / turn_rate)
              sd   = duration_cv * mean
    energy    mean = fixed_j + energy_factor * drive_power * mean duration + mass * gravity * C / efficiency
              sd   = energy_cv * mean
    loss      p    = 1 - exp(-(inside_per_m * x_in + outside_per_m * x_out + occluded_per_m * x_occ
                               + arrival_rate * own)), own = 1 for the target that the leg leads to, else 0
    failure   p    = 1 - exp(-fail_per_m * L)

    day       all durations of a day x exp(N(0, day_time_sd)), all drive energies x exp(N(0, day_energy_sd)),
              each over its mean (one cause: both are long or both short)

with x_in, x_out and x_occ the metres driven inside a target's tracking region, outside it, and with the
target hidden by ground. Metres outside count `1 + angle_gain_per_rad * excess` times, excess being the
angle beyond the cone. Duration and energy increments are independent given the leg and the day: energy used
is the hotel load times elapsed time plus the sum of drive energies. The `cv` are those within a day where the
day's factors were fitted, and of all drives else.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, fields
from typing import Annotated

import numpy as np
import numpy.typing as npt
from annotated_types import Ge, MinLen

from mission.values import NotNegative, value
from planner.errors import ProblemError
from planner.path_network.activity_fit import ActivityFit
from planner.path_network.day_factor import NO_FACTOR, DayFactor, day_factors
from planner.path_network.rate_fit import fit_failures, fit_loss

Text = Annotated[str, MinLen(1)]
Count = Annotated[int, Ge(0)]


@value
class Calibration:
    """Parameters of the leg model above, and their source (`calibration/4`; without correlations of successes
    `calibration/3`, without times of tracks and activities `calibration/2`, without failures and factors of
    days `calibration/1`).

    `legs`, `tracks` (watched on a leg), `losses` and `failures` (drives that ended short of their goal) say
    on how much evidence the numbers rest; all 0 for numbers taken from literature. The `_se_per_m` are
    standard errors of the fitted rates; 0 for a rate that was not fitted. `day_time_sd` and `day_energy_sd`
    are 0 unless days differ for sure, `_se` their standard errors, `days` how many they rest on.
    `track_s` is what a drive takes longer for each target that is tracked on it; None leaves the rover's
    figure. `fixed_j` is fitted with it: looks at targets use energy too, and the planner's problem has no
    place for it but the drive. `arrival_rate` is of tracks lost by coming near: the target fills the view,
    and shows sides that were not seen before. `activities` holds what was learned of the others, by
    instrument; the rest are as the rover's profile has them.
    """

    name: Text
    source: Text
    fixed_s: NotNegative
    drive_factor: NotNegative
    turn_factor: NotNegative
    slope_gain: NotNegative
    duration_cv: NotNegative
    energy_factor: NotNegative
    energy_cv: NotNegative
    inside_per_m: NotNegative
    outside_per_m: NotNegative
    occluded_per_m: NotNegative
    angle_gain_per_rad: NotNegative
    legs: Count = 0
    tracks: Count = 0
    losses: Count = 0
    inside_se_per_m: NotNegative = 0.0
    outside_se_per_m: NotNegative = 0.0
    occluded_se_per_m: NotNegative = 0.0
    fail_per_m: NotNegative = 0.0
    fail_se_per_m: NotNegative = 0.0
    failures: Count = 0
    day_time_sd: NotNegative = 0.0
    day_time_se: NotNegative = 0.0
    day_energy_sd: NotNegative = 0.0
    day_energy_se: NotNegative = 0.0
    days: Count = 0
    track_s: NotNegative | None = None
    fixed_j: NotNegative = 0.0
    arrival_rate: NotNegative = 0.0
    arrival_se: NotNegative = 0.0
    activities: tuple[ActivityFit, ...] = ()

    def activity(self, name: str) -> ActivityFit | None:
        """Return what was learned of a kind of activity, None where nothing was."""
        return next((one for one in self.activities if one.name == name), None)

    def __post_init__(self) -> None:
        for name in ("name", "source"):
            if not getattr(self, name):
                raise ProblemError(f"calibration {name} is ''; it must be a text")
        for f in fields(self):
            found = getattr(self, f.name)
            if isinstance(found, int | float) and not 0.0 <= found < math.inf:
                raise ProblemError(
                    f"calibration {self.name}: {f.name} is {found!r}; it must be a finite number >= 0"
                )


K9_CALIBRATION = Calibration(
    name="k9-2004",
    source=(
        "Pedersen et al. 2005 (IEEEAC 1243): navigate 1457 s sd 1280 s, -174345 J sd 49250 J over a hotel "
        "load of 38 W, four approaches in 28 m, so 7 m a leg; of the 1457 s 300 s are taken as fixed "
        "(assumed), which leaves 165 s/m = 9.9 times the driving time at 6 cm/s (Kim et al. 2009 drove 8 m "
        "in 19 min with visual tracking on Mars: 142 s/m). Energy spread: sqrt(49250^2 - (38*1280)^2) J = "
        "6.5 %. Loss inside the region: 1 loss under normal driving in 26 runs of 8 m (Kim et al. 2009, "
        "Table II). Outside and occluded rates and the angle gain are assumptions until runs replace them."
    ),
    fixed_s=300.0,
    drive_factor=9.9,
    turn_factor=1.0,
    slope_gain=1.0,
    duration_cv=0.88,
    energy_factor=1.0,
    energy_cv=0.065,
    inside_per_m=0.0048,
    outside_per_m=0.05,
    occluded_per_m=0.15,
    angle_gain_per_rad=1.0,
)


# --------------------------------------------------------------------------- fitting

ARRIVAL_BELIEVED = 1.0 / 26.0
"""Tracks lost on an approach, before runs tell: one of 26 under normal driving (Kim et al. 2009, II)."""


@dataclass(frozen=True, slots=True)
class RegressionFit:
    """Non-negative coefficients of a mean and the coefficient of variation round it."""

    coefficients: tuple[float, ...]
    cv: float


def fit_mean(features: npt.ArrayLike, measured: npt.ArrayLike) -> RegressionFit:
    """Return `measured ~ features @ coefficients` with spread in proportion to the mean.

    Parameters
    ----------
    features
        Shape (legs, k), for durations for example 1, driving seconds, turning seconds.
    measured
        Shape (legs,), positive: seconds or joules.

    Notes
    -----
    Non-negative least squares, weights 1 / mean^2 from the fit before, ten rounds. The cv is that of the
    residuals, with k taken off the degrees of freedom.
    """
    a = np.asarray(features, dtype=np.float64)
    b = np.asarray(measured, dtype=np.float64)
    if a.ndim != 2 or b.shape != (a.shape[0],) or a.shape[0] < a.shape[1]:
        raise ProblemError(
            f"features have shape {a.shape}, measurements {b.shape}; (n, k) and (n,) with n >= k are needed"
        )
    if not (np.all(np.isfinite(a)) and np.all(np.isfinite(b)) and np.all(b > 0)):
        raise ProblemError("features must be finite and measurements positive")
    from scipy.optimize import nnls

    mean = np.full(b.shape, b.mean())
    coefficients = np.zeros(a.shape[1])
    for _ in range(10):
        coefficients, _ = nnls(a / mean[:, None], b / mean)
        mean = np.maximum(a @ coefficients, 1e-6 * b.mean())
    freedom = max(1, a.shape[0] - a.shape[1])
    cv = math.sqrt(float((((b - mean) / mean) ** 2).sum()) / freedom)
    return RegressionFit(tuple(map(float, coefficients)), cv)


def fit_calibration(
    *,
    name: str,
    source: str,
    prior: Calibration,
    length_m: Sequence[float] | npt.NDArray[np.float64],
    turn_rad: Sequence[float] | npt.NDArray[np.float64],
    duration_s: Sequence[float] | npt.NDArray[np.float64],
    energy_j: Sequence[float] | npt.NDArray[np.float64],
    speed_m_s: float,
    turn_rate_rad_s: float,
    drive_power_w: float,
    exposure_m: npt.ArrayLike | None = None,
    lost: npt.ArrayLike | None = None,
    own: npt.ArrayLike | None = None,
    failures: int = 0,
    tried_m: Sequence[float] | npt.NDArray[np.float64] = (),
    day: Sequence[Hashable] = (),
    tracked: Sequence[float] | npt.NDArray[np.float64] | None = None,
    track_overhead_s: float = 0.0,
    activities: tuple[ActivityFit, ...] = (),
) -> Calibration:
    """Return a calibration fitted to driven legs; what the legs do not tell stays as in `prior`.

    Parameters
    ----------
    length_m, turn_rad, duration_s, energy_j
        Shape [n], one number a leg; energies without hotel load.
    exposure_m, lost
        Tracks watched, [k, 2 or 3] and [k], as for `fit_loss` with columns inside, outside and (optional)
        occluded.
    own
        Whether each of those tracks was of the target that its leg led to, [k]; without it nothing is learned
        of arrivals.
    failures, tried_m
        Drives that failed, and metres of each that set out, [m], those too; see `fit_failures`. Without
        drives the rate stays as in `prior`.
    day
        The day of each leg, [n]; without them no factor of the day is looked for.
    tracked, track_overhead_s
        Targets tracked on each leg, [n], and what each was believed to add to its time. That is fitted where
        the number differs; else the prior's figure is taken off, or this one. Without `tracked` durations are
        those without tracking overhead.
    activities
        What was learned of other activities.
    """
    length = np.asarray(length_m, dtype=np.float64)
    turn = np.asarray(turn_rad, dtype=np.float64)
    duration = np.asarray(duration_s, dtype=np.float64)
    energy = np.asarray(energy_j, dtype=np.float64)
    watched = np.zeros_like(length) if tracked is None else np.asarray(tracked, dtype=np.float64)
    columns = [np.ones_like(length), length / speed_m_s, turn / turn_rate_rad_s]
    # as many tracks on every drive cannot be told from its fixed time
    told = bool(np.ptp(watched)) if len(watched) else False
    if told:
        columns.append(watched)
    else:
        known_s = track_overhead_s if prior.track_s is None else prior.track_s
        duration = np.maximum(duration - known_s * watched, 1.0)
    features = np.column_stack(columns)
    time_fit = fit_mean(features, duration)
    mean_s = features @ np.asarray(time_fit.coefficients)
    drive_s = np.maximum(features[:, :3] @ np.asarray(time_fit.coefficients[:3]), 1e-9)
    time_cv = time_fit.cv
    if told:
        # What scatters is put down to the drive alone, as the problem has it; by sums, since what tracks add
        # would be many times a short drive.
        free = max(1, len(duration) - features.shape[1]) / len(duration)
        time_cv = math.sqrt(float(np.square(duration - mean_s).sum() / np.square(drive_s).sum()) / free)
    spent = np.column_stack([drive_power_w * drive_s, np.ones_like(length)])[:, : 2 if told else 1]
    energy_fit = fit_mean(spent, energy)
    time_day = energy_day = NO_FACTOR
    if len(day):
        said_s = np.maximum(mean_s, 1e-9)
        said_j = np.maximum(spent @ np.asarray(energy_fit.coefficients), 1e-9)
        time_day, energy_day = day_factors(np.log(duration / said_s), np.log(energy / said_j), day)
    rates = [prior.inside_per_m, prior.outside_per_m, prior.occluded_per_m, prior.arrival_rate]
    errors = [0.0, 0.0, 0.0, prior.arrival_se]
    tracks = losses = 0
    if exposure_m is not None and lost is not None:
        x = np.zeros((len(np.asarray(lost)), 4))
        x[:, : np.shape(exposure_m)[1]] = exposure_m
        if own is not None:
            x[:, 3] = own
        believed = [*rates[:3], rates[3] or ARRIVAL_BELIEVED]
        loss = fit_loss(x, lost, np.maximum(believed, 1e-4))
        metres = x.sum(axis=0)
        for k in np.flatnonzero(metres > 0):
            rates[k] = loss.rate_per_m[k]
            # A rate at 0 has no curvature to tell its error: one loss more would have made it 1 / metres.
            error = loss.standard_error[k]
            errors[k] = error if math.isfinite(error) else 1.0 / float(metres[k])
        tracks, losses = x.shape[0], int(np.asarray(lost).sum())
    fails, fails_se = prior.fail_per_m, prior.fail_se_per_m
    if sum(tried_m) > 0.0:
        fails, fails_se = fit_failures(failures, tried_m, prior.fail_per_m)
    return Calibration(
        name=name,
        source=source,
        fixed_s=time_fit.coefficients[0],
        drive_factor=time_fit.coefficients[1],
        turn_factor=time_fit.coefficients[2],
        slope_gain=prior.slope_gain,
        duration_cv=_within(time_day, time_cv),
        energy_factor=energy_fit.coefficients[0],
        energy_cv=_within(energy_day, energy_fit.cv),
        inside_per_m=rates[0],
        outside_per_m=rates[1],
        occluded_per_m=rates[2],
        angle_gain_per_rad=prior.angle_gain_per_rad,
        legs=int(length.size),
        tracks=tracks,
        losses=losses,
        inside_se_per_m=errors[0],
        outside_se_per_m=errors[1],
        occluded_se_per_m=errors[2],
        fail_per_m=fails,
        fail_se_per_m=fails_se,
        failures=failures,
        day_time_sd=time_day.between_sd,
        day_time_se=time_day.error,
        day_energy_sd=energy_day.between_sd,
        day_energy_se=energy_day.error,
        days=max(time_day.days, energy_day.days),
        fixed_j=energy_fit.coefficients[1] if told else prior.fixed_j,
        arrival_rate=rates[3],
        arrival_se=errors[3],
        track_s=time_fit.coefficients[3] if told else prior.track_s,
        activities=activities,
    )


def _within(found: DayFactor, cv: float) -> float:
    """Return the coefficient of variation of the drives of one day; of all where days do not differ."""
    return math.sqrt(math.expm1(found.within_sd**2)) if found.days else cv
