"""Correlation on the way, and the first narrow picture once the target is near: which spot was meant.

A navcam's template of a rock seven metres away holds the rock's outline and the border of its shadow. Both
move over its face, the one as the rover goes round, the other with the sun, and a chain of matches follows
them: on days of five targets that were looked at, those that could not be placed on were 2 to 50 cm off. What
is seen from near cannot tell that; the picture in which the target was designated can. The narrow pair of the
same mast shows it as finely as the navcams do from a third of the distance. Draped over what they range from
near, dozens of patches of it say where it was taken from, and so where the designated pixel is
(`handoff_cascade`, which tests itself). What the rover had believed of the target is a first guess, no more,
so a track that was lost on the way, or that has drifted, is taken up again.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.model import Array
from rover_iface.errors import CameraError, RenderError, TrackerError
from rover_iface.frames import Transform
from rover_iface.vision.coverage_watch import INSIDE
from rover_iface.vision.handoff import Handoff, Side
from rover_iface.vision.handoff_cascade import cascade
from rover_iface.vision.narrow.designation import off_the_edge
from rover_iface.vision.narrow_range import PairFor
from rover_iface.vision.ncc import NccTracker
from rover_iface.vision.template import NccOptions, TemplateMatcher
from rover_iface.vision.tracker import StereoView, TrackState, TrackUpdate

RECALL_M = 3.4
"""From how near the first narrow picture is asked: there the navcams are as fine as it is from ten metres."""
AGAIN, ONCE_MORE = 0.15, 0.3
"""How far the rover must have come since it was asked, as a share of the target's range, until it is asked
again: after a refusal, after an answer. A turn of 9 degrees shows other patches; each time costs a second."""
ASTRAY_M, LOST_M = 0.10, 0.50
"""How far from its answer a tracked target may be believed, if it is not told to be worse known, and a lost
one; those of `shape_tracker`."""
FARTHER = 2.5
"""Times what is told of a track (95 %) that an answer may lie away from it: within 2 m that held 65 and 82 %
of the errors of correlation on fresh days (`docs/results/simulator.md`)."""
LOST_UPDATES = 8
"""Misses in a row after which a target is given up: lost at ten metres, it is where the first picture is
asked in as many steps of a tenth to a fifth of the range."""
REFUSED = 5
"""Looks in vain from near after which a lost target is given up: from 3.4 m to 1.5 m, nearer than which the
first picture shows too little of what the navcams see."""
NEAREST_M = 0.6
"""Least depth that stereo looks for in either pair."""
MEANT_M = 0.0015
"""One standard deviation of what the answers are off besides what the cascade tells: the way from the wide to
the narrow pixel (0.35 of its pixels, 0.8 mm at 7 m) and the surface between the posts of its cloud. Eight
answers on days looked at (383761576 to 383761579) were 0.3 to 3.5 mm off, 2.0 mm rms over both axes."""
BESIDE_PX = 12
"""How far a target is searched for in another picture of the same stop: six times the mast's noise of
1.2 mrad between two looks."""
LEAST_SCORE = 0.75
"""Correlation that this needs; that of the key template."""


@dataclass(frozen=True, slots=True, eq=False)
class _Kept:
    """A pair, the target's pixel in it, where it was believed then (3,), m, and how well that is known."""

    side: Side
    pixel: Array
    point: Array
    sigma_m: float


@dataclass(slots=True, eq=False)
class _Memory:
    """The first narrow pair of a target, and the last wide one in which it was found by that or by another.

    `asked` is the place (3,), m, of the eye when they were last asked, `share` how far it must have come
    since, of the range. `against` is how far off (3,), m, an answer had the target that was not taken over.
    `refused` counts the times that they were asked in vain for a lost target.
    """

    first: _Kept
    near: _Kept | None = None
    asked: Array | None = None
    share: float = AGAIN
    against: Array | None = None
    refused: int = 0


