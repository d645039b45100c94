"""Rates of what may happen on a metre of a drive: a track is lost, or the drive ends short of its goal.

Each is fitted to what was seen with what was believed before, so that little evidence moves it little, and
none makes it 0.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from planner.errors import ProblemError
from planner.path_network.activity_fit import BELIEVED, HALF

PRIOR_SPREAD = math.log(4.0)
"""What all rates of lost tracks may be off together, the tracker being better or worse than believed:
standard deviation of a logarithm, a factor of four. So all that is believed is worth half a loss, as
Jeffreys' prior is (1 / ln^2 4 = 0.52); were each of four rates on its own it would be 2.1, more than many
days see."""
PRIOR_APART = math.log(2.0)
"""What each rate may be off besides: a factor of two. In 216 runs (docs/results/path-network.md) the rates
inside the region and outside were 5.8 and 2.1 times what was believed, so exp(1.4 * 0.7) apart: one standard
deviation of the difference of two."""


@dataclass(frozen=True, slots=True)
class LossFit:
    """Loss rates per metre with their standard errors, in the order of the exposures' columns."""

    rate_per_m: tuple[float, ...]
    standard_error: tuple[float, ...]
    log_likelihood: float


def fit_loss(
    exposure_m: npt.ArrayLike, lost: npt.ArrayLike, prior_per_m: npt.ArrayLike | None = None
) -> LossFit:
    """Return the rates (k,), losses a metre, that make the seen losses most likely.

    Parameters
    ----------
    exposure_m
        Shape (tracks, k): metres that each watched track was driven under each of k circumstances (inside
        the tracking region, outside, occluded). Up to the leg's end, also when the track was lost on it.
    lost
        Shape (tracks,): whether the track was lost on that leg.
    prior_per_m
        Shape (k,), positive: rates believed before, all together within a factor of four and each of them
        within one of two (log-normal, `PRIOR_SPREAD` and `PRIOR_APART`). One loss over a few centimetres of a
        circumstance has no finite rate without it.

    Raises
    ------
    ProblemError
        If shapes disagree, a rate believed before is not positive, or an exposure is negative or not finite.

    Notes
    -----
    Loss on a leg has probability `1 - exp(-x . rate)`; the log-likelihood is concave in the rates, and
    L-BFGS-B finds its maximum under `rate >= 0`. With rates believed before it is the mode of their
    logarithms after the losses, which is never 0. Standard errors are from the observed information, of the
    logarithms then; a rate at 0 or without exposure has an infinite one.
    """
    x = np.asarray(exposure_m, dtype=np.float64)
    y = np.asarray(lost, dtype=np.float64)
    if x.ndim != 2 or y.shape != (x.shape[0],) or not x.shape[0]:
        raise ProblemError(
            f"exposures have shape {x.shape}, losses {y.shape}; (n, k) and (n,) with n > 0 are needed"
        )
    if not np.all(np.isfinite(x)) or np.any(x < 0):
        raise ProblemError("an exposure is negative or not finite")
    if not np.all((y == 0) | (y == 1)):
        raise ProblemError("losses must be 0 or 1")
    if np.any((y == 1) & (x.sum(axis=1) == 0)):
        raise ProblemError("a track was lost over 0 m; the model has no chance for that")
    believed = None if prior_per_m is None else np.asarray(prior_per_m, dtype=np.float64)
    if believed is not None and not (believed.shape == (x.shape[1],) and np.all(believed > 0)):
        raise ProblemError(f"rates believed before are {believed}; {x.shape[1]} positive ones are needed")
    from scipy.optimize import minimize

    begin = np.maximum(y.sum(), 0.5) / x.sum().clip(1e-9)

    def negative(rate: npt.NDArray[np.float64]) -> tuple[float, npt.NDArray[np.float64]]:
        s = x @ rate
        hit = y == 1
        p = -np.expm1(-s[hit])
        value = s[~hit].sum() - np.log(np.maximum(p, 1e-300)).sum()
        gradient = x[~hit].sum(axis=0) - (x[hit] * (np.exp(-s[hit]) / np.maximum(p, 1e-300))[:, None]).sum(
            axis=0
        )
        if believed is not None:
            away = np.log(rate / believed)
            pull = _belief(away)
            value += 0.5 * float(away @ pull)
            gradient = gradient + pull / rate
        return float(value), gradient

    best = minimize(
        negative,
        np.full(x.shape[1], begin) if believed is None else believed,
        jac=True,
        method="L-BFGS-B",
        bounds=[(0.0 if believed is None else 1e-9, None)] * x.shape[1],
        options={"maxiter": 1000, "ftol": 1e-14, "gtol": 1e-10},
    )
    rate = np.where(x.sum(axis=0) > 0, best.x, 0.0)
    error = np.where(rate > 1e-12, _errors(x[y == 1], best.x, believed), np.inf)
    return LossFit(tuple(map(float, rate)), tuple(map(float, error)), float(-best.fun))


def _errors(
    hits: npt.NDArray[np.float64],
    rate: npt.NDArray[np.float64],
    believed: npt.NDArray[np.float64] | None,
) -> npt.NDArray[np.float64]:
    """Return standard errors (k,) of the most likely rates (k,), infinite at 0; `hits` (losses, k) are the
    exposures of lost tracks.
    """
    s = hits @ rate
    p = np.maximum(-np.expm1(-s), 1e-12)
    information = (hits * (np.exp(-s) / p**2)[:, None]).T @ hits
    error = np.full(len(rate), np.inf)
    if believed is None:
        free = rate > 1e-12
        error[free] = np.sqrt(np.diag(np.linalg.pinv(information[np.ix_(free, free)])))
        return error
    # of logarithms; what the likelihood pulls by at its mode is what the belief pulls back by
    information = np.outer(rate, rate) * information + _belief(np.eye(len(rate)))
    information -= np.diag(_belief(np.log(rate / believed)))
    return rate * np.sqrt(np.diag(np.linalg.inv(information)))


def _belief(away: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return the inverse covariance of the believed logarithms of rates times `away`, (k,) or (k, m).

    The covariance is `PRIOR_APART`^2 I + `PRIOR_SPREAD`^2 J, J all ones; its inverse is by Sherman and
    Morrison's formula.
    """
    own, shared = PRIOR_APART**2, PRIOR_SPREAD**2
    together: npt.NDArray[np.float64] = away.sum(axis=0) * shared / (own + len(away) * shared)
    return (away - together) / own


def fit_failures(
    failures: int, tried_m: Sequence[float] | npt.NDArray[np.float64], believed_per_m: float = 0.0
) -> tuple[float, float]:
    """Return the rate of drives that fail, 1/m, and its standard error; never 0, seen or not.

    Parameters
    ----------
    failures
        Drives that ended short of their goal.
    tried_m
        Shape [n], metres of each drive, to where it ended; their sum positive.
    believed_per_m
        The rate believed before; 0 where no figure is known, which is taken as `HALF` a failure among the
        drives that a belief is worth.

    Notes
    -----
    A failure is as likely on each metre, so failures are a Poisson number. A belief of a failures in b metres
    is a gamma distribution, of mean (a + failures) / (b + metres) after them (Gelman et al. 2013, section
    2.6). b is `BELIEVED` drives of the mean length, as other beliefs are worth; half a failure in them is one
    of ten drives.
    """
    driven_m = math.fsum(tried_m)
    worth_m = BELIEVED * driven_m / len(tried_m)
    events = failures + (believed_per_m * worth_m or HALF)
    return events / (worth_m + driven_m), math.sqrt(events) / (worth_m + driven_m)
