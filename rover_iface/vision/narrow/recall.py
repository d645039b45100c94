"""Correlation on the way, and the first narrow picture once the target is near: which spot was meant.

A navcam's template of a rock seven metres away holds the rock's outline and the border of its shadow. Both
move over its face, the one as the rover goes round, the other with the sun, and a chain of matches follows
them: on days of five targets that were looked at, those that could not be placed on were 2 to 50 cm off. What
is seen from near cannot tell that; the picture in which the target was designated can. The narrow pair of the
same mast shows it as finely as the navcams do from a third of the distance. Draped over what they range from
near, dozens of patches of it say where it was taken from, and so where the designated pixel is
(`handoff_cascade`, which tests itself). What the rover had believed of the target is a first guess, no more,
so a track that was lost on the way, or that has drifted, is taken up again.

A drive is worth making as long as that can be hoped for. So a target that is out of sight far away, behind a
rock or on the way to another, coasts, as a radar's track does between two echoes: it is told as tracked, with
the error with which the drive and the other targets have it, until the first picture would hardly find it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.model import Array
from rover_iface.errors import CameraError, RenderError, TrackerError
from rover_iface.frames import Transform
from rover_iface.vision.correlation.judging import ASTRAY, TAILS
from rover_iface.vision.correlation.ncc import NccTracker
from rover_iface.vision.coverage_watch import INSIDE
from rover_iface.vision.drape import DrapeOptions
from rover_iface.vision.handoff import Handoff, Side
from rover_iface.vision.handoff_cascade import Answer, CascadeOptions, cascade
from rover_iface.vision.narrow.crest import Shown, edge_before, range_error_m
from rover_iface.vision.narrow.designation import off_the_edge
from rover_iface.vision.narrow.references import Kept, References
from rover_iface.vision.narrow_range import KnownRange, PairFor
from rover_iface.vision.template import NccOptions, TemplateMatcher
from rover_iface.vision.tracker import StereoView, TrackState, TrackUpdate

RECALL_M = 3.4
"""From how near the first narrow picture is asked: there the navcams are as fine as it is from ten metres."""
AGAIN, ONCE_MORE = 0.15, 0.3
"""How far the rover must have come since it was asked, as a share of the target's range, until it is asked
again: after a refusal, after an answer. A turn of 9 degrees shows other patches; each time costs a second."""
ASTRAY_M, LOST_M = 0.10, 0.50
"""How far from its answer a target may be believed, if it is not told to be worse known, and at most; those
of `shape_tracker`."""
FARTHER = 2.5
"""Times what is told of a track (95 %) that an answer may lie away from it: within 2 m that held 65 and 82 %
of the errors of correlation on fresh days (`docs/results/simulator.md`). Of a lost one the map tells, if few
patches have it: 18 had one 24 cm from where it stood, known to 1 cm (749793022)."""
LOST_UPDATES = 8
"""Misses in a row after which a target is given up: lost at ten metres, it is where the first picture is
asked in as many steps of a tenth to a fifth of the range."""
REFUSED = 5
"""Looks in vain from near after which a lost target is given up: from 3.4 m to 1.5 m, nearer than which the
first picture shows too little of what the navcams see."""
NEAREST_M = 0.6
"""Least depth that stereo looks for in the wide pair, and in the first narrow one."""
DEPTHS = 0.7, 1.6
"""Depths that it looks for in the other narrow ones, as shares of the target's range: nearer than five metres
their disparities are wider than half a subframe."""
MEANT_M = 0.0015
"""One standard deviation of what the answers are off besides what the cascade tells: the way from the wide to
the narrow pixel (0.35 of its pixels, 0.8 mm at 7 m) and the surface between the posts of its cloud. Eight
answers on days looked at (383761576 to 383761579) were 0.3 to 3.5 mm off, 2.0 mm rms over both axes."""
BESIDE_PX = 12
"""How far a target is searched for in another picture of the same stop: six times the mast's noise of
1.2 mrad between two looks."""
UNCONFIRMED_M = 0.03
"""Error of a target near by that the pictures were asked for and did not show: templates alone had such ones
3.4 and 20.7 cm off on days looked at (918827762 to 918827764, 21431111), and told 2 cm; the 13 others were
confirmed, and 0.2 to 1.0 cm off."""
IN_VAIN = 2
"""Stops since the pictures showed a target at which they were asked for it and did not, from which on it is
known no better than one that they never showed. On 473728539 (looked at) they were asked four times while
correlation slid by 2 cm and told 4 mm, and the tool was claimed 2.2 cm off. Of 48 tools put down right in 20
flights of 18 looked-at days (those of `ASIDE`) one had been asked for in vain once, the others never."""
LAID = CascadeOptions(
    drape=DrapeOptions(patches=140, reach_m=0.8, enough=45, least_agree=18, believed_first=True),
    many_agree=30,
    blind_px=2.5,
    surface_m=0.04,
    most_error_px=4.0,
    overrule=30,
)
"""How a kept pair is registered to a new one. The sun goes on and other faces are seen, so few patches near
the target are found again; there are more on the ground and the rocks round it, and all stand still. Eighteen
must agree: twelve did on a place 26 cm off, fifteen on one 1.8 m off, on days looked at (477206368,
434954184), where nearly all right answers had more. As many as 21 agree on a pose beside the right one now
and then, so others are looked for until 45 do, and a target whose own patch is not recognised needs 30. With
so many the pose is known to a pixel. So what a slant leaves open (2.5 px are 4 mm at 1.6 m) is told, not
refused, and 30 patches overrule the target's own, which may be the border of a shadow that has gone on. The
narrow pair's stereo is 13 mm off at ten metres: 4 cm are three deviations."""
FOR_A_TOOL_M, TOOL_AWAY_M, MOST_ASKED = 0.006, 2.0, 4
"""Error of an answer with which a tool may be put on it, from how near that matters (the arm reaches what is
0.8 to 1.6 m from the mast), and how many narrow pairs are asked at most: each costs a second. 2 cm
(95 %) on a surface with relief are 7.3 mm, of which the match itself takes 4. Targets of days looked at were
refused as known to 2.3 to 2.5 cm, one of them 3 mm off (494705035 to 494705038, 105976488)."""
TOOL_M = 0.0073
"""Those 7.3 mm: what is told of a target within reach, and is more, is asked of the pictures again."""
LEAST_SCORE = 0.75
"""Correlation that a target needs in another picture of one stop, and of a pair that is kept by few patches;
that of the key template."""
COASTING = 0.75
"""Most confidence in a target that is not seen: as much as in one that was just found again."""
SOUGHT_M, SOUGHT_SHARE = 0.15, 0.2
"""Error of a coasting target from which on the narrow pair looks for it from any range, and how far the rover
must have come since it did, as a share of the range: a look costs seconds, and what hides it hides it for a
while."""
TIED_M = 10.0
"""From how near a target is tied to another narrow pair, and looked for with it however well the map has it:
from farther a pixel is 3 mm and more."""
TURNED_RAD, TRIED_RAD = math.radians(25.0), math.radians(15.0)
"""How far the line of sight to a target in sight, or the sun, must have turned from those of all pairs that
are kept until another is taken, and since one was taken in vain."""
AGREED_M = 0.03
"""How far apart two answers from near may be, from two places, that have a target in sight elsewhere: what
two looks have, of dozens of patches each, is believed."""
RANGE_ASTRAY = 6.63
"""Squared distance, in deviations, of a range from where earlier answers and the drive have the target, over
which it is not believed: 99 % of chi square with one degree of freedom. In the shade of a smooth face both
cascade and window had a target 2.4 cm too near from three stops, at 8.6, and the tool was put down 2.3 cm
beside it (242085, looked at); 30 right answers of three days had 2.4 at most."""
GONE_M = 1.0
"""Error of a lost target from which on it is given up: the narrow pair sees as much to either side at 7 m."""
TWO_LOOKS_RAD = 0.0017
"""Error of the mast between two looks: 1.2 mrad in each."""


