"""Who matches how well: the product's SIFT, what is between it and a network, and the network.

Every method matches the same keypoints, each other's nearest, ranked by the ratio of the nearest to the
second distance (Lowe 2004), and is judged by the same geometry.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import cv2
import numpy as np
import numpy.typing as npt

from rover_iface.vision.drape import SIGMA_PX, DrapeOptions
from rover_iface.vision.learned.descriptor import Net, described
from rover_iface.vision.reacquisition import ReacquisitionOptions, SecondOpinion
from rover_iface.vision.resection import resect
from studies.learned_matcher.patches import Array, Grey, Keys, patches_of, single, upright_sift
from studies.learned_matcher.sights import Ground, Sight

RIGHT_PX, WRONG_PX = 1.0, 3.0
"""In pictures at half size; what lies between is neither."""
NAMES = ("SIFT (product)", "SIFT, upright", "patch itself", "network", "SIFT or network", "SIFT and network")
SIFT, NETWORK = NAMES[0], NAMES[3]
RATIOS = {
    SIFT: ReacquisitionOptions().ratio,
    "SIFT, upright": 0.865,
    "patch itself": 0.86,
    NETWORK: SecondOpinion().ratio,
}
"""Best over second-best distance that is believed: the product's own, and for the others that at which they
are as precise as SIFT on tuning seed 0 of (b) and (d), as the network's is."""
PATCH_SIDE = 12
"""Side of a whole patch taken as its own descriptor: correlation."""
Indices = npt.NDArray[np.int64]
Vectors = npt.NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class Matches:
    """Numbers (n, 2) of keypoints that match, and how far each is from what is believed (n,): 1 just is."""

    pairs: Indices
    doubt: Array

    def believed(self) -> Indices:
        """Return the numbers (k, 2) of those that are."""
        return self.pairs[self.doubt < 1.0]


@dataclass(frozen=True, slots=True)
class Outcome:
    """What one method made of one sight.

    Attributes
    ----------
    doubts, offs
        Of its matches: doubt, and px from the truth.
    shown
        Keypoints of which the other picture has one within `RIGHT_PX`.
    seconds
        Of processor, for descriptors of both pictures and matches; keypoints are given.
    agree, target_px
        Matches that agree on a pose, and how far that has the targets from where they are, px at half size;
        None where no pose is asked.
    """

    method: str
    doubts: list[float]
    offs: list[float]
    shown: int
    seconds: float
    agree: int | None = None
    target_px: float | None = None

    def count(self) -> tuple[int, int]:
        """Return how many of the believed matches are right and wrong."""
        offs = np.array(self.offs)[np.array(self.doubts) < 1.0]
        return int((offs <= RIGHT_PX).sum()), int((offs > WRONG_PX).sum())


def ranked(old: Vectors, new: Vectors) -> tuple[Indices, Array]:
    """Return numbers (k, 2) of vectors (n, d), (m, d) that are each other's nearest, and the ratio (k,) of
    that distance to the second: `sift_features.mutual` before its test.
    """
    if min(len(old), len(new)) < 2:
        return np.empty((0, 2), np.int64), np.empty(0)
    distance = (old * old).sum(1)[:, None] + (new * new).sum(1)[None] - 2.0 * (old @ new.T)
    np.maximum(distance, 0.0, out=distance)
    two = np.argpartition(distance, 1, axis=1)[:, :2]
    values = np.take_along_axis(distance, two, axis=1)
    first = two[np.arange(len(old)), values.argmin(axis=1)]
    rows = np.flatnonzero(distance.argmin(axis=0)[first] == np.arange(len(old)))
    ratio = np.sqrt(values.min(axis=1)[rows] / np.maximum(values.max(axis=1)[rows], 1e-12))
    return np.column_stack((rows, first[rows])), ratio.astype(np.float64)


def by_sift(sight: Sight) -> Matches:
    """Match as the product does."""
    pairs, ratio = ranked(sight.old.sift, sight.new.sift)
    return Matches(pairs, ratio / RATIOS[SIFT])


