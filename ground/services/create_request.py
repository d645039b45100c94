"""File an observation request on a target."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict

from ground.errors import InvalidInputError
from ground.gdr import values as v
from ground.gdr.ids import new_id
from ground.gdr.models import ObservationRequestRow, TargetRow
from ground.gdr.repository import Repository
from ground.services.actor import Action, Actor
from ground.services.checks import require_after, require_window
from ground.services.edit import insert
from ground.services.kinds import KINDS
from ground.services.place_rover import place_rover
from ground.services.views import show_requests


def create_request(
    repo: Repository,
    actor: Actor,
    mission_id: str,
    *,
    target_id: str,
    instrument: v.Instrument,
    value: float,
    tracked: bool | None = None,
    window_s: Sequence[float] | None = None,
    after: Sequence[str] = (),
    must_do: bool = False,
    dwell_s: float | None = None,
    notes: str = "",
    observation_pose: v.Pose | None = None,
) -> v.ObservationRequest:
    """Return a new request with its observation point.

    A contact instrument needs its target tracked, so `tracked` left open means that. A point that cannot be
    reached does not stop the request: it says so, and plans leave it out.
    """
    actor.require(Action.EDIT_SCIENCE, mission_id)
    require_window(window_s)
    with repo.database.read() as session:
        target = session.get(TargetRow, target_id)
        if target is None or target.mission_id != mission_id:
            raise InvalidInputError(
                f"there is no target {target_id} in mission {mission_id}", pointer="/target_id"
            )
        point = place_rover(repo, session, target, instrument, observation_pose)
    with repo.database.write() as session:
        require_after(session, mission_id, None, after)
        row = ObservationRequestRow(
            id=new_id("req"),
            author=actor.name,
            mission_id=mission_id,
            target_id=target_id,
            instrument=instrument.value,
            value=value,
            tracked=tracked if tracked is not None else instrument is v.Instrument.MICROSCOPIC_IMAGER,
            window_s=None if window_s is None else list(window_s),
            after=list(after),
            must_do=must_do,
            dwell_s=dwell_s,
            notes=notes,
            observation_point=None if point is None else asdict(point),
            state=v.RequestState.OPEN.value,
            state_reason="",
        )
        insert(session, actor, KINDS["observation_request"], row)
        return show_requests(session, [row])[0]