@dataclass(slots=True, eq=False)
class _Memory:
    """The pairs in which a target is known, and how it went since.

    `asked` is the place (3,), m, of the eye when they were last asked from near, `share` how far it must have
    come since, of the range. `against` is how far off (3,), m, an answer had the target that was not taken
    over. `refused` counts the times that they were asked in vain for a lost target, `in_vain` those since
    they showed it, `confirmed` tells whether they have shown the target since. `expected` is where it should
    be seen next (3,), m, and the covariance (3, 3), m^2, of that; `sought` is the place (3,), m, of the eye
    when the narrow pair last looked for it from afar, `deep_m` what the last answer left open along the line
    of sight (`TrackUpdate`).
    """

    known: References
    asked: Array | None = None
    share: float = AGAIN
    against: Array | None = None
    refused: int = 0
    in_vain: int = 0
    confirmed: bool = False
    astray_m: float = 0.0
    expected: tuple[Array, Array] | None = None
    sought: Array | None = None
    deep_m: float = 0.0


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
            kept = Kept(Side(sight.view, NEAREST_M), sight.pixel, update.position, MEANT_M)
            self._memories[target] = _Memory(References([kept]))
        return update

    def update(self, target: str, view: StereoView) -> TrackUpdate:
        """See `Tracker`."""
        update = self.tracker.update(target, view)
        memory = self._memories.get(target)
        if memory is None:
            return update
        confirmed = memory.confirmed
        believed, anew = _doubts(memory, update, view)
        if update.state is not TrackState.TRACKED:
            update = believed
        eye = view.left_camera.C
        away = float(np.linalg.norm(update.position - eye))
        if away <= RECALL_M:
            update = self._from_near(target, memory, view, update, believed, anew=anew)
            if confirmed and memory.confirmed:
                update = _range_in_doubt(memory, update, view)
        elif _is_sought(memory, update, eye, away, view.t_s):
            update = self._from_afar(target, memory, view, update)
        if memory.refused >= REFUSED:
            return replace(update, state=TrackState.FAILED)
        if away > RECALL_M and not memory.refused and memory.expected is not None:
            update = coasting(update)
        if memory.asked is not None and (not memory.confirmed or memory.in_vain >= IN_VAIN):
            update = replace(update, covariance=update.covariance + UNCONFIRMED_M**2 * np.eye(3))
        if memory.confirmed:
            update = _deepened(update, view, memory.deep_m)
        return update if memory.against is None else _doubted(update, memory.against)

    def _from_near(
        self,
        target: str,
        memory: _Memory,
        view: StereoView,
        update: TrackUpdate,
        believed: TrackUpdate,
        *,
        anew: bool,
    ) -> TrackUpdate:
        """Return a target near by as the pictures have it; else `update`, as correlation has it.

        They are asked round where it is `believed`, where the rover has come far enough or must know `anew`.
        """
        eye = view.left_camera.C
        away = float(np.linalg.norm(update.position - eye))
        come = math.inf if memory.asked is None else float(np.linalg.norm(eye - memory.asked))
        due = anew or come >= memory.share * away
        pair = _taken(self.wide, target, believed.position) if due else None
        if pair is not None:
            memory.asked, memory.share = eye, AGAIN
            found = self._recalled(target, memory, pair, update, believed)
            if found is not believed:
                # its pixel is of the wider pair
                pixel = np.asarray(view.left_camera.project(found.position), dtype=np.float64)
                update = replace(found, pixel=pixel)
            memory.refused = memory.refused + 1 if update.state is TrackState.LOST else 0
            memory.in_vain = memory.in_vain + 1 if found is believed else 0
        if believed is not update and not memory.confirmed and memory.against is None:
            memory.against = believed.position - update.position
        return update

    def _from_afar(self, target: str, memory: _Memory, view: StereoView, update: TrackUpdate) -> TrackUpdate:
        """Return a target as the narrow pair has it from afar, a pair that is then kept; else `update`."""
        pair = _taken(self.narrow, target, update.position)
        if pair is None:
            return update
        eye = view.left_camera.C
        memory.sought = eye
        memory.known.tried = update.position - eye, view.t_s
        away = float(np.linalg.norm(update.position - eye))
        side = Side(pair, DEPTHS[0] * away, farthest_m=DEPTHS[1] * away)
        for kept in memory.known.likeliest(eye, update.position, view.t_s):
            guess = Transform(np.eye(3), update.position - kept.point)
            model = kept.side.moved(guess)
            answer = cascade(Handoff(side, model, kept.pixel), "near", LAID)
            if not answer.accepted or _hardly_shown(answer):
                continue
            shown = Shown.of(answer, kept, side, model.view.left_camera.transformed(answer.motion))
            if _elsewhere(answer, shown.across_m, eye, update, memory):
                continue
            sigma_m = math.hypot(shown.across_m, MEANT_M)
            memory.known.keep(Kept(side, answer.pixel, answer.position, sigma_m))
            covariance = shown.covariance + (TWO_LOOKS_RAD * shown.away_m) ** 2 * np.eye(3)
            pixel = np.asarray(view.left_camera.project(answer.position))
            drift = covariance, np.zeros((3, 2))
            if np.isfinite(pixel).all() and self.tracker.put(target, view, pixel, drift, away):
                # the wide pair has the spot from there on, the narrow one has its range
                self.tracker.recognised(target)
                update = self.tracker.last(target)
            elif update.state is not TrackState.TRACKED:
                update = replace(update, state=TrackState.TRACKED, confidence=COASTING, pixel=pixel)
                update = replace(update, reasons=())
            return replace(update, position=answer.position, covariance=covariance)
        return update

    def _recalled(
        self, target: str, memory: _Memory, pair: StereoView, track: TrackUpdate, update: TrackUpdate
    ) -> TrackUpdate:
        """Return the target as the kept pair has it in a wide one that knows it best; `update`, round which
        it is asked, if none has. `track` is what correlation has.

        The likeliest are asked first; others only where those know it too poorly for a tool.
        """
        side, known, before = Side(pair, NEAREST_M), memory.known, memory.against
        eye = pair.left_camera.C
        answers: list[Shown] = []
        recognised = False
        first, *others = known.likeliest(eye, update.position, pair.t_s, MOST_ASKED)
        for kept in (first, *others[:1], known.near, *others[1:]):
            if kept is None or (kept in others[1:] and not answers):
                continue
            guess = Transform(np.eye(3), update.position - kept.point)
            model = kept.side.moved(guess)
            answer = cascade(Handoff(side, model, kept.pixel), "near", LAID)
            if not answer.accepted:
                continue
            standing = model.view.left_camera.transformed(answer.motion)
            if kept is not known.near and edge_before(side, standing, kept.pixel, answer.position):
                continue
            gap = np.asarray(answer.position - update.position)
            if float(np.linalg.norm(gap)) > _reach_m(answer, update, memory):
                memory.against = gap
                again = before is not None and float(np.linalg.norm(gap - before)) < AGREED_M
                if not again:
                    continue
            shown = Shown.of(answer, kept, side, standing)
            if _against_track(shown, track, memory):
                continue
            if kept is known.near and _against_map(shown, memory):
                continue
            if not answers or answers[0].same_spot(shown):
                answers.append(shown)
                # the last wide pair shows what was followed there, be it the target or not
                recognised = recognised or kept is not known.near
            if shown.away_m > TOOL_AWAY_M or answers[-1].across_m <= FOR_A_TOOL_M:
                break
        for shown in sorted(answers, key=lambda one: one.across_m):
            answer, away = shown.answer, shown.away_m
            drift = shown.across_m**2 * np.eye(3), np.zeros((3, 2))
            # two pairs and dozens of patches have the surface: the tracker's window of this one alone may
            # hold what lies behind an edge
            known_range = KnownRange(away, range_error_m(pair, away))
            if not self.tracker.put(target, pair, answer.pixel, drift, away, known=known_range):
                continue
            if recognised:
                self.tracker.recognised(target)
            found = self.tracker.last(target)
            sigma_m = math.hypot(shown.across_m, MEANT_M)
            known.near = Kept(side, answer.pixel, found.position, sigma_m)
            memory.share, memory.against, memory.confirmed = ONCE_MORE, None, True
            memory.deep_m = shown.deep_m
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

    def take_back(
        self, target: str, view: StereoView, position: Array, covariance: Array
    ) -> TrackUpdate | None:
        """See `TakesBack`; it is as well confirmed as the covariance says, if pictures have ever shown it."""
        update = self.tracker.take_back(target, view, position, covariance)
        if update is not None and target in self._memories:
            memory = self._memories[target]
            memory.refused, memory.against = 0, None
            # what surroundings carry along is no better meant than it was
            memory.confirmed = memory.known.near is not None
        return update

    def predicted(self, target: str) -> Array:
        """See `Tracker`."""
        return self.tracker.predicted(target)

    def expect(self, target: str, position: Array, covariance: Array) -> None:
        """See `Expects`."""
        self.tracker.expect(target, position, covariance)
        if target in self._memories:
            self._memories[target].expected = position, covariance

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