def by_vectors(sight: Sight, describe: Callable[[Keys], Vectors], ratio: float) -> Matches:
    """Match other descriptors (n, d) of the keypoints, each place and scale once."""
    chosen = [single(keys) for keys in (sight.old, sight.new)]
    old, new = (
        describe(keys.some(which)) for keys, which in zip((sight.old, sight.new), chosen, strict=True)
    )
    pairs, found = ranked(old, new)
    numbers = np.column_stack((chosen[0][pairs[:, 0]], chosen[1][pairs[:, 1]]))
    return Matches(numbers, found / ratio)


def itself(patches: Grey) -> Vectors:
    """Return patches (n, 32, 32) as unit vectors (n, PATCH_SIDE^2): their product is the correlation."""
    small = [
        cv2.resize(patch, (PATCH_SIDE, PATCH_SIDE), interpolation=cv2.INTER_AREA).ravel() for patch in patches
    ]
    vectors = np.array(small, np.float32).reshape(-1, PATCH_SIDE**2)
    vectors -= vectors.mean(axis=1, keepdims=True)
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-9), np.float32)


def places(keys: Keys) -> Indices:
    """Return for each keypoint (n,) the number of the first that stands at its pixel."""
    first, inverse = np.unique(keys.pixels, axis=0, return_index=True, return_inverse=True)[1:]
    return np.asarray(first[inverse.ravel()], dtype=np.int64)


def by_place(sight: Sight, matches: Matches) -> Matches:
    """Return the matches of places, each once with its least doubt."""
    pairs = np.column_stack(
        (places(sight.old)[matches.pairs[:, 0]], places(sight.new)[matches.pairs[:, 1]])
    ).reshape(-1, 2)
    order = np.lexsort((matches.doubt, pairs[:, 1], pairs[:, 0]))
    pairs, doubt = pairs[order], matches.doubt[order]
    new = np.ones(len(pairs), bool)
    new[1:] = (pairs[1:] != pairs[:-1]).any(axis=1)
    return Matches(pairs[new], doubt[new])


def either(one: Matches, other: Matches) -> Matches:
    """Return matches of places of which one or the other is sure; the surer where they differ."""
    pairs, doubt = np.concatenate((one.pairs, other.pairs)), np.concatenate((one.doubt, other.doubt))
    order = np.argsort(doubt, kind="stable")
    first = np.sort(np.unique(pairs[order, 0], return_index=True)[1])
    return Matches(pairs[order][first], doubt[order][first])


def both(one: Matches, other: Matches) -> Matches:
    """Return matches of places that both have, as doubtful as the less sure says."""
    known = {tuple(pair): float(d) for pair, d in zip(other.pairs.tolist(), other.doubt, strict=True)}
    shared = [(n, known[tuple(pair)]) for n, pair in enumerate(one.pairs.tolist()) if tuple(pair) in known]
    which = np.array([n for n, _ in shared], dtype=np.int64)
    return Matches(one.pairs[which], np.maximum(one.doubt[which], [d for _, d in shared]))


def outcomes(sight: Sight, net: Net) -> list[Outcome]:
    """Return what every method makes of a sight."""

    def by_network(keys: Keys) -> Vectors:
        return described(net, patches_of(keys))

    def by_patch(keys: Keys) -> Vectors:
        return itself(patches_of(keys))

    def again(keys: Keys) -> Vectors:
        return upright_sift(keys)

    methods: dict[str, Callable[[Sight], Matches]] = {
        SIFT: by_sift,
        NAMES[1]: partial(by_vectors, describe=again, ratio=RATIOS[NAMES[1]]),
        NAMES[2]: partial(by_vectors, describe=by_patch, ratio=RATIOS[NAMES[2]]),
        NETWORK: partial(by_vectors, describe=by_network, ratio=RATIOS[NETWORK]),
    }
    found, seconds = {}, {}
    for name, method in methods.items():
        started = time.process_time()
        found[name] = method(sight)
        seconds[name] = time.process_time() - started
        found[name] = by_place(sight, found[name])
    together = seconds[SIFT] + seconds[NETWORK]
    for name, join in ((NAMES[4], either), (NAMES[5], both)):
        found[name], seconds[name] = join(found[SIFT], found[NETWORK]), together
    shown = matchable(sight)
    return [judged(sight, name, found[name], shown, seconds[name]) for name in NAMES]


