"""The search for a place: the designated point, then others of the same rock."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from rover_iface.frames import across
from rover_iface.placement.arm import ArmRefusal, Posture
from rover_iface.placement.arm_motion import Motion
from rover_iface.placement.base_adjustment import base_move, view_move
from rover_iface.placement.cloud import Array
from rover_iface.placement.joint_check import RELIEF, UNKNOWING, JointCheck
from rover_iface.placement.narrow_looks import LOOK_REACH_M, UNSEEN, NarrowLooks, Sight
from rover_iface.placement.patch_check import Judged
from rover_iface.placement.segmentation import RockSegment
from rover_iface.placement.verdict import Decision, Finding, PlacementVerdict, Reason
from rover_iface.profile import RoverProfile

ArmCheck = Callable[[Array, Array], Posture | Motion | ArmRefusal]
"""Asked for a surface point (3,) and its outward unit normal (3,), rover frame. `arm.solve` is one; so is a
call of `plan_motion` with its obstacles, whose refusal on collision counts like any other."""


MOST_ASKED = 200
"""How many safe points the arm is asked for before the rover is said to be in the wrong place."""

PROMISING = UNKNOWING | RELIEF | {Reason.OFF_ROCK}
"""What a narrow look may know better than the other clouds."""


SPOT_KNOWN_M, ROUND = (0.002, 0.003), 8
"""How far from the designated point places are tried that are as good an answer, and how many on each circle:
that point is 3.3 mm off the one that was meant in the median (docs/results/placement.md, the spot)."""


class Search:
    """What was tried for one designated point (3,)."""

    def __init__(
        self,
        check: JointCheck,
        at: Array,
        ask: ArmCheck,
        rock: RockSegment | None,
        looks: NarrowLooks,
    ) -> None:
        self.check, self.at, self.ask, self.rock, self.looks = check, at, ask, rock, looks
        self.first: Judged | None = None
        self.out_of_reach: Judged | None = None
        self.crease: Finding | None = None
        self.hopeful = True
        """Whether nothing that is known of the designated point speaks against it, but that it is not known
        well enough, or that the arm does not hold the tool as it should."""
        self.left: Finding | None = None
        """Why the designated point was left though nothing is wrong with the surface there."""
        self.close: list[Judged] = []
        """Points that only a close look would take."""
        self.unsure: list[Judged] = []
        """Points that a narrow look may know better."""
        self.fair: list[Judged] = []
        """Points that a narrow look shows to be good, but not calm."""
        self.tried = self.asked = 0

    def designated(self) -> PlacementVerdict | None:
        """Judge the designated point; None if it is not to be taken before others are looked at.

        It is what was asked for, so it need not be calm; but it must keep the limits, or bear a close look,
        with room. What the narrow pair shows of it decides, where it shows enough.
        """
        judged = self.judge(self.at)
        promising = _promising(judged)
        # what a cloud says of a place that it does not know is worth no more than the next look
        self.hopeful = promising or any(finding.reason in UNKNOWING for finding in judged.findings)
        opinion = self.looks.opinion(self.at, anew=True) if self.hopeful else UNSEEN
        if opinion.sight is Sight.BAD and opinion.finding is not None:
            self.hopeful = False
            self.first = judged.with_finding(opinion.finding)
            return None
        if not promising:
            return None
        if opinion.judged is not None:
            posture = self.reached(opinion.judged)
            if posture is not None:
                return self.taken(opinion.judged, posture, designated=True)
            # the others, who know the normal worse, are not asked whether it can be reached after all
            if self.out_of_reach is not None:
                self.first = judged.with_finding(self.out_of_reach.findings[-1])
            return None
        if judged.normal is None or not (self.roomy(judged) or judged.close_strain <= 1.0):
            return None
        posture = self.reached(judged)
        if posture is not None:
            return self.taken(judged, posture)
        if judged.findings:
            self.asked = 0  # what only a close look takes does not end the search for what is safe
        return None

    def as_near_as_known(self) -> PlacementVerdict | None:
        """Return the verdict for a place no farther from the designated point than that itself is known,
        which a look that was had shows to be good; None if there is none.

        A rim or a spike at the border of what is borne is left behind by two millimetres.
        """
        first, limits = self.first, self.check.limits
        if first is None or first.normal is None:
            return None
        one, two = across(first.normal)
        asked = self.asked
        for away in SPOT_KNOWN_M:
            opinions = [
                (place, self.looks.opinion(place))
                for place in (
                    self.at + away * (math.cos(turn) * one + math.sin(turn) * two)
                    for turn in np.arange(ROUND) * math.tau / ROUND
                )
            ]
            good = [
                opinion.judged
                for place, opinion in opinions
                if opinion.judged is not None and _promising(self.judge(place))
            ]
            for judged in sorted(good, key=lambda one: one.strain):
                if (posture := self.reached(judged, limits.beside_sigmas)) is not None:
                    return self.taken(judged, posture)
            if all(opinion.sight is Sight.BAD for _, opinion in opinions):
                break
        self.asked = asked  # what was asked for so near does not end the search for what is safe
        return None

    def from_another_side(self, profile: RoverProfile, seen_from: Sequence[Array]) -> PlacementVerdict | None:
        """Return the move from whose end the designated point is seen from another side than from here and
        from the places (3,) of `seen_from`; None where there is none.
        """
        first = self.first
        assert first is not None
        normal = first.normal
        if normal is None:
            # a rock is about convex: its surface faces away from its middle
            normal = self.at - (
                self.check.cloud.points.mean(axis=0) if self.rock is None else self.rock.centroid
            )
            normal = normal / max(float(np.linalg.norm(normal)), 1e-9)
        move = view_move(self.check.cloud, profile, self.at, normal, seen_from)
        if isinstance(move, str):
            return None
        return PlacementVerdict(
            Decision.MOVE_BASE,
            self.at,
            normal,
            measures=first.measures,
            findings=first.findings or self._why_left(first),
            rock=self.rock,
            tried=self.tried,
            base_move=move,
        )

    def roomy(self, judged: Judged) -> bool:
        """Return whether a surface keeps every limit, and with room where it is not calm."""
        room = judged.restless is None or judged.strain <= self.check.limits.most_strain
        return not judged.findings and room

    def sweep(self, coarse: float) -> PlacementVerdict | None:
        """Judge the points of a grid, the nearest first; None if none can be taken."""
        limits = self.check.limits
        safe: list[Judged] = []
        tilted: list[tuple[Judged, Posture | Motion]] = []
        for point in self.check.candidates(self.at, coarse=coarse):
            if self.asked == MOST_ASKED:
                break
            judged = self.judge(point)
            if point is not self.at and (verdict := self.shown(judged)) is not None:
                return verdict
            if judged.normal is None:
                continue
            if not self.roomy(judged):
                if judged.close_strain <= 1.0:
                    self.close.append(judged)
            elif judged.restless is not None:
                safe.append(judged)
            elif (posture := self.reached(judged)) is not None:
                slope = self.slope(judged, posture)
                if slope > limits.calm_slope_rad:
                    self.leave(judged, Finding(Reason.SLOPE, slope, limits.calm_slope_rad, "rad"))
                    tilted.append((judged, posture))
                elif (verdict := self.settled(judged, posture)) is not None:
                    return verdict
        for judged, posture in tilted:
            if (verdict := self.settled(judged, posture)) is not None:
                return verdict
        return self.first_reached(sorted(safe, key=lambda one: one.strain))

    def first_reached(self, ordered: Sequence[Judged]) -> PlacementVerdict | None:
        """Return the verdict for the first of some points that the arm reaches and no narrow look refuses;
        None if there is none.
        """
        for judged in ordered:
            posture = self.reached(judged)
            if posture is not None and (verdict := self.settled(judged, posture)) is not None:
                return verdict
        return None

    def shown(self, judged: Judged) -> PlacementVerdict | None:
        """Return the verdict for a point that a narrow look which was had shows to be good with room and the
        arm reaches, else None.
        """
        if not _promising(judged):
            return None
        self.unsure.append(judged)
        return self.shown_well(judged.point)

    def shown_well(self, point: Array) -> PlacementVerdict | None:
        """Return the verdict for a point (3,) that a narrow look which was had shows to be calm, else None:
        the first of many that keep the limits lies at the border of what they allow.
        """
        good = self.looks.opinion(point).judged
        if good is None or good.strain > 1.0:
            return None
        if good.strain > self.check.limits.calm:
            self.fair.append(good)
            return None
        posture = self.reached(good, self.check.limits.beside_sigmas)
        return None if posture is None else self.taken(good, posture)

    def settled(self, judged: Judged, posture: Posture | Motion) -> PlacementVerdict | None:
        """Return the verdict for a safe point beside the designated one that the arm reaches, after a narrow
        look at it; None where that does not show it well.

        Nobody asked for that point, and there are others: what the narrow pair does not know is left.
        """
        self.looks.opinion(judged.point, anew=True)
        if self.looks.blind:
            return self.taken(judged, posture)
        return self.shown_well(judged.point)

    def by_looks(self) -> PlacementVerdict | None:
        """Return the verdict for a point that a narrow look alone shows to be good, where nothing is safe by
        the other clouds: the most promising places are looked at in turn. Where none is calm it is the good
        one of least strain; None if there is none.
        """
        hopes = sorted(self.unsure, key=lambda one: (len(one.findings), one.strain))
        fine = self.check.candidates(self.at, coarse=1.0)[1:]
        for hope in hopes:
            if self.looks.left == 0 or self.asked == MOST_ASKED:
                break
            if self.looks.told(hope.point):
                continue
            self.looks.opinion(hope.point, anew=True)
            # a look tells of more places than were judged in coarse steps; the nearest come first
            for point in fine:
                if np.linalg.norm(point - hope.point) >= LOOK_REACH_M or not _promising(self.judge(point)):
                    continue
                if (verdict := self.shown_well(point)) is not None:
                    return verdict
        for good in sorted(self.fair, key=lambda one: one.strain):
            if (posture := self.reached(good, self.check.limits.beside_sigmas)) is not None:
                return self.taken(good, posture)
        return None

    def judge(self, point: Array) -> Judged:
        """Judge one more point, the designated one once."""
        if self.first is not None and point is self.at:
            return self.first
        judged = self.check.judge(point, brief=self.first is not None)
        self.tried += 1
        self.first = self.first or judged
        return judged

    def reached(self, judged: Judged, sigmas: float | None = None) -> Posture | Motion | None:
        """Return the arm's answer for a safe point; None when it does not reach or would tilt the tool, or
        the point is not on the rock of the designated one.

        So many deviations of the normal count against it, those of the limits when None.
        """
        if self.asked == MOST_ASKED:
            return None
        self.asked += 1
        assert judged.normal is not None
        answer = self.ask(judged.point, judged.normal)
        if isinstance(answer, ArmRefusal):
            why = Finding(Reason.ARM, math.nan, math.nan, "", f"{answer.limit}: {answer.reason}")
        elif (unsure := self.unsure_rad(judged, sigmas)) > self.check.limits.most_normal_rad:
            why = Finding(Reason.NORMAL, unsure, self.check.limits.most_normal_rad, "rad")
        else:
            limits = self.check.limits
            slope = answer.tool_tilt_rad + unsure
            if slope <= limits.most_slope_rad:
                depth = self.check.crease_m(self.at, judged.point)
                if depth <= limits.most_crease_m:
                    return answer
                crease = Finding(Reason.CREASE, depth, limits.most_crease_m, "m")
                self.crease = self.crease or crease
                self.leave(judged, crease)
                return None
            why = Finding(Reason.SLOPE, slope, limits.most_slope_rad, "rad")
        refused = judged.with_finding(why)
        if self.first is judged:
            self.first = refused
        self.out_of_reach = self.out_of_reach or refused
        return None

    def leave(self, judged: Judged, why: Finding) -> None:
        """Take down why a point was left; only that of the designated one is told."""
        if judged is self.first:
            self.left = self.left or why

    def slope(self, judged: Judged, posture: Posture | Motion) -> float:
        """Return the angle between tool and normal, the uncertainty of that added."""
        return posture.tool_tilt_rad + self.unsure_rad(judged)

    def unsure_rad(self, judged: Judged, sigmas: float | None = None) -> float:
        """Return so many deviations of the normal (`reached`), rad."""
        assert judged.measures is not None
        sigmas = self.check.limits.sigmas if sigmas is None else sigmas
        return sigmas * judged.measures.normal_sigma_rad

    def taken(
        self, judged: Judged, posture: Posture | Motion, *, designated: bool = False
    ) -> PlacementVerdict:
        """Return the verdict for a safe point that the arm reaches; `designated` says that it is the one that
        was asked for, as a narrow look has it.
        """
        assert self.first is not None
        designated = designated or judged is self.first
        return PlacementVerdict(
            Decision.PLACE if designated else Decision.PLACE_NEAR,
            judged.point,
            judged.normal,
            float(np.linalg.norm(judged.point - self.at)),
            judged.measures,
            () if designated else self.first.findings or self._why_left(self.first),
            self.rock,
            self.tried,
            posture=posture,
        )

    def _why_left(self, first: Judged) -> tuple[Finding, ...]:
        return tuple(why for why in (first.restless, self.left) if why is not None)

    def not_placed(self, profile: RoverProfile) -> PlacementVerdict:
        """Return the refusal, or the move that would bring a safe point into reach."""
        assert self.first is not None
        away = self.out_of_reach
        if away is None:
            return PlacementVerdict(
                Decision.REFUSE,
                measures=self.first.measures,
                findings=self.first.findings if self.crease is None else (*self.first.findings, self.crease),
                rock=self.rock,
                tried=self.tried,
            )
        assert away.normal is not None
        # a normal that is not known well enough is no better known from beside the same stand
        unknown = away.findings[-1].reason is Reason.NORMAL
        moved = view_move if unknown else base_move
        move = moved(self.check.cloud, profile, away.point, away.normal)
        if isinstance(move, str):
            return PlacementVerdict(
                Decision.REFUSE,
                measures=away.measures,
                findings=(*away.findings, Finding(Reason.NO_BASE, math.nan, math.nan, "", move)),
                rock=self.rock,
                tried=self.tried,
            )
        return PlacementVerdict(
            Decision.MOVE_BASE,
            away.point,
            away.normal,
            float(np.linalg.norm(away.point - self.at)),
            away.measures,
            away.findings,
            self.rock,
            self.tried,
            base_move=move,
        )


def _promising(judged: Judged) -> bool:
    """Return whether all that is wrong with a place a narrow look may know better.

    Where no axis of approach is asked for a slope is nothing but what the normal may be off.
    """
    known = PROMISING if judged.measures is None or judged.measures.slope_rad else PROMISING | {Reason.SLOPE}
    return all(finding.reason in known for finding in judged.findings)