def _doubts(memory: _Memory, update: TrackUpdate, view: StereoView) -> tuple[TrackUpdate, bool]:
    """Return the answer of correlation, where the drive and the other targets have the target if that is lost
    or contradicts them; and whether the pictures, which have shown it, are to be asked at once: at its goal
    the rover comes no nearer.
    """
    lost = update.state is not TrackState.TRACKED
    astray = _astray(memory, update)
    anew = memory.confirmed and (lost or astray or _blurred(memory, update, view))
    if not (lost or astray):
        return update, anew
    memory.confirmed, memory.share = False, AGAIN
    if memory.expected is None:
        return update, anew
    position, covariance = memory.expected
    believed = replace(update, position=position, covariance=covariance)
    # correlation may have given it up: the pictures have not
    return replace(believed, state=TrackState.LOST) if lost else believed, anew


def _astray(memory: _Memory, update: TrackUpdate) -> bool:
    """Return whether correlation follows a target that the pictures have shown where neither the drive nor
    the other targets have it: on an edge that turns away it slides, and tells millimetres.
    """
    if not memory.confirmed or memory.expected is None or update.state is not TrackState.TRACKED:
        return False
    expected, covariance = memory.expected
    gap = update.position - expected
    return float(gap @ np.linalg.solve(covariance + update.covariance, gap)) > ASTRAY