def matchable(sight: Sight) -> int:
    """Return how many places of the first picture the second has a keypoint of."""
    new, count = sight.new.pixels, 0
    for n in np.unique(places(sight.old)):
        count += bool((sight.off(np.full(len(new), n), new) <= RIGHT_PX).any())
    return count


def judged(sight: Sight, name: str, matches: Matches, shown: int, seconds: float) -> Outcome:
    """Return what matches are worth."""
    old, new = matches.pairs.T
    # what the other picture does not show at all is judged where the truth is known; elsewhere it is not
    offs = sight.off(old, sight.new.pixels[new])
    agree, target_px = None, None
    if sight.ground is not None:
        agree, target_px = posed(sight.ground, matches.believed(), sight.new.pixels)
    return Outcome(name, matches.doubt.tolist(), offs.tolist(), shown, seconds, agree, target_px)


def posed(ground: Ground, pairs: Indices, pixels: Array) -> tuple[int, float]:
    """Return how many matches agree on a pose, and how far it has the targets from their pixels at most."""
    options = ReacquisitionOptions()
    old, new = pairs.T
    settled = resect(
        ground.points[old],
        ground.unit[old],
        pixels[new],
        ground.believed,
        reach_px=options.reach_px,
        sigma_px=SIGMA_PX,
    )
    if settled is None:
        return 0, math.inf
    seen = np.asarray(ground.believed.project(settled[0].new_from_old.apply(ground.targets)))
    off = np.hypot(*(seen - ground.target_px).T)
    return settled[0].inliers, float(np.where(np.isfinite(off), off, np.inf).max())


@dataclass(slots=True)
class Sums:
    """Figures of one method over the sights of a domain.

    Attributes
    ----------
    right, wrong, shown
        Believed matches, and what could have been matched.
    curve
        Share of `shown` that is matched right while 95 % of what is believed is not wrong, at whatever doubt
        does that.
    posed, misled, sights
        Sights whose pose enough matches agree on and that has the targets within reach of the patches; those
        of which the agreed pose has not; and all.
    seconds, agree
        Of each sight: processor time, and matches that agree on a pose where one is asked.
    """

    right: int = 0
    wrong: int = 0
    shown: int = 0
    curve: float = 0.0
    posed: int = 0
    misled: int = 0
    sights: int = 0
    seconds: list[float] = field(default_factory=list)
    agree: list[int] = field(default_factory=list)


PRECISE = 0.95


def sums(found: list[Outcome]) -> Sums:
    """Return the figures of outcomes of one method."""
    total, limits = Sums(sights=len(found)), ReacquisitionOptions()
    reach_px = 0.5 * DrapeOptions().search_px[0]  # of whole pictures; these are half as large
    for one in found:
        right, wrong = one.count()
        total.right += right
        total.wrong += wrong
        total.shown += one.shown
        total.seconds.append(one.seconds)
        total.agree += [] if one.agree is None else [one.agree]
        if one.agree is not None and one.target_px is not None and one.agree >= limits.least_features:
            total.posed += one.target_px <= reach_px
            total.misled += one.target_px > reach_px
    doubts = np.concatenate([one.doubts for one in found])
    offs = np.concatenate([one.offs for one in found])[np.argsort(doubts, kind="stable")]
    rights, wrongs = np.cumsum(offs <= RIGHT_PX), np.cumsum(offs > WRONG_PX)
    precise = rights[rights >= PRECISE * (rights + wrongs)]
    total.curve = int(precise.max(initial=0)) / max(1, total.shown)
    return total


def ratio_like(found: list[Outcome], model: list[Outcome]) -> float:
    """Return the doubt up to which a method is as precise as a model's believed matches."""
    counts = [one.count() for one in model]
    wanted = sum(r for r, _ in counts) / max(1, sum(r + w for r, w in counts))
    doubts = np.concatenate([one.doubts for one in found])
    order = np.argsort(doubts, kind="stable")
    offs = np.concatenate([one.offs for one in found])[order]
    right, wrong = np.cumsum(offs <= RIGHT_PX), np.cumsum(offs > WRONG_PX)
    good = np.flatnonzero(right >= wanted * np.maximum(1, right + wrong))
    return float(doubts[order][good[-1]]) if len(good) else 0.0
