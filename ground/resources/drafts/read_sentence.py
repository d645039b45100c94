"""Plain sentences read among the targets, instruments and times of a mission: previews and drafts."""

from __future__ import annotations

import math
from statistics import NormalDist
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.day.rovers import instrument_name, profile_of
from ground.errors import InvalidInputError
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.get_resource import find_row
from ground.resources.drafts.bodies import DraftCreate, Sentence
from ground.resources.drafts.create_draft import create_draft
from ground.resources.drafts.grammar import Said, understand
from ground.resources.drafts.phrases import QuestionError, Surroundings
from ground.resources.drafts.value import Draft, SentenceAnswer
from ground.resources.missions.kind import MISSION
from ground.resources.missions.row import MissionRow
from ground.resources.observation_requests.row import ObservationRequestRow
from ground.resources.problems.mission_day import choose_sol
from ground.resources.targets.row import TargetRow
from mission.soltime import SOL_S

SYNONYMS = {"mast camera": "science_camera", "microscope": "microscopic_imager"}
"""Words of people for instruments, where the rover has one of that name."""
VALUE = 10.0
"""What a request is worth whose sentence does not say it; the preview names it."""
RARE = 0.001
"""Chance that an observation takes longer than what is checked against *at most*; set by us, no source."""
CORNERS = 24
"""Of the polygon round a circle: it is 0.9 % wider than the circle, and never inside it."""


def read_sentence(repo: Repository, actor: Actor, mission_id: str, given: Sentence) -> SentenceAnswer:
    """Return what a sentence would draft, or what has to be asked; nothing is written."""
    actor.require(Action.READ, mission_id)
    with repo.database.read() as session:
        mission = find_row(session, MISSION, mission_id)
        places = _places(session, mission_id)
        try:
            said = understand(given.text, Surroundings(places, _instruments(mission)))
            return _Former(session, mission, places).answer(said)
        except QuestionError as asked:
            return SentenceAnswer(False, [str(asked)], "", [], "", {})


def draft_sentence(repo: Repository, actor: Actor, mission_id: str, given: Sentence) -> Draft:
    """Return the draft of a sentence.

    Raises
    ------
    InvalidInputError
        If something has to be asked first; the message is the question.
    """
    actor.require(Action.DRAFT, mission_id)
    found = read_sentence(repo, actor, mission_id, given)
    if not found.understood:
        raise InvalidInputError("; ".join(found.questions), pointer="/text")
    form = DraftCreate.model_validate({found.kind: found.form, "note": given.text})
    return create_draft(repo, actor, mission_id, form)


def _places(session: Session, mission_id: str) -> dict[str, tuple[float, float]]:
    query = select(TargetRow.name, TargetRow.east_m, TargetRow.north_m)
    return {
        r.name: (r.east_m, r.north_m)
        for r in session.execute(query.where(TargetRow.mission_id == mission_id))
    }


def _instruments(mission: MissionRow) -> dict[str, str]:
    """Return the words for the instruments of a mission's rover, with the name that requests hold."""
    profile = profile_of(mission.rover_profile)
    found: dict[str, str] = {}
    for key in profile.instruments:
        name = instrument_name(profile, key)
        found |= dict.fromkeys((key.lower(), name.lower(), name.lower().replace("_", " ")), name)
    found |= {word: name for word, name in SYNONYMS.items() if name in found.values()}
    return found