class NarrowRecall:
    """A `Tracker`: correlation, corrected from near by the first picture of a narrow pair.

    Without such a pair, or where it does not show the target, it answers as correlation does.
    """

    def __init__(
        self, options: NccOptions | None = None, narrow: PairFor | None = None, wide: PairFor | None = None
    ) -> None:
        options = options or NccOptions()
        self.tracker = NccTracker(replace(options, lost_updates=LOST_UPDATES))
        self.narrow = narrow
        self.wide = wide
        self._beside = TemplateMatcher(replace(options, search_px=BESIDE_PX))
        self._memories: dict[str, _Memory] = {}

    def start(self, target: str, position: npt.ArrayLike, view: StereoView) -> TrackUpdate:
        """See `Tracker`.

        A point that lies at an edge in the first pictures, as the mast's error puts it there, is moved to the
        nearest place beside it that lies on one surface.

        Raises
        ------
        TrackerError
            Besides what correlation raises, if there is no such place near.
        """
        place = np.asarray(position, dtype=np.float64)
        pair = _taken(self.narrow, target, place)
        pixel = np.asarray(view.left_camera.project(place), dtype=np.float64)
        away = float(np.linalg.norm(place - view.left_camera.C))
        sight = None
        if pair is not None and np.isfinite(pixel).all():
            pixel, sight = off_the_edge(target, view, pixel, pair, away)
        known = None if sight is None else sight.known
        update = self.tracker.start(target, place, view, pixel=pixel, known=known)
        self._memories.pop(target, None)
        if sight is not None:
            kept = _Kept(Side(sight.view, NEAREST_M), sight.pixel, update.position, MEANT_M)
            self._memories[target] = _Memory(kept)
        return update

    def update(self, target: str, view: StereoView) -> TrackUpdate:
        """See `Tracker`."""
        update = self.tracker.update(target, view)
        memory = self._memories.get(target)
        if memory is None:
            return update
        eye = view.left_camera.C
        away = float(np.linalg.norm(update.position - eye))
        come = math.inf if memory.asked is None else float(np.linalg.norm(eye - memory.asked))
        if away <= RECALL_M and come >= memory.share * away:
            pair = _taken(self.wide, target, update.position)
            if pair is not None:
                memory.asked, memory.share = eye, AGAIN
                update = self._recalled(target, memory, pair, update)
                memory.refused = memory.refused + 1 if update.state is TrackState.LOST else 0
        if memory.refused >= REFUSED:
            return replace(update, state=TrackState.FAILED)
        return update if memory.against is None else _doubted(update, memory.against)

    def _recalled(self, target: str, memory: _Memory, pair: StereoView, update: TrackUpdate) -> TrackUpdate:
        """Return the target as a kept pair has it in a wide one, the better first; `update` if none has."""
        side = Side(pair, NEAREST_M)
        for kept in (memory.first, memory.near):
            if kept is None:
                continue
            guess = Transform(np.eye(3), update.position - kept.point)
            answer = cascade(Handoff(side, kept.side.moved(guess), kept.pixel), "near")
            if not answer.accepted:
                continue
            gap = np.asarray(answer.position - update.position)
            if float(np.linalg.norm(gap)) > _reach_m(update):
                memory.against = gap
                continue
            away = float(np.linalg.norm(answer.position - pair.left_camera.C))
            sigma_m = math.hypot(answer.error_px * away / pair.left_camera.hs, kept.sigma_m)
            drift = sigma_m**2 * np.eye(3), np.zeros((3, 2))
            if not self.tracker.put(target, pair, answer.pixel, drift, away):
                continue
            found = self.tracker.last(target)
            memory.near = _Kept(side, answer.pixel, found.position, math.hypot(sigma_m, MEANT_M))
            memory.share, memory.against = ONCE_MORE, None
            return found
        return update

    def beside(self, target: str, view: StereoView) -> Array | None:
        """Return the pixel (2,) of the target in another wide picture of the stop it was last tracked at.

        None where it is not seen there.
        """
        source = self.tracker.template(target)
        expected = view.left_camera.project(source.point)
        if not np.isfinite(expected).all():
            return None
        template = self._beside.predict(source, view.left_camera, expected, source.point)
        found = None if template is None else self._beside.search(view.left, template, expected)
        return None if found is None or found.score < LEAST_SCORE else found.pixel

    def predicted(self, target: str) -> Array:
        """See `Tracker`."""
        return self.tracker.predicted(target)

    def clear(self, target: str) -> None:
        """See `Tracker`."""
        self.tracker.clear(target)
        self._memories.pop(target, None)


def _taken(look: PairFor | None, target: str, point: Array) -> StereoView | None:
    """Return the pair of a look at a believed point (3,), None where there is none."""
    if look is None:
        return None
    try:
        return look(target, point)
    except (CameraError, RenderError, TrackerError):
        return None


def _reach_m(update: TrackUpdate) -> float:
    """Return how far off an answer may have a target, metres."""
    if update.state is not TrackState.TRACKED:
        return LOST_M
    told_m = math.sqrt(INSIDE[2] * float(np.linalg.eigvalsh(update.covariance)[-1]))
    return min(LOST_M, max(ASTRAY_M, FARTHER * told_m))


def _doubted(update: TrackUpdate, gap: Array) -> TrackUpdate:
    """Return an answer that tells of a contradiction by (3,), m: nothing says which is right."""
    return replace(update, covariance=update.covariance + np.outer(gap, gap))
