"""How well a classifier tells two kinds of pictures apart by the statistics of their patches.

A *scene* is all pictures of one place; its patches are never on both sides of a split. All weights are by
scene, so a scene with many patches counts no more than another, and the two kinds weigh the same.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Kernel = Literal["linear", "rbf"]
Scenes = Mapping[str, Array]
"""Statistics (n, k) of the patches of each scene."""

Fold = tuple[Sequence[str], Sequence[str]]
"""Scenes of the first and of the second kind that are left out together and judged."""

REGULARISATION = 1.0
"""C of both machines on standardised statistics; the library's default, not tuned on any frame."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """How well held-out patches were told apart.

    Attributes
    ----------
    names
        Of the held-out scenes, one a fold (the first kind's, then the second's).
    accuracy
        (folds,) mean of the shares of patches of either kind that were recognised; 0.5 is chance.
    low, high
        Ends of a 95 % interval of the mean accuracy, by drawing folds with replacement.
    """

    names: tuple[str, ...]
    accuracy: Array
    low: float
    high: float

    @property
    def mean(self) -> float:
        """Return the mean accuracy over folds."""
        return float(self.accuracy.mean())


def machine(kernel: Kernel) -> Any:
    """Return an untrained classifier (scikit-learn, `studies/telling_apart.txt`)."""
    svm, steps, scaling = (import_module(f"sklearn.{name}") for name in ("svm", "pipeline", "preprocessing"))
    if kernel == "linear":
        chosen = svm.LinearSVC(C=REGULARISATION, dual=False)
    else:
        chosen = svm.SVC(C=REGULARISATION, kernel="rbf", gamma="scale")
    return steps.Pipeline([("scale", scaling.StandardScaler()), ("svm", chosen)])


def paired(first: Scenes, second: Scenes) -> list[Fold]:
    """Return folds that leave out each scene of the first kind with the scenes of the second named after it.

    A scene of the second kind is named after one of the first if it has that name, or that name, a slash and
    more.

    Raises
    ------
    ValueError
        If a scene has no partner.
    """
    folds: list[Fold] = []
    for name in first:
        partners = [other for other in second if other == name or other.startswith(f"{name}/")]
        if not partners:
            raise ValueError(f"scene {name} has no partner among {sorted(second)}")
        folds.append(([name], partners))
    return folds


def crossed(first: Scenes, second: Scenes) -> list[Fold]:
    """Return folds that leave out every pair of a scene of the first kind and one of the second."""
    return [([a], [b]) for a in first for b in second]


def tell_apart(
    first: Scenes, second: Scenes, folds: Sequence[Fold], kernel: Kernel, *, rng: np.random.Generator
) -> Verdict:
    """Return how well two kinds of scenes are told apart, each fold judged by a machine that has not seen it.

    Raises
    ------
    ValueError
        If a fold leaves nothing of a kind to train on.
    """
    accuracy, names = [], []
    for out_first, out_second in folds:
        kept = [
            {name: values for name, values in kind.items() if name not in out}
            for kind, out in ((first, out_first), (second, out_second))
        ]
        if not all(kept):
            raise ValueError(
                f"leaving out {[*out_first, *out_second]} leaves a kind without a scene to train on"
            )
        trained = _trained(kept[0], kept[1], machine(kernel))
        decisions = [
            [np.asarray(trained.decision_function(kind[name])) for name in out]
            for kind, out in ((first, out_first), (second, out_second))
        ]
        right = [[sign * d > 0 for d in kind] for sign, kind in zip((-1, 1), decisions, strict=True)]
        accuracy.append(np.mean([np.mean([r.mean() for r in kind]) for kind in right]))
        names.append(" / ".join([*out_first, *(out_second if list(out_second) != list(out_first) else [])]))
    found = np.array(accuracy)
    draws = found[rng.integers(0, len(found), (10_000, len(found)))].mean(axis=1)
    low, high = np.percentile(draws, [2.5, 97.5])
    return Verdict(tuple(names), found, float(low), float(high))


def _trained(first: Scenes, second: Scenes, untrained: Any) -> Any:
    """Return the machine after it has seen two kinds of scenes, the first as -1, the second as +1."""
    values = np.concatenate([*first.values(), *second.values()])
    labels = np.concatenate(
        [np.full(len(v), sign) for sign, kind in ((-1, first), (1, second)) for v in kind.values()]
    )
    weights = np.concatenate(
        [np.full(len(v), 1.0 / (len(v) * len(kind))) for kind in (first, second) for v in kind.values()]
    )
    return untrained.fit(values, labels, svm__sample_weight=weights * len(values) / weights.sum())


def auc(first: Array, second: Array) -> float:
    """Return the chance that a number of the second sample (n,) exceeds one of the first (m,), ties half."""
    from scipy.stats import rankdata

    ranks = rankdata(np.concatenate((first, second)))
    total = float(ranks[len(first) :].sum()) - len(second) * (len(second) + 1) / 2
    return total / (len(first) * len(second))


def feature_aucs(first: Scenes, second: Scenes, folds: Sequence[Fold]) -> Array:
    """Return (folds, k) the area under the curve of each statistic alone, fold by fold: 0.5 parts nothing."""
    rows = []
    for a, b in folds:
        mine, other = np.concatenate([first[n] for n in a]), np.concatenate([second[n] for n in b])
        rows.append([auc(mine[:, k], other[:, k]) for k in range(mine.shape[1])])
    return np.array(rows)