class _Former:
    """Makes forms of what sentences say, among the rows of a mission."""

    def __init__(self, session: Session, mission: MissionRow, places: dict[str, tuple[float, float]]) -> None:
        self.session, self.mission, self.places = session, mission, places

    def answer(self, said: Said) -> SentenceAnswer:
        """Return the form of what was said and what accepting it does, in words."""
        if said.kind == "keep_out":
            return self._keep_out(said)
        return self._window(said) if said.kind == "window" else self._request(said)

    def _keep_out(self, said: Said) -> SentenceAnswer:
        if said.circle_m is not None:
            east, north, radius = said.circle_m
            told = f"a circle of {radius:g} m round ({east:g}, {north:g})"
            outer = radius / math.cos(math.pi / CORNERS)
            turns = [2.0 * math.pi * k / CORNERS for k in range(CORNERS)]
            polygon = [[east + outer * math.cos(t), north + outer * math.sin(t)] for t in turns]
        else:
            polygon = [list(corner) for corner in said.polygon_m or ()]
            told = "the polygon " + ", ".join(f"({e:g}, {n:g})" for e, n in polygon)
        return SentenceAnswer(
            True, [], f"Keep the rover out of {told}.", [], "keep_out", {"polygon_m": polygon}
        )

    def _window(self, said: Said) -> SentenceAnswer:
        assert said.window_lmst_h is not None  # the grammar asks for it
        requests = self.session.scalars(
            select(ObservationRequestRow)
            .join(TargetRow, TargetRow.id == ObservationRequestRow.target_id)
            .where(ObservationRequestRow.mission_id == self.mission.id, TargetRow.name == said.target)
        ).all()
        if len(requests) != 1:
            raise QuestionError(
                f"which request is meant? {said.target} has {len(requests)}; a window belongs to exactly one"
            )
        form = {"request_id": requests[0].id, "window_s": self._seconds(said.window_lmst_h)}
        told = f"Let the observation of {said.target} with {requests[0].instrument} start {_clock(said)}."
        return SentenceAnswer(True, [], told, [], "window", form)

    def _request(self, said: Said) -> SentenceAnswer:
        assert said.instrument is not None  # the grammar asks for it
        form: dict[str, Any] = {
            "instrument": said.instrument,
            "value": VALUE if said.value is None else said.value,
        }
        assumed = [f"value {VALUE:g}"] if said.value is None else []
        if said.target is not None:
            query = select(TargetRow.id).where(
                TargetRow.mission_id == self.mission.id, TargetRow.name == said.target
            )
            form["target_id"] = self.session.scalars(query).one()
            told = f"Observe the target {said.target}"
        else:
            assert said.place_m is not None  # the grammar asks for it
            east, north = said.place_m
            form["target"] = {"east_m": east, "north_m": north, "notes": said.what or ""}
            told = f"Make a target ({said.what}) at ({east:g}, {north:g}) and observe it"
        told += f" with {said.instrument}, worth {form['value']:g}"
        if said.must_do:
            form["must_do"] = True
            told += ", in every plan"
        if said.window_lmst_h is not None:
            form["window_s"] = self._seconds(said.window_lmst_h)
            told += f", starting {_clock(said)}"
        if said.dwell_s is not None:
            form["dwell_s"] = said.dwell_s
            told += f", for {said.dwell_s:g} s"
        if said.at_most_s is not None:
            mean_s, longest_s = self._takes_s(said)
            if longest_s > said.at_most_s:
                raise QuestionError(
                    f"{said.instrument} takes {mean_s:g} s on average and {longest_s:.0f} s once in "
                    f"{1 / RARE:.0f} times, more than the {said.at_most_s:g} s allowed, and nothing cuts an "
                    "observation short; allow more, or which other instrument?"
                )
            told += (
                f" (it takes {mean_s:g} s on average and more than {longest_s:.0f} s once in {1 / RARE:.0f} "
                f"times; {said.at_most_s:g} s are allowed)"
            )
        return SentenceAnswer(True, [], told + ".", assumed, "request", form)

    def _takes_s(self, said: Said) -> tuple[float, float]:
        """Return the mean time of an observation, seconds, and one that it hardly ever takes longer than."""
        profile = profile_of(self.mission.rover_profile)
        time_s = profile.instruments[profile.instrument_key(str(said.instrument))].time_s
        longest_s = time_s.mean
        if time_s.sd > 0.0:
            spread = math.sqrt(math.log1p((time_s.sd / time_s.mean) ** 2))  # lognormal, as the simulator's
            longest_s *= math.exp(NormalDist().inv_cdf(1.0 - RARE) * spread - spread**2 / 2)
        beside_s = said.dwell_s or 0.0
        return time_s.mean + beside_s, longest_s + beside_s

    def _seconds(self, window_lmst_h: tuple[float, float]) -> list[float]:
        """Return a window of the Mars clock as seconds of the plan clock of the mission's sol."""
        sol = choose_sol(self.session, self.mission.id, None)
        opens, closes = ((hour - sol.start_lmst_h) * SOL_S / 24.0 for hour in window_lmst_h)
        if closes < 0.0 or opens > sol.time_budget_s:
            raise QuestionError(
                f"which other time is meant? {_hours(window_lmst_h)} lies outside sol {sol.number}; its plan "
                f"starts at {_hour(sol.start_lmst_h)} and has {sol.time_budget_s:g} s"
            )
        return [max(0.0, round(opens, 1)), round(closes, 1)]


def _hour(hour: float) -> str:
    minutes = round(hour * 60.0)
    return f"{minutes // 60:02d}:{minutes % 60:02d}"


def _hours(window: tuple[float, float]) -> str:
    return f"{_hour(window[0])} to {_hour(window[1])} LMST"


def _clock(said: Said) -> str:
    assert said.window_lmst_h is not None
    return f"from {_hours(said.window_lmst_h)}"