def _range_in_doubt(memory: _Memory, update: TrackUpdate, view: StereoView) -> TrackUpdate:
    """Return an answer with the range that earlier answers have where its own contradicts them.

    They are of pictures from several places, which one stereo pair in poor light does not outvote, nor the
    next ones of that light; but either may be right, so their difference is told as two deviations. Where the
    pixel shows what hides the target, the hazcams range that too, so a hand-off inherits the doubt.
    """
    if memory.expected is None or update.state is not TrackState.TRACKED:
        return update
    expected, covariance = memory.expected
    ray = update.position - view.left_camera.C
    ray = ray / np.linalg.norm(ray)
    gap_m = float((update.position - expected) @ ray)
    own_m2, open_m2 = float(ray @ update.covariance @ ray), float(ray @ covariance @ ray)
    as_before = memory.astray_m != 0.0 and gap_m / memory.astray_m > 0.5
    if gap_m**2 <= RANGE_ASTRAY * (own_m2 + open_m2) and not as_before:
        memory.astray_m = 0.0
        return update
    memory.astray_m = gap_m
    wider_m2 = max(0.0, open_m2 + (gap_m / 2.0) ** 2 - own_m2)
    return replace(
        update,
        position=update.position - gap_m * ray,
        covariance=update.covariance + wider_m2 * np.outer(ray, ray),
    )


def _blurred(memory: _Memory, update: TrackUpdate, view: StereoView) -> bool:
    """Return whether a target within reach is known too poorly for a tool since the pictures have shown it:
    what a chain of templates adds as the rover goes round it, they take away.
    """
    within = float(np.linalg.norm(update.position - view.left_camera.C)) <= TOOL_AWAY_M
    worst_m = math.sqrt(float(np.linalg.eigvalsh(update.covariance)[-1]))
    return within and memory.share == ONCE_MORE and worst_m > TOOL_M


def _recognised(answer: Answer) -> bool:
    """Return whether so many patches and the target's own have a target that nothing else need say so."""
    return answer.score >= LAID.own_score and answer.agreeing >= LAID.drape.enough


def _hardly_shown(answer: Answer) -> bool:
    """Return whether neither many patches nor the target's own tell it well enough for a pair to be kept.

    All later answers are of that pair. On 568991 and 138306474 (looked at) pairs were kept with the target 71
    and 40 mm beside its place, the sun having gone on by 25 degrees, by 31 and 35 patches and an own one of
    0.52 and 0.25. Of 31 right answers from afar of 14 looked-at days (training seeds 117438 to 856123 and the
    three of `ASIDE`) those with fewer than 45 patches had 0.90 and more.
    """
    return answer.agreeing < LAID.drape.enough and answer.score < LEAST_SCORE


def _against_track(shown: Shown, track: TrackUpdate, memory: _Memory) -> bool:
    """Return whether few patches have a target that is lost, or that pictures have shown, elsewhere than its
    track.

    So near nearly all of a kept picture may be out of sight, and those that are left agree on another pose.
    On 121977352 (looked at) twenty patches and an own one of 0.49 had a target 27 mm beside its place, told
    as 4, that its track had to 5; on 25774355 nineteen and one of 0.67 a lost target 39 mm. Six other answers
    by so little, of 21 days, were 1 to 17 mm off, all of targets that were tracked.

    Where the drive and the other targets contradict the track, few patches may say which of them is right,
    but not that neither is: on 306306749 (looked at) the map was 3 cm off, and 21 patches and an own one of
    0.47 had a target 56 mm beside its place that its track had to 6.
    """
    if track.state is not TrackState.TRACKED:
        return _hardly_shown(shown.answer)
    if memory.known.near is None or _recognised(shown.answer):
        return False
    places = [(track.position, track.covariance)]
    if not memory.confirmed and memory.expected is not None:
        places.append(memory.expected)
    looks_m2 = (TWO_LOOKS_RAD * shown.away_m) ** 2
    return all(
        _squared(shown.answer.position - place, covariance + shown.covariance, looks_m2) > ASTRAY
        for place, covariance in places
    )


def _against_map(shown: Shown, memory: _Memory) -> bool:
    """Return whether an answer has a target elsewhere than the drive and the other targets have it.

    The last wide pair recognises what was followed there, be it the target or not. On 21927 (looked at) one
    had slid over a crest, and by 130 to 136 patches the pairs after it had the target 10 cm behind its place,
    told as 12 mm; the map had it to 5.
    """
    if memory.expected is None:
        return False
    expected, covariance = memory.expected
    looks_m2 = (TWO_LOOKS_RAD * shown.away_m) ** 2
    return _squared(shown.answer.position - expected, covariance + shown.covariance, looks_m2) > ASTRAY


def _reach_m(answer: Answer, update: TrackUpdate, memory: _Memory) -> float:
    """Return how far off an answer may have a target, metres.

    By what is told of one that is tracked. A lost one is put farther off only if it was recognised: wheels
    that are stuck take the map away by more than it tells.
    """
    told_m = math.sqrt(INSIDE[2] * float(np.linalg.eigvalsh(update.covariance)[-1]))
    if update.state is TrackState.TRACKED:
        return min(LOST_M, max(ASTRAY_M, FARTHER * told_m))
    if memory.expected is None or _recognised(answer):
        return LOST_M
    return ASTRAY_M if told_m <= LOST_M else 0.0


def _is_sought(memory: _Memory, update: TrackUpdate, eye: Array, away_m: float, t_s: float) -> bool:
    """Return whether the narrow pair should look for a far target now.

    For one that is lost and known too poorly; for one that is lost and to which the rover comes, each fifth
    of its range; and for one, lost or not, that is seen from another side or in another light than in all the
    pairs that are kept: once it is near, none of them would show it.
    """
    if memory.expected is None:
        return False
    if away_m <= TIED_M and memory.known.outdated(eye, update.position, t_s, TURNED_RAD, TRIED_RAD):
        return True
    if update.state is TrackState.TRACKED:
        return False
    if memory.sought is None:
        come_m = nearer_m = math.inf
    else:
        come_m = float(np.linalg.norm(eye - memory.sought))
        nearer_m = float(np.linalg.norm(update.position - memory.sought)) - away_m
    sigma2_m2 = float(np.linalg.eigvalsh(memory.expected[1])[-1])
    if sigma2_m2 >= SOUGHT_M**2:
        return come_m >= SOUGHT_SHARE * away_m
    return away_m <= TIED_M and nearer_m >= SOUGHT_SHARE * away_m


def _elsewhere(answer: Answer, sigma_m: float, eye: Array, update: TrackUpdate, memory: _Memory) -> bool:
    """Return whether an answer from afar is another spot than the drive and the other targets have.

    What is taken for the target there moves the map, and all targets with it, and all later answers are of
    that pair. So far from where it is believed it must have been recognised itself, and many patches with it;
    and so it must where a track contradicts it: the sun goes on, and patches at borders of shadows have a
    target beside its place together. On 138306474 (looked at) 35 had one 4 cm off, by an own patch of 0.25,
    that its track had to 0.3 cm; six other answers of five days had 45 patches and more, and 0.70 and more.
    """
    assert memory.expected is not None
    expected, covariance = memory.expected
    looks_m2 = TWO_LOOKS_RAD**2 * float(np.sum((answer.position - eye) ** 2))
    if _squared(answer.position - expected, TAILS**2 * covariance, looks_m2) > ASTRAY:
        return True
    if _recognised(answer):
        return False
    gap = answer.position - update.position
    if float(np.linalg.norm(gap)) > LOST_M:
        return True
    tracked = update.state is TrackState.TRACKED
    return tracked and _squared(gap, update.covariance, looks_m2 + sigma_m**2) > ASTRAY


def _squared(gap: Array, covariance: Array, more_m2: float) -> float:
    """Return the squared length, in deviations, of a gap (3,), m, of a covariance (3, 3), m^2, and a variance
    in all directions besides.
    """
    return float(gap @ np.linalg.solve(covariance + more_m2 * np.eye(3), gap))


def coasting(update: TrackUpdate) -> TrackUpdate:
    """Return an answer about a far target: tracked, if it is lost but likely to be found again from near.

    Its confidence is the chance that it is believed near enough for that (`LOST_M`, in two dimensions). With
    less it is lost, but not given up: a drive that has begun may still come to where it is found.
    """
    if update.state is TrackState.TRACKED:
        return update
    sigma2_m2 = float(np.linalg.eigvalsh(update.covariance)[-1])
    confidence = COASTING * -math.expm1(-0.5 * LOST_M**2 / sigma2_m2)
    if confidence < 0.5:
        return update if sigma2_m2 < GONE_M**2 else replace(update, state=TrackState.FAILED)
    reason = f"out of sight, known to {math.sqrt(sigma2_m2):.2f} m by the drive and the other targets"
    reasons = (reason, *update.reasons)
    return replace(update, state=TrackState.TRACKED, confidence=confidence, reasons=reasons)


def _deepened(update: TrackUpdate, view: StereoView, deep_m: float) -> TrackUpdate:
    """Return an answer that tells how deep, m, the surface is within what the pixel is off."""
    if update.state is not TrackState.TRACKED:
        return update
    ray = update.position - view.left_camera.C
    along = np.outer(ray, ray) / float(ray @ ray)
    return replace(update, covariance=update.covariance + deep_m**2 * along, deep_m=deep_m)


def _doubted(update: TrackUpdate, gap: Array) -> TrackUpdate:
    """Return an answer that tells of a contradiction by (3,), m: nothing says which is right."""
    return replace(update, covariance=update.covariance + np.outer(gap, gap))
